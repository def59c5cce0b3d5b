"""Remarks on parts of the target's body that no joint of the source drives."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, side_and_part
from distretarget.body.single_bones import single_bones
from distretarget.errors import counted, quoted
from distretarget.matching.matching import Matching

# The singular and the plural of each part of the body, without its side.
PARTS = {part: f"{part}s" for part in ("arm", "hand", "leg", "shoulder", "finger", "toe")} | {"foot": "feet"}
ALL_OF_A_SIDE = {"finger": "fingers", "toe": "toes"}
PART_OF_ROLE = {
    **dict(zip(ARM, ("shoulder", "arm", "arm", "hand"), strict=True)),
    **dict(zip(LEG, ("leg", "leg", "foot", "toe"), strict=True)),
    **{f"{finger}{number}": "finger" for finger in FINGERS for number in (1, 2, 3)},
}
LIMB_BONES = {"arm": ARM[1:3], "leg": LEG[:2]}  # the long bones of each limb
NAMED = 3  # at most so many other joints are named


def parts_without_source(matching: Matching) -> Iterator[str]:
    """Yield lines on limbs of one bone, on limbs that are not recognised, and on parts that nothing drives."""
    single = [middle for _, middle, _ in single_bones(matching.target.anatomy) if middle in matching.source.roles]
    if single := [name for name in ("arms", "legs") if any(name[:3].title() in middle for middle in single)]:
        yield f"{_listed(single)} of the target are one bone each, so those of the source are straightened"
    still = _still(matching)
    anatomy = matching.target.anatomy
    lost = _unrecognised(matching)
    if anatomy and lost and len(set(still) - _of_body(anatomy)) >= 2 * len(lost):
        yield f"{_listed(lost)} of the target not recognised, so they do not move: name their joints in a map"
    if anatomy and (parts := [*_parts(anatomy, still)]):
        yield f"no source joint drives {_listed(parts)} of the target"


def others_without_source(matching: Matching) -> Iterator[str]:
    """Yield a line on other joints that only follow their parents, such as those of hair, if there are any."""
    anatomy, keys = matching.target.anatomy, matching.target.skeleton.keys
    of_body = _of_body(anatomy) if anatomy else ()
    if others := [keys[joint] for joint in _still(matching) if joint not in of_body]:
        what = f"{'other ' if of_body else ''}joint"
        follow = "follows its parent" if len(others) == 1 else "follow their parents"
        yield f"{counted(len(others), what)} of the target {follow}: {quoted(others, NAMED)}"


def _unrecognised(matching: Matching) -> list[str]:
    """The arms and legs that the source has and the target lacks, such as "left arm"."""
    source, target = matching.source.roles, matching.target.roles
    limbs = {f"{side} {name}": {side + bone for bone in bones} for name, bones in LIMB_BONES.items() for side in SIDES}
    return [name for name, bones in limbs.items() if bones & source.keys() and not bones & target.keys()]


def _still(matching: Matching) -> list[int]:
    """The joints of the target that only follow their parents."""
    followers = set(matching.followers)
    return [joint for joint in matching.target.skeleton.joints if matching.target.skeleton.keys[joint] in followers]


def _of_body(anatomy: Anatomy) -> set[int]:
    """The joints of the body that should have a driver: those with roles, except bones in the palm."""
    roles = anatomy.roles.items()
    return {*anatomy.spine, *anatomy.neck, *(joint for role, joint in roles if not role.endswith("0"))}


def _parts(anatomy: Anatomy, still: Collection[int]) -> Iterator[str]:
    """The names of parts of a body whose joints are all `still`, and the number of still joints of other parts."""
    joints: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(list))
    for role, joint in anatomy.roles.items():
        side, name = side_and_part(role)
        if name in PART_OF_ROLE:
            joints[PART_OF_ROLE[name]][side].append(joint)
    for part, all_of in PARTS.items():
        whole = [side for side, own in joints[part].items() if set(own) <= set(still)]
        some = sum(joint in still for side, own in joints[part].items() if side not in whole for joint in own)
        if len(whole) > 1:
            yield all_of
        elif whole:
            yield f"{whole[0]} {ALL_OF_A_SIDE.get(part, part)}"
        if some:
            yield counted(some, f"{part} joint")
    for part, own in (("spine", anatomy.spine), ("neck", anatomy.neck)):
        if some := sum(joint in still for joint in own):
            yield counted(some, f"{part} joint")
    yield from (part for part in ("hips", "head") if anatomy.roles.get(part) in still)


def _listed(names: Sequence[str]) -> str:
    """Names as in "fingers, shoulders and toes"."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
