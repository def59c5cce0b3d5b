"""A matching in words: what was recognised, which joint drives which, and which joints are not used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from distretarget.body.body import Body
from distretarget.body.conventions import convention_of
from distretarget.cli.outputs import aligned
from distretarget.errors import cut
from distretarget.matching.matching import Matching

METHODS = {"map": "map", "name": "equal name", "names": "names", "shape": "shape", "tip": "tip"}
COLUMNS = ("target joint", "source joint", "confidence", "method")


def recognised(body: Body) -> str:
    """Return how the parts of a body were recognised, in words."""
    if body.anatomy and body.anatomy.method == "humanoid":
        return "joints as the humanoid in the file says"
    if title := convention_of(body.skeleton):
        return f"joints named as in {title}"
    return f"joints recognised by {body.anatomy.method}" if body.anatomy else "no human body recognised"


def headline(matching: Matching) -> Iterator[str]:
    """Yield how source and target were recognised, and how many joints each method matched."""
    for name, body in (("source", matching.source), ("target", matching.target)):
        yield f"{name}: {recognised(body)}"
    joints = matching.target.skeleton.joints
    times = Counter(matching.method[joint] for joint in joints if matching.method[joint])
    counts = ", ".join(f"{times[method]} by {words}" for method, words in METHODS.items() if times[method])
    yield f"matched: {times.total()} of the target's {len(joints)} joints{f' ({counts})' if counts else ''}"


def rows(matching: Matching) -> Iterator[str]:
    """Yield a table of the target's joints, depth first without End Sites."""
    target, joints = matching.target.skeleton, set(matching.target.skeleton.joints)
    return aligned([COLUMNS, *(_row(matching, joint) for joint in target.depth_first if joint in joints)], "<<<<")


def _row(matching: Matching, joint: int) -> tuple[str, str, str, str]:
    key, driver = matching.target.skeleton.keys[joint], matching.drivers[joint]
    if driver < 0:
        return cut(key), "-", "", _rotation(matching, joint)
    method = ", ".join(filter(None, (METHODS[matching.method[joint]], _rotation(matching, joint))))
    return cut(key), cut(matching.source.skeleton.keys[driver]), f"{100 * matching.confidence[joint]:.0f} %", method


def _rotation(matching: Matching, joint: int) -> str:
    """The source joints that a joint's rotation follows, if not its driver alone."""
    keys, weight = matching.source.skeleton.keys, matching.blend[joint]
    (a, b), driver = matching.rotation_sources[joint], matching.drivers[joint]
    if a == b or weight in (0, 1):
        only = b if weight == 1 else a
        return "" if only == driver else f"rotation of {keys[only]}"
    return f"rotation between {keys[a]} and {keys[b]}"


def unused(matching: Matching) -> list[str]:
    """Return the source's joints that no target joint follows, without End Sites."""
    used = {*matching.drivers.tolist(), *matching.rotation_sources.ravel().tolist()}
    source = matching.source.skeleton
    return [source.keys[joint] for joint in source.joints if joint not in used]
