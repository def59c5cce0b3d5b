"""The sample clips on two feet, each made by a function. Angles in degrees, lengths in cm, times in s."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    ARM_LENGTH,
    AT_REST,
    FPS,
    OFFSET,
    SHANK,
    SIDES,
    SIGN,
    STANDING,
    THIGH,
    Arm,
    Foot,
    Track,
    Trunk,
    bump,
    clock,
    columns,
    cosine,
    eased,
    hand,
    held,
    motion,
    on_side,
    reaching_arm,
    rolled_ankle,
    seen_from,
    shrug,
    swung_arm,
    trunk,
    turned,
)
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from distretarget import Motion


def hanging_arm(t: Track, late: float = 0.0) -> Arm:
    """A hanging arm that moves slightly with the breath."""
    breath = cosine(t, 3.4, late)
    elbow = 17 + 1.2 * cosine(t, 3.4, late + 0.3)
    flexion, abduction = -3 + 0.8 * breath, 9 + 0.6 * breath
    return swung_arm(flexion=flexion, abduction=abduction, elbow=elbow, roll=18, pronation=8, wrist=8)


def planted_feet(t: Track, width: float, toe_out: float) -> dict[str, Foot]:
    """Both feet resting on the floor, the ankles `width` apart, each foot turned out by `toe_out`."""
    ankle = np.tile([width / 2, ANKLE_HEIGHT, -4.0], (len(t), 1))
    return {side: Foot(on_side(side, ankle), on_side(side, turned(yaw=toe_out))) for side in SIDES}


def standing_trunk(t: Track, shift: Track, look: Rotation) -> Trunk:
    """A trunk that breathes over resting feet, with the hips `shift` to the left."""
    shift = shift + 0.4 * cosine(t, 4.7, 1.0)
    position = columns(shift, STANDING - 0.4 - 0.012 * shift**2, 0.3 * cosine(t, 4.1))
    pelvis = turned(pitch=3.0, yaw=0.25 * shift, roll=0.55 * shift)
    bend = turned(pitch=1.5 + 0.7 * cosine(t, 3.4), yaw=-0.3 * shift, roll=-0.75 * shift)
    return trunk(position, pelvis, bend, look)


def clap() -> Motion:
    """Six claps in front of the chest; as the hands meet, the wrists are 4 % of the arm's length apart."""
    t = clock(4.6)
    first, period = 1.1, 0.45
    last = first + 5 * period
    clapping = held(t, first - 0.36, first - 0.04, last + 0.04, last + 0.36)
    away = 1 - clapping * (0.5 + 0.5 * cosine(t, period, first))
    attention = held(t, 0.3, 1.0, 3.6, 4.4)
    look = turned(pitch=3 + attention * (2.5 + 0.8 * cosine(t, period, first)))
    body = standing_trunk(t, eased(t, [0.4, 1.5, 3.4, 4.4], [0, 1.5, -1.0, 0]), look)
    raised = held(t, 0.15, 0.95, last + 0.1, last + 0.95)
    wrist = columns(0.02 * ARM_LENGTH + 18 * away, -11 - 2 * away, 33 - 2 * away)
    palm = hand(fingers=columns(0.25 * away, 0.72, 0.69), palm=columns(-1, 0.12 * away, 0.3 * away))
    arms = {}
    for side in SIDES:
        position, rotation = chest = seen_from(side, body.chest())
        pole = rotation.apply([0.5, -0.85, -0.25])
        arm = reaching_arm(chest, shrug(1.0, 8 - 5 * away), position + rotation.apply(wrist), pole, rotation * palm)
        arms[side] = hanging_arm(t).blended(arm, raised)
    return motion(body, arms, planted_feet(t, width=19, toe_out=9))


def hands_on_hips() -> Motion:
    """The hands go to the hips, the body sways slowly, and the hands go back."""
    t = clock(5.6)
    shift = 3.2 * eased(t, [1.0, 2.1, 3.4, 4.6], [0, 1, -1, 0])
    body = standing_trunk(t, shift, turned(pitch=2, yaw=-1.2 * shift, roll=0.4 * shift))
    on_hips = held(t, 0.3, 1.35, 4.2, 5.3)
    palm = hand(fingers=[-0.08, -0.5, 0.86], palm=[-1.0, -0.1, -0.1])
    arms = {}
    for side in SIDES:
        chest, (position, rotation) = seen_from(side, body.chest()), seen_from(side, body.pelvis())
        wrist = position + rotation.apply(columns(20.0 + 48 * on_hips * (1 - on_hips), 10.0, -5.0))
        arm = reaching_arm(chest, shrug(4.0, -4.0), wrist, chest[1].apply([0.75, 0.0, -0.66]), rotation * palm)
        arms[side] = hanging_arm(t).blended(arm, on_hips)
    return motion(body, arms, planted_feet(t, width=24, toe_out=11))


def squat() -> Motion:
    """Two squats with the arms held out for balance; the knees bend in proportion to `depth`, at 1 thighs are level."""
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
    ankle = feet["Left"].ankle
    knee = np.radians(13 + 97 * depth)
    span = np.sqrt(THIGH**2 + SHANK**2 + 2 * THIGH * SHANK * np.cos(knee))
    pelvis = turned(pitch=3 + 27 * depth)
    hip = pelvis.apply(OFFSET["LeftHip"])
    forward = ankle[:, 2] + 3.5 - 24 * depth
    sideways, behind = ankle[:, 0] - hip[:, 0], forward + hip[:, 2] - ankle[:, 2]
    height = ankle[:, 1] + np.sqrt(span**2 - sideways**2 - behind**2) - hip[:, 1]
    bend = turned(pitch=2 + 12 * depth + 0.7 * cosine(t, 3.4))
    body = trunk(columns(0.0, height, forward), pelvis, bend, turned(pitch=2 + 12 * depth))
    return motion(body, dict.fromkeys(SIDES, arm), feet)


def wave() -> Motion:
    """The right arm waves five times."""
    t = clock(5.0)
    waving = held(t, 0.95, 1.35, 3.3, 3.75)
    swing, late = (waving * cosine(t, 0.5, top) for top in (1.225, 1.285))
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
    """A turn to the left on the spot through 360 degrees at constant speed, in ten small steps."""
    t = clock(5.6)
    start, step, count = 0.45, 0.46, 10
    lifts = start + step * np.arange(count)
    end = start + step * count
    busy = held(t, start - 0.3, start + 0.2, end, end + 0.4)
    weight = sum(bump(t, lift - 0.1, lift + step + 0.1) for lift in lifts[1::2])
    weight = weight - sum(bump(t, lift - 0.1, lift + step + 0.1) for lift in lifts[::2])
    angle = np.cumsum(held(t, start - 0.3, start + 0.5, end - 0.3, end + 0.5))
    facing = turned(yaw=360 * angle / angle[-1])
    height = STANDING - 0.6 - 1.7 * busy + 0.8 * np.abs(weight)
    body = trunk(
        facing.apply(columns(2.3 * weight, height, -0.5)),
        facing * turned(pitch=3.5, roll=-2 * weight),
        turned(pitch=2.0, yaw=3 * busy, roll=2.2 * weight),
        facing * turned(pitch=2 + 2 * busy, yaw=11 * busy),
    )
    arms = {
        side: swung_arm(
            flexion=-3 + 4 * sign * weight,
            abduction=9 + 4 * busy,
            elbow=17 + 6 * busy + 2 * sign * weight,
            roll=18,
            pronation=8,
            wrist=8 + cosine(t, 3.4),
        )
        for side, sign in SIGN.items()
    }
    feet = {"Left": _stepping_foot(t, 1, lifts[::2], step), "Right": _stepping_foot(t, -1, lifts[1::2], step)}
    return motion(body, arms, feet)


def _stepping_foot(t: Track, sign: int, lifts: Sequence[float], step: float) -> Foot:
    """A foot that steps around the middle of the body; each lift turns it by the same angle."""
    air = 0.9 * step
    heading = sum(eased(t, [lift + 0.03, lift + air], [0, 360 / len(lifts)]) for lift in lifts)
    lifted = sum(bump(t, lift, lift + air) for lift in lifts)
    pitch = -14 * sum(bump(t, lift - 0.06, lift + 0.6 * air) for lift in lifts)
    ankle = turned(yaw=heading).apply(columns(sign * (9.5 + 1.5 * lifted), ANKLE_HEIGHT + 4.5 * lifted, -4.0))
    yaw = heading + sign * 9
    return Foot(ankle + turned(yaw=yaw).apply(rolled_ankle(pitch)), turned(-pitch, yaw), -pitch)


# ---- the walk; a foot's cycle starts at its heel strike, and a phase is a fraction of that cycle

STRIDE = 116.0  # how far a foot moves in a cycle [cm]
CYCLE = 62 / FPS  # [s]
CYCLES = 4
TOE_OUT = 5.0  # [degrees]
FLAT, HEEL_OFF, TOE_OFF = 0.10, 0.33, 0.61  # phases: foot flat on the floor, heel rises, toes leave the floor

ROLL_OFF = make_interp_spline(
    [HEEL_OFF, 0.43, 0.52, TOE_OFF, 0.69, 0.82, 0.93, 1.0, 1 + FLAT],
    [0.0, -7.0, -25.0, -55.0, -59.0, -18.0, 14.0, 19.0, 0.0],
    k=5,
    bc_type=(AT_REST, AT_REST),
)
"""The foot's pitch from heel-off until the foot is flat again [degrees]."""


def walk() -> Motion:
    """Eight steps at constant speed."""
    t = clock(CYCLES * CYCLE)
    phase = t / CYCLE
    once, twice = partial(cosine, phase, 1.0), partial(cosine, phase, 0.5)
    forward = STRIDE * (phase - 0.25) + 4.0 + 0.8 * twice(0.30)
    hips = columns(1.9 * once(0.30), STANDING - 2.0 + 1.2 * twice(0.25), forward)
    tilt = 3.2 * once(0.14)
    pelvis = turned(pitch=4 + twice(0.05), yaw=-4.5 * once(0.0), roll=tilt)
    bend = turned(pitch=0.5 + twice(0.15), yaw=8.5 * once(0.03), roll=-1.15 * tilt)
    body = trunk(hips, pelvis, bend, turned(pitch=2 + 0.8 * twice(0.2), yaw=0.8 * once(0.0)))
    arms = {"Left": _walking_arm(t, 0.5 * CYCLE), "Right": _walking_arm(t, 0.0)}
    return motion(body, arms, {"Left": _walking_foot(t, "Left", 0.0), "Right": _walking_foot(t, "Right", 0.5)})


def _walking_arm(t: Track, front: float) -> Arm:
    """An arm that swings once per cycle and is farthest forward at the time `front` [s]."""
    swing = cosine(t, CYCLE, front)
    return swung_arm(
        flexion=-2 + 19 * swing,
        abduction=8 - 1.5 * swing,
        elbow=25 + 11 * cosine(t, CYCLE, front + 0.05 * CYCLE),
        roll=20 + 6 * swing,
        pronation=6,
        wrist=6 + 4 * cosine(t, CYCLE, front + 0.12 * CYCLE),
    )


def _walking_foot(t: Track, side: str, ahead: float) -> Foot:
    """A foot that rolls on the floor and swings; `ahead` is its phase at the start."""
    strides, phase = np.divmod(t / CYCLE + ahead, 1.0)
    pitch = _pitch(phase)
    swings = phase[:, None] > TOE_OFF
    ankle = np.where(swings, _swing_ankle()(np.maximum(phase, TOE_OFF)), _stance_ankle(pitch))
    ankle = ankle + columns(4.6, ANKLE_HEIGHT, (strides - ahead) * STRIDE)
    bent, slope, curve = (-float(ROLL_OFF(TOE_OFF, nu)) for nu in range(3))  # toes, as they leave the floor
    conditions = [(1, slope), (2, curve)], AT_REST
    swing = make_interp_spline([TOE_OFF, 0.70, 0.82, 0.92, 1.0], [bent, 52.0, 18.0, 3.0, 0.0], k=5, bc_type=conditions)
    rising = np.where(phase > FLAT, -pitch, 0.0)  # flat on the floor while the heel rises
    toes = np.where(phase > TOE_OFF, swing(np.maximum(phase, TOE_OFF)), rising)
    return Foot(on_side(side, ankle), turned(-pitch, SIGN[side] * TOE_OUT), toes)


def _pitch(phase: Track) -> Track:
    """The foot's pitch [degrees]: 0 in mid-stance, else by `ROLL_OFF`."""
    late = np.where(phase < FLAT, phase + 1, phase)
    return np.where(late > HEEL_OFF, ROLL_OFF(np.maximum(late, HEEL_OFF)), 0.0)


def _stance_ankle(pitch: Track) -> Track:
    """(frames, 3), how far the left ankle moves while the foot rolls on the floor."""
    return turned(yaw=TOE_OUT).apply(rolled_ankle(pitch))


def _swing_ankle() -> Callable[[Track], Track]:
    """(frames, 3) by phase, the left ankle's path from toe-off to heel strike, which continues the stance smoothly."""
    step = 1e-3
    values, conditions = [], []
    for phase, landed in ((TOE_OFF, 0.0), (1.0, STRIDE)):
        around = (phase + np.array([-step, 0.0, step])) % 1
        before, at, after = _stance_ankle(_pitch(around))
        values.append(at + np.array([0.0, 0.0, landed]))
        conditions.append([(1, (after - before) / (2 * step)), (2, (after - 2 * at + before) / step**2)])
    values.insert(1, np.array([0.8, 9.0, 0.5 * STRIDE - 2.0]))
    return make_interp_spline([TOE_OFF, 0.79, 1.0], values, k=5, bc_type=tuple(conditions))


CLIPS: dict[str, Callable[[], Motion]] = {
    clip.__name__: clip for clip in (walk, clap, hands_on_hips, squat, wave, turn)
}
