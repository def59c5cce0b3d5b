"""Caches for what depends on the rig alone, a body or a pair of bodies without motions, so that it is computed once for
all clips. Bodies and matchings have a `rig`: one object for all clips of equal skeletons, or None where rest poses do
not show how the bodies stand, so that each clip has to show it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache, wraps
from typing import Any, TypeVar, cast

KEPT = 8  # the number of rigs, and of results of each function of rigs, that are kept: those used last

Value = TypeVar("Value")
Function = TypeVar("Function", bound=Callable[..., Any])


class of_rig(cached_property[Value]):  # noqa: N801 - a decorator
    """A cached property that does not depend on the motion; computed once for all owners with the same `rig`."""

    def __get__(self, owner: Any, kind: type | None = None) -> Value:  # type: ignore[override]
        """Return the value of the owner's rig."""
        rig = owner if owner is None or owner.rig is None else owner.rig
        value = cast(Value, super().__get__(rig, kind))
        if owner is not rig:
            vars(owner)[self.attrname or ""] = value
        return value


def found_once(function: Function) -> Function:
    """Decorator of a function that does not depend on the motions of its arguments; results for rigs are kept.

    Its arguments are positional and hashable, and its results are not written to.
    """
    kept = lru_cache(maxsize=KEPT)(function)

    @wraps(function)
    def find(*arguments: Any) -> Any:
        rigs = [getattr(each, "rig", each) for each in arguments]
        moves = any(rig is None and each is not None for rig, each in zip(rigs, arguments, strict=True))
        return function(*arguments) if moves else kept(*rigs)

    return cast(Function, find)
