"""Which other programs cannot read a BVH file, because of what the skeleton in it has; docs/interop.md tests them."""

from __future__ import annotations

from collections.abc import Iterator

from distretarget.errors import counted
from distretarget.skeleton import POSITION_CHANNELS, Skeleton


def refusals(skeleton: Skeleton) -> Iterator[str]:
    """Yield a line for each thing in a skeleton that some reader of BVH files refuses, with what helps."""
    joints = [joint for joint in skeleton.joints if not skeleton.end_sites[joint]]
    names = [skeleton.names[joint] for joint in joints]
    if spaced := [name for name in names if ":" in name]:
        plain = spaced[0].rpartition(":")[2]
        yield f"three.js cannot play joints with names like {spaced[0]!r}; --strip-namespace writes {plain!r}"
    if unknown := [name for name in names if not name.isascii() and not _is_utf8(name)]:
        yield f"bvhio and pybvh cannot read names that are not UTF-8, as {unknown[0]!r}; rename the target's joints"
    if odd := [joint for joint in joints if not _is_usual(skeleton, joint)]:
        found = counted(len(skeleton.channels[odd[0]]), "channel")
        yield (
            "pybvh reads three rotations of each joint, and three positions of the root; "
            f"{skeleton.names[odd[0]]!r} of the target has {found}"
        )


def _is_utf8(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_usual(skeleton: Skeleton, joint: int) -> bool:
    """Whether a joint has three rotation channels, and position channels only as the root, which has all three."""
    positions = [channel for channel in skeleton.channels[joint] if channel in POSITION_CHANNELS]
    return len(skeleton.rotation_axes(joint)) == 3 and len(positions) == (0 if joint else 3)
