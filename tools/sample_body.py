"""The body of the samples: the skeleton of the paper's Table I, and functions that pose it.

Centimetres, Y up, facing +Z, the left side at +X. Everything is written for the left side; the right side is its
mirror image.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.skeleton import Skeleton

FRAME_TIME = "0.016667"  # [s], as written in the files
SPINE = ("Chest", "Chest2", "Chest3")
SIDES = ("Left", "Right")
ROTATIONS = ("Zrotation", "Xrotation", "Yrotation")
POSITIONS = ("Xposition", "Yposition", "Zposition")

ANKLE_HEIGHT = 6.5  # over the floor
AT_EASE, STRETCHED = 0.97, 0.992  # reach of a limb that gets everywhere, and of the straightest [of its length]
WRIST_HEIGHT, FINGERTIP_HEIGHT = 4.0, 1.5  # of a hand that lies on the floor
HEEL = np.array([0.0, -ANKLE_HEIGHT, -5.0])  # from the ankle
THIGH, SHANK = 43.5, 45.3
UPPER_ARM, FOREARM, HAND = 27.3, 25.8, 17.5
ARM_LENGTH = UPPER_ARM + FOREARM

# Rows of a part of the body: name, parent, direction from the parent, length.
TRUNK = (
    ("Hips", "", (0, 0, 0), 0),
    ("Chest", "Hips", (0, 1, 0), 16.0),
    ("Chest2", "Chest", (0, 1, 0), 17.9),
    ("Chest3", "Chest2", (0, 1, 0), 6.9),
    ("Neck", "Chest3", (0, 1, 0), 6.9),
    ("Head", "Neck", (0, 1, 0), 10.6),
    ("Head_End", "Head", (0, 1, 0), 18.0),
)
ARM = (
    ("Collar", "Chest3", (0.8, 0.6, 0), 7.2),
    ("Shoulder", "Collar", (0.96, -0.28, 0), 15.8),
    ("Elbow", "Shoulder", (1, 0, 0), UPPER_ARM),
    ("Wrist", "Elbow", (1, 0, 0), FOREARM),
    ("Wrist_End", "Wrist", (1, 0, 0), HAND),
)
LEG = (
    ("Hip", "Hips", (0.8, -0.6, 0), 10.8),
    ("Knee", "Hip", (0, -1, 0), THIGH),
    ("Ankle", "Knee", (0, -1, 0), SHANK),
    ("Toe", "Ankle", (0, -0.28, 0.96), 12.5),
    ("Toe_End", "Toe", (0, -0.28, 0.96), 6.0),
)
Points = NDArray[np.float64]
Place = tuple[Points, Rotation]
"""A bone in the world: position (frames, 3) and rotation."""


def _limb(side: str, rows: tuple) -> list[tuple]:
    """The rows of a limb on one side, with names and directions of that side."""
    limb = {name for name, *_ in rows}
    sign = 1 if side == "Left" else -1
    return [
        (side + name, side + parent if parent in limb else parent, (sign * x, y, z), length)
        for name, parent, (x, y, z), length in rows
    ]


def _table_one() -> Skeleton:
    rows = [*TRUNK]
    for limb in (ARM, LEG):
        rows += _limb("Right", limb) + _limb("Left", limb)
    names = tuple(row[0] for row in rows)
    ends = np.array([name.endswith("_End") for name in names])
    channels = [() if end else ROTATIONS for end in ends]
    channels[0] = POSITIONS + ROTATIONS
    return Skeleton(
        names=names,
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _, _ in rows]),
        offsets=np.array([np.multiply(direction, length) for _, _, direction, length in rows]),
        channels=tuple(channels),
        end_sites=ends,
        units="cm",
        up="Y",
    )


SKELETON = _table_one()
OFFSET = {name: np.array(offset) for name, offset in zip(SKELETON.names, SKELETON.offsets, strict=True)}
STANDING = ANKLE_HEIGHT + 0.9965 * (THIGH + SHANK) - OFFSET["LeftHip"][1]
"""The height of the hips when the knees are slightly bent."""


def flipped(points: ArrayLike) -> Points:
    """Points (..., 3) mirrored between left and right."""
    return np.asarray(points) * (-1.0, 1.0, 1.0)


def mirrored(rotation: Rotation) -> Rotation:
    """A rotation mirrored between left and right."""
    return Rotation.from_quat(rotation.as_quat() * (1, -1, -1, 1))


def seen_from(side: str, place: Place) -> Place:
    """A place as it is for the left side: itself on the left, its mirror image on the right."""
    position, rotation = place
    return place if side == "Left" else (flipped(position), mirrored(rotation))


def turned(pitch: ArrayLike = 0.0, yaw: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> Rotation:
    """Rotations from angles in degrees: leaning forward, turning to the left, leaning to the right."""
    angles = np.broadcast_arrays(yaw, pitch, roll)
    return Rotation.from_euler("YXZ", np.stack(angles, axis=-1), degrees=True)


def part(rotation: Rotation, weight: ArrayLike) -> Rotation:
    """The rotation about the same axis by `weight` times the angle."""
    return Rotation.from_rotvec(rotation.as_rotvec() * np.asarray(weight)[..., None])


def blend(start: Rotation, end: Rotation, weight: ArrayLike) -> Rotation:
    """From `start` at weight 0 to `end` at weight 1, about a fixed axis (slerp)."""
    return start * part(start.inv() * end, weight)


def unit(vectors: Points) -> Points:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def from_axes(x: Points, y: Points) -> Rotation:
    """The rotation that takes the first two axes to orthogonal unit vectors x and y, (frames, 3)."""
    return Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=-1))


def two_bones(start: Points, end: Points, pole: ArrayLike, upper: float, lower: float) -> tuple[Points, Points, Points]:
    """Two-bone inverse kinematics: unit vectors along two bones that reach from `start` to `end` and bend towards
    `pole`, and the axis of the bend, about which the upper bone turns to the lower; (frames, 3) each.

    Raises:
        ValueError: the bones are too short or too long.
    """
    span = end - start
    length = np.linalg.norm(span, axis=1)
    if np.any(length >= upper + lower) or np.any(length <= abs(upper - lower)):
        raise ValueError(f"two bones of {upper} and {lower} cannot span {length.min():.2f} to {length.max():.2f}")
    along = unit(span)
    pole = np.broadcast_to(pole, span.shape)
    aside = unit(pole - np.sum(pole * along, axis=1, keepdims=True) * along)
    cos = ((upper**2 + length**2 - lower**2) / (2 * upper * length))[:, None]
    first = along * cos + aside * np.sqrt(1 - cos**2)
    second = (span - upper * first) / lower
    return first, second, np.cross(aside, along)


def within_reach(start: Points, end: Points, length: float) -> Points:
    """(frames, 3), `end`, drawn smoothly towards `start` where it is more than `AT_EASE` of the length away from it."""
    span = end - start
    reach = np.linalg.norm(span, axis=1, keepdims=True) / length
    slack = STRETCHED - AT_EASE
    drawn = AT_EASE + slack * np.tanh((reach - AT_EASE) / slack)
    return start + span * np.where(reach > AT_EASE, drawn / reach, 1.0)


@dataclass(frozen=True)
class Trunk:
    """The position of the pelvis, and the local rotations from there to the head.

    Attributes:
        position: (frames, 3), of the hips.
        local: rotations of Hips, Chest, Chest2, Chest3, Neck and Head.
    """

    position: Points
    local: Mapping[str, Rotation]

    def pelvis(self) -> Place:
        return self.position, self.local["Hips"]

    def hip(self, side: str) -> Points:
        """(frames, 3), where the thigh of this side begins."""
        return self.position + self.local["Hips"].apply(OFFSET[side + "Hip"])

    def chest(self) -> Place:
        """Position and world rotation of Chest3, which carries the arms."""
        position, rotation = self.position, self.local["Hips"]
        for name in SPINE:
            position = position + rotation.apply(OFFSET[name])
            rotation = rotation * self.local[name]
        return position, rotation


def trunk(position: Points, pelvis: Rotation, bend: Rotation, look: Rotation) -> Trunk:
    """The trunk from position and world rotation of the pelvis, the bend from pelvis to chest, and the head's world
    rotation.
    """
    third = part(bend, 1 / 3)
    local = {"Hips": pelvis, **dict.fromkeys(SPINE, third)}
    turn = (pelvis * third * third * third).inv() * look
    local["Neck"] = part(turn, 0.5)
    local["Head"] = local["Neck"].inv() * turn
    return Trunk(position, local)


@dataclass(frozen=True)
class Arm:
    """Local rotations of the left arm, or of the right arm mirrored."""

    collar: Rotation
    shoulder: Rotation
    elbow: Rotation
    wrist: Rotation

    def blended(self, other: Arm, weight: ArrayLike) -> Arm:
        """From this pose at weight 0 to the other at weight 1, joint by joint."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Arm(*(blend(start, end, weight) for start, end in pairs))


def swung_arm(
    *,
    flexion: ArrayLike,
    abduction: ArrayLike,
    elbow: ArrayLike,
    roll: ArrayLike = 0.0,
    pronation: ArrayLike = 0.0,
    wrist: ArrayLike = 0.0,
    deviation: ArrayLike = 0.0,
) -> Arm:
    """An arm from the angles of its joints [degrees]; at zero it hangs down with the palm towards the thigh.

    `abduction` lifts the upper arm sideways, `flexion` swings it forward, `roll` rolls it inwards; `wrist` bends the
    hand towards the palm, `deviation` towards the thumb. The collar bone rises and moves forward with the upper arm.
    """
    angles = np.broadcast_arrays(flexion, abduction, elbow, roll, pronation, wrist, deviation)
    flexion, abduction, elbow, roll, pronation, wrist, deviation = np.array(angles, float)
    upper = _euler("XZX", -flexion, abduction - 90, roll)
    collar = shrug(*_collar_help(upper.apply([1.0, 0.0, 0.0])))
    return Arm(
        collar=collar,
        shoulder=collar.inv() * upper,
        elbow=_euler("YX", -elbow, pronation),
        wrist=_euler("ZY", -wrist, -deviation),
    )


def _euler(axes: str, *angles: NDArray[np.float64]) -> Rotation:
    return Rotation.from_euler(axes, np.stack(angles, axis=-1), degrees=True)


def _collar_help(direction: Points) -> tuple[Points, Points]:
    """Lift and reach of the collar [degrees] for an upper arm with this direction in the chest's frame."""
    lift = 9 * (1 + direction[..., 1]) ** 2
    return lift, 9 * direction[..., 2] * np.abs(direction[..., 2])


def shrug(lift: ArrayLike, reach: ArrayLike) -> Rotation:
    """The collar's rotation that lifts the shoulder and brings it forward [degrees]."""
    return _euler("ZY", *np.broadcast_arrays(lift, np.negative(reach)))


def raised_shoulder(direction: Points) -> Points:
    """(frames, 3), the left shoulder in the chest's frame, for an arm in this direction there."""
    return OFFSET["LeftCollar"] + shrug(*_collar_help(direction)).apply(OFFSET["LeftShoulder"])


def hand(fingers: ArrayLike, palm: ArrayLike) -> Rotation:
    """The rotation of a left hand with fingers and palm in these directions, (frames, 3) or (3,)."""
    fingers = unit(np.atleast_2d(np.asarray(fingers, float)))
    palm = np.atleast_2d(np.asarray(palm, float))
    palm = unit(palm - np.sum(palm * fingers, axis=1, keepdims=True) * fingers)
    return from_axes(fingers, -palm)


def flat_hand(yaw: ArrayLike) -> Rotation:
    """The rotation of a hand that lies on the floor, palm down, its fingers turned by `yaw` [degrees] from +Z to +X."""
    a = np.radians(yaw)
    level = np.sqrt(HAND**2 - (WRIST_HEIGHT - FINGERTIP_HEIGHT) ** 2)
    drop = FINGERTIP_HEIGHT - WRIST_HEIGHT
    fingers = np.stack(np.broadcast_arrays(level * np.sin(a), drop, level * np.cos(a)), axis=-1)
    return hand(fingers, palm=[0.0, -1.0, 0.0])


def reaching_arm(chest: Place, collar: Rotation, wrist: Points, pole: Points, hand_world: Rotation) -> Arm:
    """The left arm with the wrist at these points, the elbow towards `pole`, and this rotation of the hand, all in the
    world. The forearm takes the whole roll of the hand.
    """
    position, rotation = chest
    collar_world = rotation * collar
    shoulder = position + rotation.apply(OFFSET["LeftCollar"]) + collar_world.apply(OFFSET["LeftShoulder"])
    u, f, axis = two_bones(shoulder, wrist, pole, UPPER_ARM, FOREARM)
    upper, fore = from_axes(u, -axis), from_axes(f, -axis)
    fore = fore * _roll_about_x(fore.inv() * hand_world)
    return Arm(collar, collar_world.inv() * upper, upper.inv() * fore, fore.inv() * hand_world)


def aimed_arm(side: str, chest: Place, hand: Place, elbow: ArrayLike) -> Arm:
    """The arm of a side with this position of the wrist and rotation of the hand, the elbow towards `elbow`, (frames,
    3) or (3,), all in the world. The collar bone follows the arm; a wrist too far away is drawn nearer.
    """
    chest, (wrist, rotation) = seen_from(side, chest), seen_from(side, hand)
    shoulder = chest[0] + chest[1].apply(OFFSET["LeftCollar"] + OFFSET["LeftShoulder"])
    collar = shrug(*_collar_help(chest[1].inv().apply(unit(wrist - shoulder))))
    shoulder = chest[0] + chest[1].apply(OFFSET["LeftCollar"] + collar.apply(OFFSET["LeftShoulder"]))
    wrist = within_reach(shoulder, wrist, ARM_LENGTH)
    pole = np.asarray(elbow) if side == "Left" else flipped(elbow)
    return reaching_arm(chest, collar, wrist, pole, rotation)


def _roll_about_x(rotation: Rotation) -> Rotation:
    x, _, _, w = np.moveaxis(rotation.as_quat(), -1, 0)
    return turned(pitch=2 * np.degrees(np.arctan2(x, w)))


@dataclass(frozen=True)
class Foot:
    """Position and rotation of a foot in the world.

    Attributes:
        ankle: (frames, 3).
        yaw: (frames,), turn to the left [degrees].
        pitch: (frames,), toes up [degrees].
        toe: (frames,), toes bent up against the foot [degrees].
    """

    ankle: Points
    yaw: Points
    pitch: Points
    toe: Points

    @property
    def rotation(self) -> Rotation:
        return turned(-self.pitch, self.yaw)

    def knee(self, pelvis: Rotation) -> Points:
        """(frames, 3), the direction of the knee: between the forward directions of pelvis and foot."""
        return unit(pelvis.apply([0.0, 0.0, 1.0]) * (1, 0, 1)) + 2 * turned(yaw=self.yaw).apply([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class AimedFoot:
    """Position and rotation of a foot in the world, with the knee's direction.

    Attributes:
        ankle: (frames, 3).
        rotation: of the foot.
        toe: (frames,), toes bent up against the foot [degrees].
        aim: (frames, 3) or (3,), the direction of the knee.
    """

    ankle: Points
    rotation: Rotation
    toe: Points
    aim: ArrayLike

    def knee(self, pelvis: Rotation) -> Points:  # noqa: ARG002
        """The direction of the knee."""
        return np.asarray(self.aim)


def rolled_ankle(pitch: Points) -> Points:
    """(frames, 3), how far the ankle moves when the flat foot rolls over its heel (toes up) or its toe joint."""
    pivot = np.where(pitch[:, None] > 0, HEEL, OFFSET["LeftToe"])
    return pivot - turned(pitch=-pitch).apply(pivot)


def _leg(trunk: Trunk, side: str, foot: Foot | AimedFoot) -> dict[str, Rotation]:
    """Local rotations of a leg from hip to foot."""
    pelvis = trunk.local["Hips"]
    u, f, axis = two_bones(trunk.hip(side), foot.ankle, foot.knee(pelvis), THIGH, SHANK)
    thigh, shank = from_axes(axis, -u), from_axes(axis, -f)
    return {
        side + "Hip": pelvis.inv() * thigh,
        side + "Knee": thigh.inv() * shank,
        side + "Ankle": shank.inv() * foot.rotation,
        side + "Toe": turned(-foot.toe),
    }


def motion(trunk: Trunk, arms: Mapping[str, Arm], feet: Mapping[str, Foot | AimedFoot]) -> Motion:
    """The motion of the whole body, from arms and feet by side; the right arm is given mirrored."""
    frames = len(trunk.position)
    local = dict(trunk.local)
    for side in SIDES:
        local |= _leg(trunk, side, feet[side])
        for name, rotation in vars(arms[side]).items():
            local[side + name.capitalize()] = rotation if side == "Left" else mirrored(rotation)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(SKELETON), 1))
    for name, rotation in local.items():
        rotations[:, SKELETON.index(name)] = rotation.as_quat()
    return Motion(SKELETON, np.broadcast_to(trunk.position, (frames, 3)), rotations, FRAME_TIME)
