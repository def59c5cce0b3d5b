"""Ways in which the joints of two skeletons pair up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from distretarget.body.anatomy import FINGERS, SIDES, Anatomy
from distretarget.body.body import Body
from distretarget.errors import MapError, closest
from distretarget.skeleton import Skeleton

MOST = 3  # fingers that two hands must share, if the target has others

JointPairs = dict[int, tuple[int, str]]
"""Per target joint the source joint that drives it, and how that was found."""

JointMap = Mapping[str, str | None]
"""Per target joint's key the source joint's key; None where nothing drives it."""


def find_pairs(source: Body, target: Body, crossed: bool) -> JointPairs:
    """The pairs that names and the parts of the bodies tell.

    Equal names, if no body is recognised, or every joint of the target has one and no other convention. Else parts, and
    equal names for what is left; where both follow one convention, equal names come first, but for spine and neck,
    whose joints count from below or from above. `crossed` says that the names of one body, and not of the other, say
    left for right.
    """
    names = same_names(source.skeleton, target.skeleton)
    s, t = source.anatomy, target.anatomy
    if s is None or t is None:
        return names
    alike = s.convention == t.convention and not crossed
    if alike and len(names) == len(target.skeleton.joints):
        return names
    firm = alike and s.convention
    pairs = {joint: pair for joint, pair in names.items() if firm and joint not in (*t.spine, *t.neck)}
    pairs |= unused(same_parts(s, t), pairs)
    return same_others(source.skeleton, target.skeleton, pairs)


def pairs_of_map(source: Skeleton, target: Skeleton, joint_map: JointMap) -> JointPairs:
    """The pairs of a map; -1 where nothing shall drive the joint.

    Raises:
        MapError: a joint is not there.
    """
    pairs: JointPairs = {}
    for key, driver in joint_map.items():
        if key not in target.keys:
            raise MapError(key, f"the target has no such joint; {closest(key, target.keys)}")
        if driver is not None and driver not in source.keys:
            raise MapError(key, f"the source has no joint {driver!r}; {closest(driver, source.keys)}")
        pairs[target.index(key)] = (-1 if driver is None else source.index(driver), "map")
    return pairs


def same_names(source: Skeleton, target: Skeleton) -> JointPairs:
    """The joints with equal keys, as they are or else but for namespaces and case; End Sites apart."""
    exact = {source.keys[joint]: joint for joint in source.joints}
    pairs: JointPairs = {}
    for joint in target.joints:
        if target.keys[joint] in exact:
            pairs[joint] = (exact[target.keys[joint]], "name")
    plain = _plain(source)
    taken = {driver for driver, _ in pairs.values()}
    for name, joint in _plain(target).items():
        if joint not in pairs and name in plain and plain[name] not in taken:
            pairs[joint] = (plain[name], "name")
    return pairs


def _plain(skeleton: Skeleton) -> dict[str, int]:
    """The joint of each name without namespace and case, where that is still unique."""
    names = {joint: skeleton.names[joint].rpartition(":")[2].lower() for joint in skeleton.joints}
    times = Counter(names.values())
    return {name: joint for joint, name in names.items() if times[name] == 1}


def same_parts(s: Anatomy, t: Anatomy) -> JointPairs:
    """The joints that play the same part; a spine or neck of as many joints pairs up joint by joint.

    A hand's fingers pair up if the source has all that the target has, or most: one that stands for all (CMU) would
    move alone on a hand of five.
    """
    method = "names" if s.method == t.method == "names" else "shape"
    shared = [role for role in t.roles if role in s.roles]
    for side in SIDES:
        fingers = [{finger for finger in FINGERS if f"{side}{finger}1" in body.roles} for body in (s, t)]
        if not fingers[1] <= fingers[0] and len(fingers[0] & fingers[1]) < MOST:
            shared = [role for role in shared if not role.startswith(tuple(side + finger for finger in FINGERS))]
    pairs = {joint: (s.roles[role], method) for role, joint in t.roles.items() if role in shared}
    for drivers, joints in ((s.spine, t.spine), (s.neck, t.neck)):
        if len(drivers) == len(joints):
            pairs |= {joint: (driver, method) for driver, joint in zip(drivers, joints, strict=True)}
    return pairs


def unused(pairs: JointPairs, known: JointPairs) -> JointPairs:
    """The pairs of joints of which neither is in a pair that is known."""
    drivers = {driver for driver, _ in known.values()}
    return {joint: pair for joint, pair in pairs.items() if joint not in known and pair[0] not in drivers}


def same_others(source: Skeleton, target: Skeleton, pairs: JointPairs) -> JointPairs:
    """The pairs, and with them joints with equal names in no pair yet that hang from joints that pair up."""
    known = dict(pairs)
    for joint, (driver, method) in unused(same_names(source, target), pairs).items():
        above = _nearest(target, joint, set(known))
        drivers = {source_joint for source_joint, _ in known.values()}
        if (known[above][0] if above >= 0 else -1) == _nearest(source, driver, drivers):
            known[joint] = (driver, method)
    return known


def _nearest(skeleton: Skeleton, joint: int, known: set[int]) -> int:
    """The nearest ancestor among the known joints; -1 without."""
    return next((above for above in skeleton.line(joint)[1:] if above in known), -1)


def tips(source: Skeleton, target: Skeleton, pairs: JointPairs) -> JointPairs:
    """What ends matched joints: an only child where nothing below is matched, else End Sites in order."""
    found: JointPairs = {}
    above = _above(source, {driver for driver, _ in pairs.values()}), _above(target, set(pairs))
    for joint in range(len(target)):
        driver = (pairs | found).get(joint, (-1, ""))[0]
        if driver < 0:
            continue
        ends, children = _free(source, driver, above[0]), _free(target, joint, above[1])
        if not len(source.children[driver]) == len(target.children[joint]) == 1:
            ends, children = [j for j in ends if source.end_sites[j]], [j for j in children if target.end_sites[j]]
        found |= {child: (end, "tip") for end, child in zip(ends, children, strict=False)}
    return found


def _free(skeleton: Skeleton, joint: int, above: set[int]) -> list[int]:
    return [child for child in skeleton.children[joint] if child not in above]


def _above(skeleton: Skeleton, joints: set[int]) -> set[int]:
    """The joints and all their ancestors."""
    return {above for joint in joints if joint >= 0 for above in skeleton.line(joint)}
