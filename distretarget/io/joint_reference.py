"""How one joint of a skeleton file names another: by its name, or with as many of its parents as tell it apart."""

from __future__ import annotations

from collections.abc import Sequence


def joints_meant(reference: str, names: Sequence[str], parents: Sequence[int]) -> list[int]:
    """The joints among the first `len(parents)` that a reference `name`, `parent/name` and so on may mean.

    If it names the whole path from the root to a joint, it means that joint. So each of `Skeleton.keys` means its own
    joint, as long as no name contains "/".
    """
    tops = {joint: _top(reference, joint, names, parents) for joint in range(len(parents))}
    whole = [joint for joint, top in tops.items() if top == 0]
    return whole if len(whole) == 1 else [joint for joint, top in tops.items() if top >= 0]


def _top(reference: str, joint: int, names: Sequence[str], parents: Sequence[int]) -> int:
    """The joint or ancestor at which a reference begins that ends at the joint; -1 if the reference does not fit."""
    end = len(reference)
    while joint >= 0 and reference.endswith(names[joint], 0, end):
        end -= len(names[joint]) + 1
        if end < 0:
            return joint
        joint = parents[joint] if reference[end] == "/" else -1
    return -1
