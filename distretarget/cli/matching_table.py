"""What a matching is, in words: what was recognised, which joint drives which, and what is left over."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from distretarget.body.body import Body
from distretarget.body.conventions import convention_of
from distretarget.matching.matching import Matching

WAYS = {"map": "map", "name": "equal name", "names": "names", "shape": "shape", "tip": "tip"}
HEAD = ("target joint", "source joint", "sure", "found by")


def recognised(body: Body) -> str:
    """What told the parts of a body."""
    if title := convention_of(body.skeleton):
        return f"joints named as in {title}"
    return f"joints recognised by {body.anatomy.method}" if body.anatomy else "no human body recognised"


def headline(matching: Matching) -> Iterator[str]:
    """What source and target were recognised by, and how many joints were matched in which way."""
    for name, body in (("source", matching.source), ("target", matching.target)):
        yield f"{name}: {recognised(body)}"
    joints = matching.target.skeleton.joints
    times = Counter(matching.method[joint] for joint in joints if matching.method[joint])
    counts = ", ".join(f"{times[way]} by {words}" for way, words in WAYS.items() if times[way])
    yield f"matched: {times.total()} of the target's {len(joints)} joints{f' ({counts})' if counts else ''}"


def rows(matching: Matching) -> list[str]:
    """A table with a line for each joint of the target, in the order of its tree; End Sites apart."""
    target, joints = matching.target.skeleton, set(matching.target.skeleton.joints)
    table = [HEAD, *(_row(matching, joint) for joint in target.depth_first if joint in joints)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in table]


def _row(matching: Matching, joint: int) -> tuple[str, str, str, str]:
    key, driver = matching.target.skeleton.keys[joint], matching.drivers[joint]
    if driver < 0:
        return key, "-", "", _turning(matching, joint)
    found = ", ".join(filter(None, (WAYS[matching.method[joint]], _turning(matching, joint))))
    return key, matching.source.skeleton.keys[driver], f"{100 * matching.confidence[joint]:.0f} %", found


def _turning(matching: Matching, joint: int) -> str:
    """What the joint's rotation follows, where that is not its driver's alone."""
    keys, share = matching.source.skeleton.keys, matching.blend[joint]
    (a, b), driver = matching.rotation_sources[joint], matching.drivers[joint]
    if a == b or share in (0, 1):
        only = b if share == 1 else a
        return "" if only == driver else f"turns as {keys[only]}"
    return f"turns between {keys[a]} and {keys[b]}"


def unused(matching: Matching) -> list[str]:
    """The source's joints that no joint of the target follows; End Sites apart."""
    used = {*matching.drivers.tolist(), *matching.rotation_sources.ravel().tolist()}
    source = matching.source.skeleton
    return [source.keys[joint] for joint in source.joints if joint not in used]
