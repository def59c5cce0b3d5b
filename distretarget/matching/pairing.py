"""Pair the joints of two skeletons: by a map, by names, by body parts, or by their place in the tree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from distretarget.body.anatomy import FINGERS, SIDES, Anatomy
from distretarget.body.body import Body
from distretarget.errors import MapError, closest
from distretarget.numerics.vectors import Array
from distretarget.skeleton import JointMap, Skeleton

SHARED_FINGERS = 3  # fingers that two hands must share if the source lacks one of the target's

JointPairs = dict[int, tuple[int, str]]
"""Target joint to the source joint that drives it and the method by which they were matched."""


def find_pairs(source: Body, target: Body, crossed: bool) -> JointPairs:
    """Pair joints by equal names and body parts; `crossed` says that names of one body swap sides. Only equal names
    count if a body is not recognised, or all have them in one convention. Else body parts come first; with one known
    convention equal names do, except in spine and neck, which may be numbered upwards or downwards.
    """
    names = _same_names(source.skeleton, target.skeleton)
    s, t = source.anatomy, target.anatomy
    if s is None or t is None:
        return names
    alike = s.convention == t.convention and not crossed
    if alike and len(names) == len(target.skeleton.joints):
        return names
    shared = _shared_roles(s, t)
    unshared = [t.roles[role] for role in s.roles.keys() & t.roles.keys() - {*shared}]
    names = {joint: pair for joint, pair in names.items() if not {*target.skeleton.to_root(joint)} & {*unshared}}
    names_first = alike and s.convention
    pairs = {joint: pair for joint, pair in names.items() if names_first and joint not in (*t.spine, *t.neck)}
    pairs |= _unused(_same_parts(s, t, shared), pairs)
    for joint, (driver, method) in _unused(names, pairs).items():
        above = _nearest(target.skeleton, joint, pairs.keys())
        if pairs.get(above, (-1, ""))[0] == _nearest(source.skeleton, driver, {known for known, _ in pairs.values()}):
            pairs[joint] = driver, method
    return pairs


def pairs_of_map(source: Skeleton, target: Skeleton, joint_map: JointMap) -> JointPairs:
    """Pair joints by a map, with -1 for no driver. A MapError if it names a joint that does not exist."""
    pairs: JointPairs = {}
    for key, driver in joint_map.items():
        if key not in target.keys:
            raise MapError(key, f"the target has no such joint; {closest(str(key), target.keys)}")
        if driver is not None and driver not in source.keys:
            raise MapError(key, f"the source has no joint {driver!r}; {closest(str(driver), source.keys)}")
        pairs[target.index(key)] = (-1 if driver is None else source.index(driver), "map")
    return pairs


def _same_names(source: Skeleton, target: Skeleton) -> JointPairs:
    """Pairs of joints with equal keys, then with equal names without namespace and case; no End Sites."""
    pairs: JointPairs = {}
    exact = [{skeleton.keys[joint]: joint for joint in skeleton.joints} for skeleton in (source, target)]
    for drivers, joints in (exact, [_plain_names(source), _plain_names(target)]):
        pairs |= _unused({joints[name]: (drivers[name], "name") for name in joints if name in drivers}, pairs)
    return pairs


def _plain_names(skeleton: Skeleton) -> dict[str, int]:
    """Names in lower case without namespace, where unique, to their joints."""
    names = {joint: skeleton.names[joint].rpartition(":")[2].lower() for joint in skeleton.joints}
    times = Counter(names.values())
    return {name: joint for joint, name in names.items() if times[name] == 1}


def _shared_roles(s: Anatomy, t: Anatomy) -> list[str]:
    """The roles by which joints pair; fingers only if the source has all of the target's, or `SHARED_FINGERS`."""
    shared = [role for role in t.roles if role in s.roles]
    for side in SIDES:
        fingers = [{finger for finger in FINGERS if f"{side}{finger}1" in body.roles} for body in (s, t)]
        if not fingers[1] <= fingers[0] and len(fingers[0] & fingers[1]) < SHARED_FINGERS:
            shared = [role for role in shared if not role.startswith(tuple(side + finger for finger in FINGERS))]
    return shared


def _same_parts(s: Anatomy, t: Anatomy, shared: Sequence[str]) -> JointPairs:
    """Pairs of joints with the shared roles; spines and necks with equal numbers of joints pair joint by joint."""
    method = "shape" if "shape" in (s.method, t.method) else "names"
    pairs = {t.roles[role]: (s.roles[role], method) for role in shared}
    for drivers, joints in ((s.spine, t.spine), (s.neck, t.neck)):
        if len(drivers) == len(joints):
            pairs |= {joint: (driver, method) for driver, joint in zip(drivers, joints, strict=True)}
    return pairs


def _unused(pairs: JointPairs, known: JointPairs) -> JointPairs:
    """The pairs without joints of known pairs."""
    drivers = {driver for driver, _ in known.values()}
    return {joint: pair for joint, pair in pairs.items() if joint not in known and pair[0] not in drivers}


def _nearest(skeleton: Skeleton, joint: int, known: Collection[int]) -> int:
    """The nearest ancestor among the known joints; -1 without one."""
    return next((above for above in skeleton.to_root(joint)[1:] if above in known), -1)


def with_tips(source: Body, target: Body, pairs: JointPairs) -> JointPairs:
    """Add pairs of unmatched ends of matched joints: their only children, or else their End Sites in order. What hands
    and feet hold is left out, and so are End Sites without length.
    """
    known = dict(pairs)
    source_lines = source.skeleton.with_ancestors(driver for driver, _ in pairs.values() if driver >= 0)
    lines, is_end, is_own_end = (
        target.skeleton.with_ancestors(pairs),
        source.skeleton.end_sites,
        target.skeleton.end_sites,
    )
    for joint in range(len(target.skeleton)):
        driver = known.get(joint, (-1, ""))[0]
        if driver >= 0:
            ends, children = _ends(source, driver), _ends(target, joint)
            chain = len(ends) == len(children) == 1
            free_ends = [end for end in ends if end not in source_lines and (chain or is_end[end])]
            free = [child for child in children if child not in lines and (chain or is_own_end[child])]
            known |= {child: (end, "tip") for end, child in zip(free_ends, free, strict=False)}
    return known


def _ends(body: Body, joint: int) -> list[int]:
    """The children of a joint that can be its tips."""
    skeleton, below = body.skeleton, body.skeleton.children[joint]
    if body.regions.inside("hand", "foot")[joint]:
        below = tuple(child for child in below if body.regions.of_joint[child] >= 0)
    return [child for child in below if skeleton.lengths[child] > 0.0 or not skeleton.end_sites[child]]


def spine_blend(source: Body, target: Body) -> Iterator[tuple[int, tuple[int, int], float]]:
    """Yield target joint, two source joints, and the weight of the second, for spines and necks of other lengths:
    rotations are interpolated between the midpoints of bones.
    """
    if source.anatomy is None or target.anatomy is None:
        return
    chains = zip(_chains(source.anatomy), _chains(target.anatomy), strict=True)
    for (source_chain, source_top), (target_chain, target_top) in chains:
        if not source_chain or not target_chain or len(source_chain) == len(target_chain):
            continue
        middles = _middles(source.skeleton, source_chain, source_top)
        places = np.interp(_middles(target.skeleton, target_chain, target_top), middles, np.arange(len(middles)))
        for joint, place in zip(target_chain, places, strict=True):
            first, second = int(place), min(int(place) + 1, len(source_chain) - 1)
            yield joint, (source_chain[first], source_chain[second]), place - first


def _chains(anatomy: Anatomy) -> tuple[tuple[tuple[int, ...], int], tuple[tuple[int, ...], int]]:
    """Spine and neck, each with the joint that follows it, or -1."""
    head = anatomy.roles.get("head", -1)
    return (anatomy.spine, next(iter(anatomy.neck), head)), (anatomy.neck, head)


def _middles(skeleton: Skeleton, chain: tuple[int, ...], top: int) -> Array:
    """(joints,), the middles of a chain's bones, from 0 at its lowest joint to 1 at `top`, the joint beyond it."""
    ends = [*chain, top if top >= 0 else chain[-1]]
    along = skeleton.paths_from(chain[0])[ends]
    if not along[-1] > 0:
        along = np.arange(len(ends), dtype=np.float64)
    return np.asarray((along[1:] + along[:-1]) / (2.0 * along[-1]))
