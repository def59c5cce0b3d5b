"""Ways in which the joints of two skeletons pair up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from distretarget.body.anatomy import FINGERS, SIDES, Anatomy
from distretarget.errors import MapError, closest
from distretarget.skeleton import Skeleton

MOST = 3  # fingers that two hands must share, if the target has others

Pairs = dict[int, tuple[int, str]]
"""Per target joint the source joint that drives it, and how that was found."""

JointMap = Mapping[str, str | None]
"""Per target joint's key the source joint's key; None where nothing drives it."""


def joints_of(skeleton: Skeleton) -> list[int]:
    """The joints that are no End Sites."""
    return [joint for joint in range(len(skeleton)) if not skeleton.end_sites[joint]]


def find_pairs(
    source: Skeleton, target: Skeleton, anatomies: tuple[Anatomy | None, Anatomy | None], crossed: bool
) -> Pairs:
    """The pairs that names and the parts of the bodies tell.

    Equal names, if no body is recognised, or every joint of the target has one and no other convention. Else parts, and
    equal names for what is left; where both follow one convention, equal names come first, but for spine and neck,
    whose joints count from below or from above. `crossed` says that the names of one body, and not of the other, say
    left for right.
    """
    names = same_names(source, target)
    s, t = anatomies
    if s is None or t is None:
        return names
    alike = s.convention == t.convention and not crossed
    if alike and len(names) == len(joints_of(target)):
        return names
    firm = alike and s.convention
    pairs = {joint: pair for joint, pair in names.items() if firm and joint not in (*t.spine, *t.neck)}
    pairs |= unused(same_parts(s, t), pairs)
    return same_others(source, target, pairs)


def given(source: Skeleton, target: Skeleton, explicit: JointMap) -> Pairs:
    """The pairs of a map; -1 where nothing shall drive the joint.

    Raises:
        MapError: a joint is not there.
    """
    pairs: Pairs = {}
    for key, driver in explicit.items():
        if key not in target.keys:
            raise MapError(key, f"the target has no such joint; {closest(key, target.keys)}")
        if driver is not None and driver not in source.keys:
            raise MapError(key, f"the source has no joint {driver!r}; {closest(driver, source.keys)}")
        pairs[target.index(key)] = (-1 if driver is None else source.index(driver), "map")
    return pairs


def same_names(source: Skeleton, target: Skeleton) -> Pairs:
    """The joints with equal keys, as they are or else but for namespaces and case; End Sites apart."""
    exact = {source.keys[joint]: joint for joint in joints_of(source)}
    pairs: Pairs = {}
    for joint in joints_of(target):
        if target.keys[joint] in exact:
            pairs[joint] = (exact[target.keys[joint]], "name")
    theirs, ours = _plain(source), _plain(target)
    taken = {driver for driver, _ in pairs.values()}
    for name, joint in ours.items():
        if joint not in pairs and name in theirs and theirs[name] not in taken:
            pairs[joint] = (theirs[name], "name")
    return pairs


def _plain(skeleton: Skeleton) -> dict[str, int]:
    """The joint of each name without namespace and case, where that is still unique."""
    names = {joint: skeleton.names[joint].rpartition(":")[2].lower() for joint in joints_of(skeleton)}
    times = Counter(names.values())
    return {name: joint for joint, name in names.items() if times[name] == 1}


def same_parts(s: Anatomy, t: Anatomy) -> Pairs:
    """The joints that play the same part; a spine or neck of as many joints pairs up joint by joint.

    A hand's fingers pair up if the source has all that the target has, or most: one that stands for all (CMU) would
    move alone on a hand of five.
    """
    how = "names" if s.found == t.found == "names" else "shape"
    shared = [role for role in t.roles if role in s.roles]
    for side in SIDES:
        fingers = [{finger for finger in FINGERS if f"{side}{finger}1" in body.roles} for body in (s, t)]
        if not fingers[1] <= fingers[0] and len(fingers[0] & fingers[1]) < MOST:
            shared = [role for role in shared if not role.startswith(tuple(side + finger for finger in FINGERS))]
    pairs = {joint: (s.roles[role], how) for role, joint in t.roles.items() if role in shared}
    for theirs, ours in ((s.spine, t.spine), (s.neck, t.neck)):
        if len(theirs) == len(ours):
            pairs |= {joint: (driver, how) for joint, driver in zip(ours, theirs, strict=True)}
    return pairs


def unused(pairs: Pairs, known: Pairs) -> Pairs:
    """The pairs of joints of which neither is in a pair that is known."""
    drivers = {driver for driver, _ in known.values()}
    return {joint: pair for joint, pair in pairs.items() if joint not in known and pair[0] not in drivers}


def same_others(source: Skeleton, target: Skeleton, pairs: Pairs) -> Pairs:
    """The pairs, and with them joints with equal names in no pair yet that hang from joints that pair up."""
    known = dict(pairs)
    for joint, (driver, how) in unused(same_names(source, target), pairs).items():
        above = _nearest(target, joint, set(known))
        drivers = {source_joint for source_joint, _ in known.values()}
        if (known[above][0] if above >= 0 else -1) == _nearest(source, driver, drivers):
            known[joint] = (driver, how)
    return known


def _nearest(skeleton: Skeleton, joint: int, known: set[int]) -> int:
    """The nearest ancestor among the known joints; -1 without."""
    return next((above for above in skeleton.line(joint)[1:] if above in known), -1)


def tips(source: Skeleton, target: Skeleton, pairs: Pairs) -> Pairs:
    """What ends matched joints: an only child where nothing below is matched, else End Sites in order."""
    found: Pairs = {}
    above = _above(target, set(pairs)), _above(source, {driver for driver, _ in pairs.values()})
    for joint in range(len(target)):
        driver = (pairs | found).get(joint, (-1, ""))[0]
        if driver < 0:
            continue
        ours, theirs = _free(target, joint, above[0]), _free(source, driver, above[1])
        if not len(target.children[joint]) == len(source.children[driver]) == 1:
            ours, theirs = ([j for j in free if body.end_sites[j]] for body, free in ((target, ours), (source, theirs)))
        found |= {child: (end, "tip") for child, end in zip(ours, theirs, strict=False)}
    return found


def _free(skeleton: Skeleton, joint: int, above: set[int]) -> list[int]:
    return [child for child in skeleton.children[joint] if child not in above]


def _above(skeleton: Skeleton, joints: set[int]) -> set[int]:
    """The joints and all their ancestors."""
    return {above for joint in joints if joint >= 0 for above in skeleton.line(joint)}
