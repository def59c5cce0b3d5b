"""What is found of rigs once, and not once for each clip of them.

A rig is a body, or a pair of bodies, without its motions. Bodies and matchings name theirs as `rig`: one object for all
clips of equal skeletons, or None where rest poses do not show how the bodies stand, so that each clip has to show it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache, wraps
from typing import Any, TypeVar, cast

KEPT = 8  # so many rigs, and results of each function of rigs, are kept: those used last

Value = TypeVar("Value")
Function = TypeVar("Function", bound=Callable[..., Any])


class of_rig(cached_property[Value]):  # noqa: N801 - a decorator
    """A cached property that takes nothing of a motion where its owner has a `rig`: it is found once for that."""

    def __get__(self, owner: Any, kind: type | None = None) -> Value:  # type: ignore[override]
        """Return the value of the owner's rig."""
        rig = owner if owner is None or owner.rig is None else owner.rig
        value = cast(Value, super().__get__(rig, kind))
        if owner is not rig:
            vars(owner)[self.attrname or ""] = value
        return value


def found_once(function: Function) -> Function:
    """Decorate a function that takes nothing of the motions of its arguments where these have rigs.

    Its last results for rigs are kept. It has positional, hashable arguments, and its results are not written to.
    """
    kept = lru_cache(maxsize=KEPT)(function)

    @wraps(function)
    def find(*arguments: Any) -> Any:
        rigs = [getattr(each, "rig", each) for each in arguments]
        moves = any(rig is None and each is not None for rig, each in zip(rigs, arguments, strict=True))
        return function(*arguments) if moves else kept(*rigs)

    return cast(Function, find)
