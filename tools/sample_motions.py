"""The sample clips, each made by a function. Angles in degrees, lengths in cm, times in s."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    ARM_LENGTH,
    OFFSET,
    SHANK,
    SIDES,
    STANDING,
    THIGH,
    Arm,
    Foot,
    Place,
    Trunk,
    hand,
    motion,
    reaching_arm,
    rolled_ankle,
    seen_from,
    shrug,
    swung_arm,
    trunk,
    turned,
)
from sample_tracks import Track, bump, clock, columns, cosine, eased, held
from sample_walk import walk
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion


def hanging_arm(t: Track, late: float = 0.0) -> Arm:
    """A hanging arm that moves slightly with the breath."""
    breath = cosine(t, 3.4, late)
    return swung_arm(
        flexion=-3 + 0.8 * breath,
        abduction=9 + 0.6 * breath,
        elbow=17 + 1.2 * cosine(t, 3.4, late + 0.3),
        roll=18,
        pronation=8,
        wrist=8,
    )


def planted_feet(t: Track, width: float, toe_out: float) -> dict[str, Foot]:
    """Both feet resting on the floor, the ankles `width` apart, each foot turned out by `toe_out`."""
    still = np.zeros(len(t))
    feet = {}
    for side, sign in zip(SIDES, (1, -1), strict=True):
        ankle = columns(still + sign * width / 2, ANKLE_HEIGHT, -4.0)
        feet[side] = Foot(ankle, still + sign * toe_out, still, still)
    return feet


def standing_trunk(t: Track, shift: Track, look: Rotation) -> Trunk:
    """A trunk that breathes over resting feet, with the hips `shift` to the left."""
    shift = shift + 0.4 * cosine(t, 4.7, 1.0)
    position = columns(shift, STANDING - 0.4 - 0.012 * shift**2, 0.3 * cosine(t, 4.1))
    pelvis = turned(pitch=3.0, yaw=0.25 * shift, roll=0.55 * shift)
    bend = turned(pitch=1.5 + 0.7 * cosine(t, 3.4), yaw=-0.3 * shift, roll=-0.75 * shift)
    return trunk(position, pelvis, bend, look)


def clap() -> Motion:
    """Six claps in front of the chest."""
    t = clock(4.6)
    first, period = 1.1, 0.45
    last = first + 5 * period
    clapping = held(t, first - 0.36, first - 0.04, last + 0.04, last + 0.36)
    away = 1 - clapping * (0.5 + 0.5 * cosine(t, period, first))
    attention = held(t, 0.3, 1.0, 3.6, 4.4)
    look = turned(pitch=3 + attention * (2.5 + 0.8 * cosine(t, period, first)))
    body = standing_trunk(t, eased(t, [0.4, 1.5, 3.4, 4.4], [0, 1.5, -1.0, 0]), look)
    raised = held(t, 0.15, 0.95, last + 0.1, last + 0.95)
    arms = {side: hanging_arm(t).blended(_clapping_arm(seen_from(side, body.chest()), away), raised) for side in SIDES}
    return motion(body, arms, planted_feet(t, width=19, toe_out=9))


def _clapping_arm(chest: Place, away: Track) -> Arm:
    """An arm with the palm towards the other hand. At `away` 0 the wrists are 4 % of the arm's length apart."""
    position, rotation = chest
    wrist = columns(0.02 * ARM_LENGTH + 18 * away, -11 - 2 * away, 33 - 2 * away)
    palm = hand(fingers=columns(0.25 * away, 0.72, 0.69), palm=columns(-1, 0.12 * away, 0.3 * away))
    pole = rotation.apply([0.5, -0.85, -0.25])
    collar = shrug(1.0, 8 - 5 * away)
    return reaching_arm(chest, collar, position + rotation.apply(wrist), pole, rotation * palm)


def hands_on_hips() -> Motion:
    """The hands go to the hips, the body sways slowly, and the hands go back."""
    t = clock(5.6)
    shift = 3.2 * eased(t, [1.0, 2.1, 3.4, 4.6], [0, 1, -1, 0])
    body = standing_trunk(t, shift, turned(pitch=2, yaw=-1.2 * shift, roll=0.4 * shift))
    on_hips = held(t, 0.3, 1.35, 4.2, 5.3)
    arms = {}
    for side in SIDES:
        on_hip = _arm_on_hip(seen_from(side, body.chest()), seen_from(side, body.pelvis()))
        arms[side] = hanging_arm(t).blended(on_hip, on_hips)
    return motion(body, arms, planted_feet(t, width=24, toe_out=11))


def _arm_on_hip(chest: Place, pelvis: Place) -> Arm:
    position, rotation = pelvis
    wrist = position + rotation.apply([16.5, 5.0, -3.0])
    palm = hand(fingers=[-0.22, -0.52, 0.82], palm=[-1.0, -0.05, -0.2])
    return reaching_arm(chest, shrug(4.0, -4.0), wrist, chest[1].apply([0.9, 0.0, -0.42]), rotation * palm)


def squat() -> Motion:
    """Two squats with the arms held out for balance."""
    t = clock(5.6)
    depth = held(t, 0.4, 1.6, 1.8, 2.75) + held(t, 3.0, 4.2, 4.4, 5.35)
    feet = planted_feet(t, width=30, toe_out=16)
    arm = swung_arm(
        flexion=-3 + 126 * depth,
        abduction=9 - 4 * depth,
        elbow=17 - 3 * depth + 1.2 * cosine(t, 3.4),
        roll=18 + 10 * depth,
        pronation=8 + 30 * depth,
        wrist=8 - 6 * depth,
    )
    return motion(_squatting_trunk(t, depth, feet["Left"].ankle), dict.fromkeys(SIDES, arm), feet)


def _squatting_trunk(t: Track, depth: Track, ankle: Track) -> Trunk:
    """A trunk over knees that bend in proportion to `depth`: standing at 0, thighs horizontal at 1."""
    knee = np.radians(13 + 97 * depth)
    span = np.sqrt(THIGH**2 + SHANK**2 + 2 * THIGH * SHANK * np.cos(knee))
    pelvis = turned(pitch=3 + 27 * depth)
    hip = pelvis.apply(OFFSET["LeftHip"])
    forward = ankle[:, 2] + 3.5 - 24 * depth
    sideways, behind = ankle[:, 0] - hip[:, 0], forward + hip[:, 2] - ankle[:, 2]
    height = ankle[:, 1] + np.sqrt(span**2 - sideways**2 - behind**2) - hip[:, 1]
    bend = turned(pitch=2 + 12 * depth + 0.7 * cosine(t, 3.4))
    return trunk(columns(0.0, height, forward), pelvis, bend, turned(pitch=2 + 12 * depth))


def wave() -> Motion:
    """The right arm waves five times."""
    t = clock(5.0)
    period = 0.5
    waving = held(t, 0.95, 1.35, 3.3, 3.75)
    swing, late = (waving * cosine(t, period, top) for top in (1.225, 1.285))
    tilt = held(t, 0.5, 1.4, 3.6, 4.6)
    look = turned(pitch=2 + tilt, yaw=-4 * tilt, roll=4 * tilt + 0.5 * swing)
    up = swung_arm(
        flexion=12,
        abduction=64 + 3 * swing,
        elbow=112 + 9 * swing,
        roll=-74 - 19 * swing,
        pronation=12,
        wrist=-6,
        deviation=9 * late,
    )
    raised = held(t, 0.3, 1.25, 3.75, 4.75)
    arms = {"Left": hanging_arm(t), "Right": hanging_arm(t, 0.4).blended(up, raised)}
    return motion(standing_trunk(t, 2.2 * tilt, look), arms, planted_feet(t, width=20, toe_out=10))


def turn() -> Motion:
    """A turn to the left on the spot through 360 degrees, in ten small steps."""
    t = clock(5.6)
    start, step, count = 0.45, 0.46, 10
    lifts = start + step * np.arange(count)
    end = start + step * count
    busy = held(t, start - 0.3, start + 0.2, end, end + 0.4)
    weight = _weight(t, lifts[1::2], step) - _weight(t, lifts[::2], step)
    facing = turned(yaw=_full_turn(t, start + 0.1, end + 0.1))
    height = STANDING - 0.6 - 1.7 * busy + 0.8 * np.abs(weight)
    body = trunk(
        facing.apply(columns(2.3 * weight, height, -0.5)),
        facing * turned(pitch=3.5, roll=-2 * weight),
        turned(pitch=2.0, yaw=3 * busy, roll=2.2 * weight),
        facing * turned(pitch=2 + 2 * busy, yaw=11 * busy),
    )
    arms = {"Left": _turning_arm(t, weight, busy), "Right": _turning_arm(t, -weight, busy)}
    feet = {"Left": _stepping_foot(t, 1, lifts[::2], step), "Right": _stepping_foot(t, -1, lifts[1::2], step)}
    return motion(body, arms, feet)


def _weight(t: Track, lifts: Sequence[float], step: float) -> Track:
    """How far the weight is on the other foot, from 0 to 1, while this foot steps."""
    return sum(bump(t, lift - 0.1, lift + step + 0.1) for lift in lifts)


def _full_turn(t: Track, start: float, end: float) -> Track:
    """From 0 to 360 degrees at constant speed, with a smooth start and end."""
    fade = 0.4  # [s]
    speed = held(t, start - fade, start + fade, end - fade, end + fade)
    angle = np.cumsum(speed)
    return 360 * angle / angle[-1]


def _turning_arm(t: Track, weight: Track, busy: Track) -> Arm:
    return swung_arm(
        flexion=-3 + 4 * weight,
        abduction=9 + 4 * busy,
        elbow=17 + 6 * busy + 2 * weight,
        roll=18,
        pronation=8,
        wrist=8 + cosine(t, 3.4),
    )


def _stepping_foot(t: Track, sign: int, lifts: Sequence[float], step: float) -> Foot:
    """A foot that steps around the middle of the body, by an equal part of the full turn at each lift."""
    air = 0.9 * step
    heading = sum(eased(t, [lift + 0.03, lift + air], [0, 360 / len(lifts)]) for lift in lifts)
    lifted = sum(bump(t, lift, lift + air) for lift in lifts)
    pitch = -14 * sum(bump(t, lift - 0.06, lift + 0.6 * air) for lift in lifts)
    ankle = turned(yaw=heading).apply(columns(sign * (9.5 + 1.5 * lifted), ANKLE_HEIGHT + 4.5 * lifted, -4.0))
    yaw = heading + sign * 9
    return Foot(ankle + turned(yaw=yaw).apply(rolled_ankle(pitch)), yaw, pitch, -pitch)


CLIPS: dict[str, Callable[[], Motion]] = {
    clip.__name__: clip for clip in (walk, clap, hands_on_hips, squat, wave, turn)
}
