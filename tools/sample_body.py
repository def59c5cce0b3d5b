"""The body of the samples, functions that pose it, and values over time.

The skeleton is that of the paper's Table I. Centimetres, degrees and seconds; Y up, facing +Z, the left side at +X.
Everything is written for the left side; `on_side` mirrors it for the right side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from distretarget import Motion, Skeleton
from distretarget.body.axes import axes_of
from distretarget.numerics.vectors import normalised

FPS = 60
FRAME_TIME = "0.016667"  # [s], as written in the files
SPINE = ("Chest", "Chest2", "Chest3")
SIDES = ("Left", "Right")
SIGN = {"Left": 1, "Right": -1}  # of x
ROTATIONS = ("Zrotation", "Xrotation", "Yrotation")
POSITIONS = ("Xposition", "Yposition", "Zposition")

ANKLE_HEIGHT = 6.5  # over the floor
AT_EASE, STRETCHED = 0.97, 0.992  # reach up to which a limb follows exactly, and its limit [of its length]
WRIST_HEIGHT, FINGERTIP_HEIGHT = 4.0, 1.5  # of a hand that lies on the floor
HEEL = np.array([0.0, -ANKLE_HEIGHT, -5.0])  # from the ankle
THIGH, SHANK = 43.5, 45.3
UPPER_ARM, FOREARM, HAND = 27.3, 25.8, 17.5
ARM_LENGTH = UPPER_ARM + FOREARM
FORWARD = (0.0, 0.0, 1.0)
AT_REST = [(1, 0.0), (2, 0.0)]  # ends of a spline without speed and acceleration

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
Track = NDArray[np.float64]
Points = NDArray[np.float64]
Place = tuple[Points, Rotation]
"""A bone in the world: position (frames, 3) and rotation."""

# ---- values over time; position, speed and acceleration are continuous


def clock(seconds: float) -> Track:
    """The time of each frame [s]."""
    return np.arange(round(seconds * FPS) + 1) / FPS


def cosine(t: Track, period: float, top: float = 0.0) -> Track:
    """A wave between -1 and 1 with a maximum at the time `top` [s]; `period` in s."""
    return np.cos(2 * np.pi * (t - top) / period)


def eased(t: Track, keys: Sequence[float], values: Sequence[float]) -> Track:
    """A track that rests at the time of each key and moves between the values with least jerk."""
    track = np.full(len(t), float(values[0]))
    for start, end, before, after in zip(keys, keys[1:], values, values[1:], strict=False):
        s = np.clip((t - start) / (end - start), 0.0, 1.0)
        track += (after - before) * s**3 * (10 - 15 * s + 6 * s**2)
    return track


def held(t: Track, rise: float, top: float, leave: float, end: float) -> Track:
    """0 until `rise`, 1 from `top` to `leave`, 0 again from `end` on."""
    return eased(t, [rise, top, leave, end], [0, 1, 1, 0])


def bump(t: Track, start: float, end: float) -> Track:
    """0 until the start, 1 half-way, 0 again from the end on."""
    s = np.clip((t - start) / (end - start), 0.0, 1.0)
    return np.sin(np.pi * s) ** 4


def columns(*tracks: ArrayLike) -> Track:
    """(frames, tracks), from tracks and constants."""
    return np.stack(np.broadcast_arrays(*tracks), axis=-1).astype(float)


# ---- the skeleton


def _table_one() -> Skeleton:
    rows = [*TRUNK]
    for limb in (ARM, LEG):
        names = {name for name, *_ in limb}
        rows += [
            (side + name, side + parent if parent in names else parent, (SIGN[side] * x, y, z), length)
            for side in ("Right", "Left")
            for name, parent, (x, y, z), length in limb
        ]
    names = tuple(row[0] for row in rows)
    ends = np.array([name.endswith("_End") for name in names])
    return Skeleton(
        names=names,
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _, _ in rows]),
        offsets=np.array([np.multiply(direction, length) for _, _, direction, length in rows]),
        channels=(POSITIONS + ROTATIONS, *(() if end else ROTATIONS for end in ends[1:])),
        end_sites=ends,
        units="cm",
        up="Y",
    )


SKELETON = _table_one()
OFFSET = {name: np.array(offset) for name, offset in zip(SKELETON.names, SKELETON.offsets, strict=True)}
STANDING = ANKLE_HEIGHT + 0.9965 * (THIGH + SHANK) - OFFSET["LeftHip"][1]
"""The height of the hips when the knees are slightly bent."""

# ---- vectors and rotations


def on_side(side: str, value: Any) -> Any:
    """Points (..., 3) or a rotation of the left side, mirrored for the right side."""
    if side == "Left":
        return value
    if isinstance(value, Rotation):
        return Rotation.from_quat(value.as_quat() * (1, -1, -1, 1))
    return np.asarray(value) * (-1.0, 1.0, 1.0)


def seen_from(side: str, place: Place) -> Place:
    """A position and rotation on one side, mirrored to the left side."""
    return on_side(side, place[0]), on_side(side, place[1])


def turned(pitch: ArrayLike = 0.0, yaw: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> Rotation:
    """Rotations from angles in degrees: leaning forward, turning to the left, leaning to the right."""
    return _euler("YXZ", yaw, pitch, roll)


def _euler(axes: str, *angles: ArrayLike) -> Rotation:
    return Rotation.from_euler(axes, columns(*angles), degrees=True)


def part(rotation: Rotation, weight: ArrayLike) -> Rotation:
    """The rotation about the same axis by `weight` times the angle."""
    return Rotation.from_rotvec(rotation.as_rotvec() * np.asarray(weight)[..., None])


def blend(start: Rotation, end: Rotation, weight: ArrayLike) -> Rotation:
    """From `start` at weight 0 to `end` at weight 1, about a fixed axis (slerp)."""
    return start * part(start.inv() * end, weight)


def from_axes(x: Points, y: Points) -> Rotation:
    """The rotation that takes the first two axes to orthogonal unit vectors x and y, (frames, 3)."""
    return Rotation.from_matrix(axes_of(x, y))


def two_bones(start: Points, end: Points, pole: ArrayLike, upper: float, lower: float) -> tuple[Points, Points, Points]:
    """Two-bone inverse kinematics: unit vectors along two bones that reach from `start` to `end` and bend towards the
    pole vector, and the axis of the bend, about which the upper bone turns to the lower; (frames, 3) each.
    """
    span = end - start
    length = np.linalg.norm(span, axis=1)
    if np.any(length >= upper + lower) or np.any(length <= abs(upper - lower)):
        raise ValueError(f"two bones of {upper} and {lower} cannot span {length.min():.2f} to {length.max():.2f}")
    along = normalised(span)
    pole = np.broadcast_to(pole, span.shape)
    aside = normalised(pole - np.sum(pole * along, axis=1, keepdims=True) * along)
    cos = ((upper**2 + length**2 - lower**2) / (2 * upper * length))[:, None]
    first = along * cos + aside * np.sqrt(1 - cos**2)
    second = (span - upper * first) / lower
    return first, second, np.cross(aside, along)


def within_reach(start: Points, end: Points, length: float) -> Points:
    """`end`, (frames, 3), moved smoothly towards `start` if it is farther away than `AT_EASE` of the length."""
    span = end - start
    reach = np.linalg.norm(span, axis=1, keepdims=True) / length
    slack = STRETCHED - AT_EASE
    drawn = AT_EASE + slack * np.tanh((reach - AT_EASE) / slack)
    return start + span * np.where(reach > AT_EASE, drawn / reach, 1.0)


# ---- trunk


@dataclass(frozen=True)
class Trunk:
    """The position of the hips, (frames, 3), and the local rotations of Hips, Chest, Chest2, Chest3, Neck and Head."""

    position: Points
    local: Mapping[str, Rotation]

    def pelvis(self) -> Place:
        return self.position, self.local["Hips"]

    def hip(self, side: str) -> Points:
        """(frames, 3), the hip joint of a side."""
        return self.position + self.local["Hips"].apply(OFFSET[side + "Hip"])

    def chest(self) -> Place:
        """Position and world rotation of Chest3, which carries the arms."""
        position, rotation = self.position, self.local["Hips"]
        for name in SPINE:
            position = position + rotation.apply(OFFSET[name])
            rotation = rotation * self.local[name]
        return position, rotation


def trunk(position: Points, pelvis: Rotation, bend: Rotation, look: Rotation) -> Trunk:
    """The trunk from place and rotation of the pelvis, the bend from pelvis to chest, and the head's rotation."""
    third = part(bend, 1 / 3)
    turn = (pelvis * third * third * third).inv() * look
    neck = part(turn, 0.5)
    return Trunk(position, {"Hips": pelvis, **dict.fromkeys(SPINE, third), "Neck": neck, "Head": neck.inv() * turn})


# ---- arms


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
    upper = _euler("XZX", np.negative(flexion), np.subtract(abduction, 90), roll)
    collar = _collar(upper.apply([1.0, 0.0, 0.0]))
    bend = _euler("YX", np.negative(elbow), pronation)
    return Arm(collar, collar.inv() * upper, bend, _euler("ZY", np.negative(wrist), np.negative(deviation)))


def _collar(direction: Points) -> Rotation:
    """The collar's rotation for an upper arm with this direction in the chest's frame."""
    return shrug(9 * (1 + direction[..., 1]) ** 2, 9 * direction[..., 2] * np.abs(direction[..., 2]))


def shrug(lift: ArrayLike, reach: ArrayLike) -> Rotation:
    """The collar's rotation that lifts the shoulder and brings it forward [degrees]."""
    return _euler("ZY", lift, np.negative(reach))


def straight_arm(side: str, chest: Place, fingers: Points, reach: float) -> Points:
    """The wrist of a straight arm, (frames, 3), with its fingers along a direction; `reach` of its length."""
    position, rotation = chest
    shoulder = OFFSET["LeftCollar"] + _collar(fingers).apply(OFFSET["LeftShoulder"])
    return position + rotation.apply(on_side(side, shoulder + fingers * reach * ARM_LENGTH))


def hand(fingers: ArrayLike, palm: ArrayLike) -> Rotation:
    """The rotation of a left hand with fingers and palm in these directions, (frames, 3) or (3,)."""
    fingers = normalised(np.atleast_2d(np.asarray(fingers, float)))
    palm = np.atleast_2d(np.asarray(palm, float))
    palm = normalised(palm - np.sum(palm * fingers, axis=1, keepdims=True) * fingers)
    return from_axes(fingers, -palm)


def flat_hand(yaw: float) -> Rotation:
    """The rotation of a hand that lies on the floor, palm down, its fingers turned by `yaw` [degrees] from +Z to +X."""
    drop = FINGERTIP_HEIGHT - WRIST_HEIGHT
    level = np.sqrt(HAND**2 - drop**2)
    return hand([level * np.sin(np.radians(yaw)), drop, level * np.cos(np.radians(yaw))], palm=[0.0, -1.0, 0.0])


def reaching_arm(chest: Place, collar: Rotation, wrist: Points, pole: Points, hand_world: Rotation) -> Arm:
    """The left arm that brings the wrist to these points with this rotation of the hand, the elbow towards the pole
    vector, all in the world. The forearm takes the whole roll of the hand.
    """
    position, rotation = chest
    collar_world = rotation * collar
    shoulder = position + rotation.apply(OFFSET["LeftCollar"]) + collar_world.apply(OFFSET["LeftShoulder"])
    u, f, axis = two_bones(shoulder, wrist, pole, UPPER_ARM, FOREARM)
    upper, fore = from_axes(u, -axis), from_axes(f, -axis)
    x, _, _, w = np.moveaxis((fore.inv() * hand_world).as_quat(), -1, 0)
    fore = fore * turned(pitch=2 * np.degrees(np.arctan2(x, w)))
    return Arm(collar, collar_world.inv() * upper, upper.inv() * fore, fore.inv() * hand_world)


def aimed_arm(side: str, chest: Place, hand: Place, elbow: ArrayLike) -> Arm:
    """The arm of a side that brings the hand to this position and rotation, the elbow towards `elbow`, (frames, 3) or
    (3,), all in the world. The collar bone follows the arm; a wrist out of reach is drawn nearer.
    """
    chest, (wrist, rotation) = seen_from(side, chest), seen_from(side, hand)
    shoulder = chest[0] + chest[1].apply(OFFSET["LeftCollar"] + OFFSET["LeftShoulder"])
    collar = _collar(chest[1].inv().apply(normalised(wrist - shoulder)))
    shoulder = chest[0] + chest[1].apply(OFFSET["LeftCollar"] + collar.apply(OFFSET["LeftShoulder"]))
    wrist = within_reach(shoulder, wrist, ARM_LENGTH)
    return reaching_arm(chest, collar, wrist, on_side(side, elbow), rotation)


# ---- legs


@dataclass(frozen=True)
class Foot:
    """A foot in the world."""

    ankle: Points  # its position, (frames, 3)
    rotation: Rotation
    toe: ArrayLike = 0.0  # the upward bend of the toes, (frames,) [degrees]
    knee: ArrayLike | None = None  # (frames, 3) or (3,), the pole vector of the leg; by default as in `pole`

    def pole(self, pelvis: Rotation) -> ArrayLike:
        """The direction of the knee; by default between the forward directions of pelvis and foot."""
        if self.knee is not None:
            return self.knee
        return normalised(pelvis.apply(FORWARD) * (1, 0, 1)) + 2 * normalised(self.rotation.apply(FORWARD) * (1, 0, 1))


def rolled_ankle(pitch: Points) -> Points:
    """The displacement of the ankle, (frames, 3), when the flat foot rolls over its heel (toes up) or its toe joint."""
    pivot = np.where(pitch[:, None] > 0, HEEL, OFFSET["LeftToe"])
    return pivot - turned(pitch=-pitch).apply(pivot)


def motion(trunk: Trunk, arms: Mapping[str, Arm], feet: Mapping[str, Foot]) -> Motion:
    """The motion of the whole body, from arms and feet by side; the right arm is given mirrored."""
    local, pelvis = dict(trunk.local), trunk.local["Hips"]
    for side in SIDES:
        foot = feet[side]
        u, f, axis = two_bones(trunk.hip(side), foot.ankle, foot.pole(pelvis), THIGH, SHANK)
        thigh, shank = from_axes(axis, -u), from_axes(axis, -f)
        leg = pelvis.inv() * thigh, thigh.inv() * shank, shank.inv() * foot.rotation, turned(np.negative(foot.toe))
        local |= zip((f"{side}{name}" for name in ("Hip", "Knee", "Ankle", "Toe")), leg, strict=True)
        local |= {side + name.capitalize(): on_side(side, rotation) for name, rotation in vars(arms[side]).items()}
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(trunk.position), len(SKELETON), 1))
    for name, rotation in local.items():
        rotations[:, SKELETON.index(name)] = rotation.as_quat()
    return Motion(SKELETON, trunk.position, rotations, FRAME_TIME)
