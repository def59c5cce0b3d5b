"""How the joints of a rig are turned while its body is neutral, as all frames of a motion show it together.

What a clip shows once (a turned wrist, a head that looks down) is not of the rig. So each joint is taken to be neutral
where rigs are built to be so, and its motion only decides between the ways to build it: the joint is turned as its
parent is, or its axes are at right angles to its parent's. Where neither is near, the median over the frames counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, LEG, SIDES, Anatomy
from distretarget.body.axes import Directions, direction
from distretarget.motion import Motion
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import cross, lengths, normalised

Array = NDArray[np.float64]

MOST_FRAMES = 500  # a motion shows how joints are turned in up to this many frames, evenly spread
ROUNDS = 10  # of the search for a median rotation
ALIKE = np.radians(1.0)  # rotations nearer to the median than this count the same [rad]
STILL = np.radians(0.05)  # a joint that turns by less than this is not animated [rad] ...
ANIMATED = np.radians(5.0)  # ... if elbows or knees turn by more than this [rad]
HELD = ("Hand", "head")  # roles of joints that a clip may hold still in a pose that is not neutral
UNTURNED = np.radians(60.0)  # a joint whose median is within this of no rotation has none while it is neutral [rad]
SQUARE = np.radians(40.0)  # a median within this of right angles is at right angles [rad]
CLEAR_BEND = 0.2  # a limb whose mean bend is larger than this shows its bend axis [sine]
RIGHT_ANGLES = np.asarray(Rotation.create_group("O").as_matrix())  # (24, 3, 3), all turns by right angles


def bones_of(anatomy: Anatomy, side: str, limb: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """The joints at the upper and lower end of each bone of a limb; parts that the body lacks are skipped."""
    return pairwise(anatomy.roles[side + role] for role in limb if side + role in anatomy.roles)


def sampled(motion: Motion) -> Motion:
    """Return the frames in which a motion shows how joints are turned."""
    return motion[:: -(-len(motion) // MOST_FRAMES)]


def places_from(motion: Motion, joint: int, others: Sequence[int]) -> Array:
    """Return the places of other joints in the axes of a joint, (len(others), 3): the means over the frames."""
    away = motion.positions[:, others] - motion.positions[:, joint, None]
    turns = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
    return np.asarray((away @ turns).mean(axis=0))


def against_trunk(anatomy: Anatomy, motion: Motion, joint: int) -> Array:
    """Return how a joint that carries the body is turned while the body stands upright, Y up, and faces Z, (3, 3): the
    turn by right angles that is nearest to its median against the trunk.
    """
    trunk = Directions(anatomy, motion.positions).axes
    turns = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
    return _right_angled(_medians((trunk.swapaxes(-1, -2) @ turns)[:, None])[0][0])


def neutral_turns(anatomy: Anatomy, motion: Motion, *, built: bool) -> Array:
    """Return the rotations of all joints against their parents while they are neutral, (joints, 3, 3).

    A joint that is not animated is neutral as it is, unless it is a hand or of the head, which a clip may hold still. A
    collar bone is neutral as it is on the whole while its arm hangs. Other joints are neutral when they are not turned,
    or at right angles in a rig that is `built` along its bones, if that is near; else as they are on the whole.
    """
    local = Rotation.from_quat(motion.rotations).as_matrix()
    medians, farthest = _medians(local)
    hinges = (side + part for side in SIDES for part in ("LowerArm", "LowerLeg"))
    animated = any(farthest[anatomy.roles[role]] > ANIMATED for role in hinges if role in anatomy.roles)
    held = {joint for role, joint in anatomy.roles.items() if role.endswith(HELD)} | {*anatomy.neck}
    neutral = []
    for joint, turn in enumerate(medians):
        fixed = animated and farthest[joint] < STILL and joint not in held
        unturned = not fixed and _angle(turn) < UNTURNED
        neutral.append(np.eye(3) if unturned else _squared(turn) if built and not fixed else turn)
    for joint, hangs in _collar_bones(anatomy, motion):
        neutral[joint] = _medians(local[hangs if hangs.any() else ~hangs, joint, None])[0][0]
    return np.array(neutral)


def _collar_bones(anatomy: Anatomy, motion: Motion) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """The joints of collar bones, each with whether its upper arm points downwards along the trunk, (frames,)."""
    directions = Directions(anatomy, motion.positions)
    for side in SIDES:
        arm = directions.bone(f"{side}UpperArm", f"{side}LowerArm")
        if arm is not None and f"{side}Shoulder" in anatomy.roles:
            yield anatomy.roles[f"{side}Shoulder"], (arm * directions.trunk).sum(axis=-1) < 0.0


def bend_axes(anatomy: Anatomy, motion: Motion) -> dict[int, Array]:
    """Return the axes, (3,), about which elbows and knees bend, by the joints of limbs, each in the joint's own axes:
    the mean over the frames. Limbs that hardly bend have none; but where a knee is straight, the plane of shin and foot
    shows its axis. An ankle has the axis of its knee.
    """
    axes: dict[int, Array] = {}
    for side in SIDES:
        for limb in (ARM[1:], LEG):
            ends = list(bones_of(anatomy, side, limb))
            if len(ends) < 2:
                continue
            upper, lower, *feet = (direction(motion.positions, *bone) for bone in ends)
            across = [cross(upper, lower), *(cross(foot, lower) for foot in feet)]
            for joint in [joint for joint, _ in ends[:2]] + [ends[1][1]] * (limb == LEG):
                to_joint = Rotation.from_quat(motion.world_rotations_of(joint)).inv()
                means = [to_joint.apply(each).mean(axis=0) for each in across]
                axis = next((mean for mean in means if lengths(mean) > CLEAR_BEND), None)
                if axis is not None:
                    axes[joint] = normalised(axis)
    return axes


def _medians(turns: Array) -> tuple[Array, Array]:
    """The medians of rotations (frames, joints, 3, 3), (joints, 3, 3): the rotations with the least sum of angles to
    all; and the largest angle to them of each joint, (joints,) [rad].
    """
    weights = np.ones(turns.shape[:2])
    for _ in range(ROUNDS):
        medians = nearest_rotations(np.einsum("fj,fjab->jab", weights, turns))
        cosines = (np.einsum("fjab,jab->fj", turns, medians) - 1.0) / 2.0
        away = np.arccos(np.clip(cosines, -1.0, 1.0))
        weights = 1.0 / np.maximum(away, ALIKE)
    return medians, away.max(axis=0)


def _angle(turn: Array) -> float:
    """The angle of a rotation (3, 3) [rad]."""
    return float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))


def _squared(turn: Array) -> Array:
    """The turn by right angles that is nearest to a rotation, (3, 3), if it is near; else the rotation itself."""
    nearest = _right_angled(turn)
    return nearest if _angle(nearest.T @ turn) < SQUARE else turn


def _right_angled(turn: Array) -> Array:
    """The turn by right angles, (3, 3), that is nearest to a rotation."""
    return np.asarray(RIGHT_ANGLES[np.argmax((RIGHT_ANGLES * turn).sum(axis=(1, 2)))])
