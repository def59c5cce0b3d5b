"""The segments of a body, whose surfaces can touch: the joints of each, and those that carry its capsules."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np

from distretarget.body.anatomy import SIDES, Anatomy, side_and_part
from distretarget.body.body import Body
from distretarget.numerics.vectors import Numbers
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS

SEGMENT_OF_PART = {"hips": "pelvis", "neck": "neck", "head": "head"}
SEGMENT_OF_PART |= {"UpperArm": "upper arm", "LowerArm": "forearm", "Hand": "hand"}
SEGMENT_OF_PART |= {"UpperLeg": "thigh", "LowerLeg": "shin", "Foot": "foot", "Toes": "foot"}
# Fingers move together: those of each group hang on the first of its knuckles that the hand has.
FINGER_GROUPS = (("Index", "Middle"), ("Ring", "Little"), ("Thumb",))
HELPER = 0.1  # joints that reach no farther from where they branch off are muscles or twists, no hair [body units]
FACE = 0.14  # jaw, eyes and other joints of the face are nearer to the head's joint than this [body units] ...
BELOW_HEAD = 0.03  # ... and not so far below it [body units]


@dataclass(frozen=True, eq=False)
class Segments:
    """The segments of a body.

    Attributes:
        of_joint: (joints,), the number in `SEGMENTS` that each joint belongs to; -1 for what is not part of the body:
            joints above the hips, handles, props, hair and cloth.
        carriers: (joints,), the joint that carries the capsules of what each joint moves; -1 as there.
    """

    of_joint: Numbers
    carriers: Numbers

    def joints(self, carrier: int) -> list[int]:
        """Return the joints whose capsules a joint carries."""
        return np.flatnonzero(self.carriers == carrier).tolist()


def find_segments(body: Body) -> Segments:
    """Return the segments of a body; none of its joints is in one where it has no anatomy."""
    skeleton, anatomy = body.skeleton, body.anatomy
    labels: dict[int, tuple[str, int]] = {} if anatomy is None else _main(skeleton, anatomy)
    leads = skeleton.lines(labels)  # to a part with a role
    outside = {*body.above_hips, *(below for handle in body.handles for below in skeleton.subtree(handle))}
    for joint, parent in enumerate(skeleton.parents.tolist()):
        open_ = parent in labels and joint not in labels and joint not in outside
        if open_ and (joint in leads or _belongs(body, joint, *labels[parent])):
            labels[joint] = labels[parent]
    of_joint, carriers = np.full(len(skeleton), -1), np.full(len(skeleton), -1)
    for joint, (segment, carrier) in labels.items():
        of_joint[joint], carriers[joint] = SEGMENTS.index(segment), carrier
    return Segments(of_joint, carriers)


def _main(skeleton: Skeleton, anatomy: Anatomy) -> dict[int, tuple[str, int]]:
    """Segment and carrying joint of the joints with roles."""
    labels: dict[int, tuple[str, int]] = {}
    for role, joint in anatomy.roles.items():
        side, part = side_and_part(role)
        if part == "Shoulder":
            labels[joint] = "chest", anatomy.spine[-1] if anatomy.spine else joint
        elif part in SEGMENT_OF_PART:
            labels[joint] = f"{side} {SEGMENT_OF_PART[part]}".strip(), joint
    labels |= dict.fromkeys(anatomy.neck, ("neck", next(iter(anatomy.neck), -1)))
    labels |= _spine(skeleton, anatomy)
    for side, group in product(SIDES, FINGER_GROUPS):
        labels |= _fingers(anatomy, side, group)
    return labels


def _spine(skeleton: Skeleton, anatomy: Anatomy) -> dict[int, tuple[str, int]]:
    """The joints of the spine: those whose bones are in its lower half are the belly, the highest is the chest."""
    if not anatomy.spine:
        return {}
    top = anatomy.neck[0] if anatomy.neck else anatomy.roles.get("head", anatomy.spine[-1])
    along = skeleton.paths_from(anatomy.roles["hips"])[[*anatomy.spine, top]]
    middles = 0.5 * (along[:-1] + along[1:])
    is_belly = middles < 0.5 * along[-1]
    is_belly[-1] = False
    return {joint: ("belly" if low else "chest", joint) for joint, low in zip(anatomy.spine, is_belly, strict=True)}


def _fingers(anatomy: Anatomy, side: str, group: Iterable[str]) -> dict[int, tuple[str, int]]:
    """The fingers of a group; bones in the palm move with the wrist."""
    numbers = {f"{side}{finger}{number}": number for finger in group for number in range(4)}
    joints = {anatomy.roles[role]: number for role, number in numbers.items() if role in anatomy.roles}
    carrier = next((joint for joint, number in joints.items() if number > 0), -1)
    hand = anatomy.roles.get(f"{side}Hand", -1)
    return {joint: (f"{side} hand", carrier if number else hand) for joint, number in joints.items()}


def _belongs(body: Body, joint: int, segment: str, carrier: int) -> bool:
    """Whether a joint that leads to no part with a role, below one with this segment and carrier, is part of the body:
    an End Site, or in a hand, a foot or the face, or carrying nothing that reaches far, as hair, cloth and tails do.
    """
    skeleton = body.skeleton
    if skeleton.end_sites[joint]:
        return True
    if segment == "head":
        away = skeleton.rest_positions[joint] - skeleton.rest_positions[carrier]
        up = body.rest.axes[:, 1]
        return bool(np.linalg.norm(away) < FACE * body.unit and away @ up > -BELOW_HEAD * body.unit)
    if segment.endswith(("hand", "foot")):
        return bool(body.regions.of_joint[joint] >= 0)
    return bool(skeleton.reach[joint] < HELPER * body.unit)
