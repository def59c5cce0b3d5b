"""Caches of results that depend on the rig alone, a body or a pair of bodies without motions, for all clips of it.

`Body.rig` and `Matching.rig` are one object for all clips with equal skeletons. They are None if the rest poses do not
show how the bodies stand: then each clip has its own results.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache, wraps
from typing import Any, TypeVar, cast

CACHED_RIGS = 8  # rigs, and results of each function of rigs, that are cached: the most recently used

Value = TypeVar("Value")
Function = TypeVar("Function", bound=Callable[..., Any])


class rig_property(cached_property[Value]):  # noqa: N801 - a decorator
    """A cached property that does not depend on the motion; all owners with the same `rig` share its value."""

    def __get__(self, owner: Any, kind: type | None = None) -> Value:  # type: ignore[override]
        """Return the value of the owner's rig."""
        rig = owner if owner is None or owner.rig is None else owner.rig
        value = cast(Value, super().__get__(rig, kind))
        if owner is not rig:
            vars(owner)[self.attrname or ""] = value
        return value


def rig_cached(function: Function) -> Function:
    """Decorate a function that does not depend on the motions of its arguments: cache its results for rigs.

    Its arguments are positional and hashable, and its results are not written to.
    """
    cached = lru_cache(maxsize=CACHED_RIGS)(function)

    @wraps(function)
    def find(*arguments: Any) -> Any:
        rigs = [getattr(each, "rig", each) for each in arguments]
        needs_motion = any(rig is None and each is not None for rig, each in zip(rigs, arguments, strict=True))
        return function(*arguments) if needs_motion else cached(*rigs)

    return cast(Function, find)
