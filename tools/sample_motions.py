"""The six sample clips, each a function that returns its motion. Angles in degrees, lengths in cm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from sample_body import (
    ANKLE_HEIGHT,
    BALL,
    HEEL,
    LEG_LENGTH,
    OFFSET,
    SIDES,
    Arm,
    Foot,
    Points,
    Trunk,
    flipped,
    hand,
    mirrored,
    motion,
    reaching_arm,
    shrug,
    swung_arm,
    trunk,
    turned,
)
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion

FPS = 60
ARM_LENGTH = 27.3 + 25.8
STANDING = ANKLE_HEIGHT + 0.9965 * LEG_LENGTH - OFFSET["LeftHip"][1]


def eased(times: ArrayLike, keys: Sequence[float], values: Sequence[float]) -> Points:
    """A track that rests at each key and moves between them with least jerk."""
    x = np.asarray(times, float)
    track = np.full(x.shape, float(values[0]))
    for start, end, before, after in zip(keys, keys[1:], values, values[1:], strict=False):
        s = np.clip((x - start) / (end - start), 0.0, 1.0)
        track += (after - before) * s**3 * (10 - 15 * s + 6 * s**2)
    return track


def columns(*tracks: ArrayLike) -> Points:
    """(frames, 3) from three tracks or numbers."""
    return np.stack(np.broadcast_arrays(*tracks), axis=-1).astype(float)


def clock(seconds: float) -> Points:
    """The times of the frames [s]."""
    return np.arange(round(seconds * FPS) + 1) / FPS


def cosine(t: Points, period: float, offset: float = 0.0) -> Points:
    """A wave of amplitude 1 with its top at `offset`."""
    return np.cos(2 * np.pi * (t - offset) / period)


def hanging_arm(t: Points, late: float = 0.0) -> Arm:
    """An arm at rest that stirs with the breath."""
    breath = cosine(t, 3.4, late)
    return swung_arm(
        flexion=-3 + 0.8 * breath,
        abduction=9 + 0.6 * breath,
        elbow=17 + 1.2 * cosine(t, 3.4, late + 0.3),
        roll=18,
        pronation=8,
        wrist=8,
    )


def planted_feet(frames: int, width: float, toe_out: float) -> dict[str, Foot]:
    """Both feet at rest on the floor, the ankles `width` apart."""
    still = np.zeros(frames)
    return {
        side: Foot(
            columns(still + sign * width / 2, ANKLE_HEIGHT, -4.0), still + sign * toe_out, still, still
        )
        for side, sign in zip(SIDES, (1, -1), strict=True)
    }


def standing_trunk(
    t: Points, shift: ArrayLike = 0.0, look: Rotation | None = None, lean: float = 0.0
) -> Trunk:
    """A trunk that breathes over feet at rest.

    The pelvis goes sideways by `shift` and tilts a little, the chest stays upright, the head looks ahead or at
    `look`, and `lean` bends the chest forward.
    """
    breath = cosine(t, 3.4)
    shift = np.asarray(shift) + 0.4 * cosine(t, 4.7, 1.0)
    drop = 0.012 * shift**2
    pelvis = turned(pitch=3.0, yaw=0.25 * shift, roll=0.55 * shift)
    bend = turned(pitch=1.5 + lean + 0.7 * breath, yaw=-0.3 * shift, roll=-0.75 * shift)
    head = turned(pitch=2 + 0.5 * cosine(t, 3.4, 0.8), yaw=0 * t)
    return trunk(
        columns(shift, STANDING - 0.4 - drop, 0.3 * cosine(t, 4.1)),
        pelvis,
        bend,
        head if look is None else look,
    )


def mirrored_chest(body: Trunk) -> tuple[Points, Rotation]:
    """The chest as the right arm sees it, by the left one's rules."""
    position, rotation = body.chest()
    return flipped(position), mirrored(rotation)


def chests(body: Trunk) -> dict[str, tuple[Points, Rotation]]:
    """The chest for each arm."""
    return {"Left": body.chest(), "Right": mirrored_chest(body)}


# Walking: one cycle of a foot, in parts of a cycle from its heel strike.

STRIDE = 116.0
CYCLE = 62 / FPS
CYCLES = 4
FLAT, HEEL_OFF, TOE_OFF = 0.10, 0.33, 0.61
ROLL_OFF = make_interp_spline(
    [HEEL_OFF, 0.43, 0.52, TOE_OFF, 0.69, 0.82, 0.93, 1.0, 1 + FLAT],
    [0.0, -7.0, -25.0, -55.0, -59.0, -18.0, 14.0, 19.0, 0.0],
    k=5,
    bc_type=([(1, 0.0), (2, 0.0)], [(1, 0.0), (2, 0.0)]),
)


def _foot_pitch(phase: Points) -> Points:
    """Flat from FLAT to HEEL_OFF, then over the ball, through the swing and down from the heel."""
    phase = np.where(phase < FLAT, phase + 1, phase)
    return np.where(phase > HEEL_OFF, ROLL_OFF(np.maximum(phase, HEEL_OFF)), 0.0)


def _rolled_ankle(pitch: Points) -> Points:
    """(..., 3), the ankle over a foot that rolls on its heel or its ball; the flat foot's ankle is at zero."""
    pivot = np.where(pitch[..., None] > 0, HEEL, BALL)
    return pivot - turned(pitch=-pitch).apply(pivot)


def _swing_ankle() -> Callable[[Points], Points]:
    """The ankle between toe-off and heel strike, (..., 2) forward and up, joined smoothly to the stance."""
    step = 1e-3

    def ends(phase: float, ahead: float) -> tuple[Points, Points, Points]:
        before, at, after = (
            _rolled_ankle(_foot_pitch(np.array([(phase + d) % 1])))[0] for d in (-step, 0, step)
        )
        value, velocity = at + (0, 0, ahead), (after - before) / (2 * step)
        return value[[2, 1]], velocity[[2, 1]], (after - 2 * at + before)[[2, 1]] / step**2

    start, end = ends(TOE_OFF, 0.0), ends(1.0, STRIDE)
    middle = [[0.5 * STRIDE - 2.0, 10.0]]
    knots = [TOE_OFF, 0.79, 1.0]
    conditions = [[(1, p[1]), (2, p[2])] for p in (start, end)]
    return make_interp_spline(knots, [start[0], *middle, end[0]], k=5, bc_type=tuple(conditions))


def _walking_foot(t: Points, side: str) -> Foot:
    cycles = t / CYCLE + (0.0 if side == "Left" else 0.5)
    count = np.floor(cycles)
    phase = cycles - count
    pitch = _foot_pitch(phase)
    stance = _rolled_ankle(pitch)[:, [2, 1]]
    swing = _swing_ankle()(np.maximum(phase, TOE_OFF))
    forward, up = np.where(phase[:, None] > TOE_OFF, swing, stance).T
    sign = 1 if side == "Left" else -1
    start = 0.0 if side == "Left" else -0.5 * STRIDE
    out = 4.6 + 0.8 * _bump(phase, TOE_OFF, 1.0)
    toe = np.where((phase > FLAT) & (phase <= TOE_OFF), -pitch, 0.0)
    toe = np.where(phase > TOE_OFF, TOE_RETURN(np.maximum(phase, TOE_OFF)), toe)
    ankle = columns(sign * out, up + ANKLE_HEIGHT, forward + start + count * STRIDE)
    return Foot(ankle, np.full(len(t), sign * 5.0), pitch, toe)


def _toe_return() -> Callable[[Points], Points]:
    """How the toes, bent up at toe-off, straighten during the swing."""
    slope, curve = (-float(ROLL_OFF(TOE_OFF, nu)) for nu in (1, 2))
    return make_interp_spline(
        [TOE_OFF, 0.70, 0.82, 0.92, 1.0],
        [-float(ROLL_OFF(TOE_OFF)), 50.0, 16.0, 3.0, 0.0],
        k=5,
        bc_type=([(1, slope), (2, curve)], [(1, 0.0), (2, 0.0)]),
    )


TOE_RETURN = _toe_return()


def walk() -> Motion:
    """Eight steps at an even speed."""
    t = clock(CYCLES * CYCLE)
    wave, steps = partial(cosine, t, CYCLE), partial(cosine, t, CYCLE / 2)
    forward = STRIDE * (t / CYCLE - 0.25) + 2.5 + 0.8 * steps(0.30 * CYCLE)
    hips = columns(1.9 * wave(0.30 * CYCLE), STANDING - 2.2 + 1.7 * steps(0.25 * CYCLE), forward)
    list_ = 3.2 * wave(0.14 * CYCLE)
    yaw = -4.5 * wave(0.0)
    pelvis = turned(pitch=4 + steps(0.05 * CYCLE), yaw=yaw, roll=list_)
    bend = turned(pitch=0.5 + steps(0.15 * CYCLE), yaw=8.5 * wave(0.03 * CYCLE), roll=-1.15 * list_)
    body = trunk(hips, pelvis, bend, turned(pitch=2 + 0.8 * steps(0.2 * CYCLE), yaw=0.8 * wave(0.0)))
    arms = {side: _walking_arm(t, 0.5 * CYCLE if side == "Left" else 0.0) for side in SIDES}
    return motion(body, arms, {side: _walking_foot(t, side) for side in SIDES})


def _walking_arm(t: Points, front: float) -> Arm:
    """An arm that swings through the cycle and is foremost at the time `front`."""
    swing = cosine(t, CYCLE, front)
    return swung_arm(
        flexion=-2 + 19 * swing,
        abduction=8 - 1.5 * swing,
        elbow=25 + 11 * cosine(t, CYCLE, front + 0.05 * CYCLE),
        roll=20 + 6 * swing,
        pronation=6,
        wrist=6 + 4 * cosine(t, CYCLE, front + 0.12 * CYCLE),
    )


def clap() -> Motion:
    """Six claps in front of the chest."""
    t = clock(4.6)
    first, period, claps = 1.1, 0.45, 6
    last = first + (claps - 1) * period
    clapping = eased(t, [first - 0.36, first - 0.04, last + 0.04, last + 0.36], [0, 1, 1, 0])
    away = 1 - clapping * (0.5 + 0.5 * cosine(t, period, first))
    body = standing_trunk(
        t,
        shift=eased(t, [0.4, 1.5, 3.4, 4.4], [0, 1.5, -1.0, 0]),
        look=turned(
            pitch=3 + 2.5 * eased(t, [0.3, 1.0, 3.6, 4.4], [0, 1, 1, 0]) + 0.8 * cosine(t, period, first)
        ),
    )
    raised = eased(t, [0.15, 0.95, last + 0.1, last + 0.95], [0, 1, 1, 0])
    arms = {}
    for side, seen in chests(body).items():
        hanging = hanging_arm(t)
        arms[side] = hanging.blended(_clapping_arm(seen, away), raised)
    return motion(body, arms, planted_feet(len(t), 19, 9))


def _clapping_arm(chest: tuple[Points, Rotation], away: Points) -> Arm:
    """An arm with the palm to the other hand: 4 % of the arm's length between the wrists at `away` 0."""
    position, rotation = chest
    half = 0.02 * ARM_LENGTH + 18 * away
    wrist = position + rotation.apply(columns(half, -8 - 2.0 * away, 29 - 3 * away))
    pole = rotation.apply([0.75, -0.62, -0.25])
    fingers = columns(0.25 * away, 0.72, 0.69)
    palm = columns(-1, 0.12 * away, 0.3 * away)
    return reaching_arm(chest, shrug(1.0, 8 - 5 * away), wrist, pole, rotation * hand(fingers, palm))


def hands_on_hips() -> Motion:
    """Hands to the hips, a slow sway, and back."""
    t = clock(5.6)
    shift = 3.2 * eased(t, [1.0, 2.1, 3.4, 4.6], [0, 1, -1, 0])
    body = standing_trunk(t, shift, turned(pitch=2, yaw=-1.2 * shift, roll=0.4 * shift))
    pelvis = body.local["Hips"]
    held = eased(t, [0.3, 1.35, 4.2, 5.3], [0, 1, 1, 0])
    views = {"Left": (body.position, pelvis), "Right": (flipped(body.position), mirrored(pelvis))}
    arms = {
        side: hanging_arm(t).blended(_arm_on_hip(chest, *views[side]), held)
        for side, chest in chests(body).items()
    }
    return motion(body, arms, planted_feet(len(t), 24, 11))


def _arm_on_hip(chest: tuple[Points, Rotation], hips: Points, pelvis: Rotation) -> Arm:
    wrist = hips + pelvis.apply([16.5, 5.0, -3.0])
    pole = chest[1].apply([0.9, 0.0, -0.42])
    palm = pelvis * hand([-0.22, -0.52, 0.82], [-1.0, -0.05, -0.2])
    return reaching_arm(chest, shrug(4.0, -4.0), wrist, pole, palm)


def squat() -> Motion:
    """Two squats with the arms held out for balance."""
    t = clock(5.6)
    keys = [0.4, 1.6, 1.8, 2.75, 3.0, 4.2, 4.4, 5.35]
    depth = eased(t, keys, [0, 1, 1, 0, 0, 1, 1, 0])
    feet = planted_feet(len(t), 30, 16)
    body = _squatting_trunk(t, depth, feet["Left"].ankle)
    arm = swung_arm(
        flexion=-3 + 116 * depth,
        abduction=9 - 4 * depth,
        elbow=17 - 3 * depth + 1.2 * cosine(t, 3.4),
        roll=18 + 10 * depth,
        pronation=8 + 30 * depth,
        wrist=8 - 6 * depth,
    )
    return motion(body, dict.fromkeys(SIDES, arm), feet)


def _squatting_trunk(t: Points, depth: Points, ankle: Points) -> Trunk:
    """The trunk of which the knees bend by as many degrees as `depth` says, from 0 for standing to 1."""
    knee = np.radians(13 + 97 * depth)
    reach = np.sqrt(43.5**2 + 45.3**2 + 2 * 43.5 * 45.3 * np.cos(knee))
    lean = 3 + 27 * depth
    pelvis = turned(pitch=lean, yaw=0 * t)
    hip = pelvis.apply(OFFSET["LeftHip"])
    back = -0.5 - 22 * depth
    forward = back + 4.0 + ankle[:, 2]
    rise = np.sqrt(reach**2 - (ankle[:, 0] - hip[:, 0]) ** 2 - (forward + hip[:, 2] - ankle[:, 2]) ** 2)
    position = columns(0.0, ANKLE_HEIGHT + rise - hip[:, 1], forward)
    bend = turned(pitch=2 + 12 * depth + 0.7 * cosine(t, 3.4), yaw=0 * t)
    return trunk(position, pelvis, bend, turned(pitch=2 + 12 * depth, yaw=0 * t))


def wave() -> Motion:
    """The right arm waves five times."""
    t = clock(5.0)
    raised = eased(t, [0.3, 1.25, 3.75, 4.75], [0, 1, 1, 0])
    swing = np.sin(2 * np.pi * (t - 1.1) / 0.5) * eased(t, [0.95, 1.35, 3.3, 3.75], [0, 1, 1, 0])
    late = np.sin(2 * np.pi * (t - 1.16) / 0.5) * eased(t, [0.95, 1.35, 3.3, 3.75], [0, 1, 1, 0])
    tilt = eased(t, [0.5, 1.4, 3.6, 4.6], [0, 1, 1, 0])
    body = standing_trunk(t, 2.2 * tilt, turned(pitch=2 + tilt, yaw=-4 * tilt, roll=4 * tilt + 0.5 * swing))
    waving = swung_arm(
        flexion=12,
        abduction=64 + 3 * swing,
        elbow=112 + 9 * swing,
        roll=-74 - 19 * swing,
        pronation=12,
        wrist=-6,
        deviation=9 * late,
    )
    arms = {"Left": hanging_arm(t), "Right": hanging_arm(t, 0.4).blended(waving, raised)}
    return motion(body, arms, planted_feet(len(t), 20, 10))


def turn() -> Motion:
    """A turn to the left on the spot through 360 degrees, in ten small steps."""
    t = clock(5.6)
    start, step, count = 0.45, 0.46, 10
    lifts = start + step * np.arange(count)
    heading = _even_turn(t, start + 0.1, start + step * count + 0.1)
    feet = {
        side: _stepping_foot(t, sign, lifts[first::2], step)
        for side, sign, first in (("Left", 1, 0), ("Right", -1, 1))
    }
    weight = sum(
        (-1 if n % 2 == 0 else 1) * _bump(t, lift - 0.1, lift + step + 0.1) for n, lift in enumerate(lifts)
    )
    busy = eased(t, [start - 0.3, start + 0.2, lifts[-1] + step, lifts[-1] + step + 0.4], [0, 1, 1, 0])
    facing = turned(yaw=heading)
    hips = facing.apply(columns(2.3 * weight, 0, -0.5)) + columns(
        0, STANDING - 0.6 - 1.7 * busy + 0.8 * np.abs(weight), 0
    )
    pelvis = facing * turned(pitch=3.5, roll=-2 * weight)
    bend = turned(pitch=2.0, yaw=3 * busy, roll=2.2 * weight)
    body = trunk(hips, pelvis, bend, facing * turned(pitch=2 + 2 * busy, yaw=11 * busy))
    arms = {"Left": _turning_arm(t, weight, busy), "Right": _turning_arm(t, -weight, busy)}
    return motion(body, arms, feet)


def _bump(t: Points, start: float, end: float) -> Points:
    """From 0 at the start to 1 half-way and back to 0 at the end."""
    s = np.clip((t - start) / (end - start), 0.0, 1.0)
    return np.sin(np.pi * s) ** 4


def _even_turn(t: Points, start: float, end: float) -> Points:
    """Once round, at an even speed between a soft start and a soft end [degrees]."""
    ramp = 0.8
    speed = eased(t, [start - ramp / 2, start + ramp / 2, end - ramp / 2, end + ramp / 2], [0, 1, 1, 0])
    turned_so_far = np.cumsum(speed) - speed[0]
    return 360 * turned_so_far / turned_so_far[-1]


def _turning_arm(t: Points, weight: Points, busy: Points) -> Arm:
    return swung_arm(
        flexion=-3 + 4 * weight,
        abduction=9 + 4 * busy,
        elbow=17 + 6 * busy + 2 * weight,
        roll=18,
        pronation=8,
        wrist=8 + cosine(t, 3.4),
    )


def _stepping_foot(t: Points, sign: int, lifts: Points, step: float) -> Foot:
    """A foot that steps round the middle of the body in even parts of the turn."""
    angle = 360 / len(lifts)
    air = 0.9 * step
    yaw = sum(eased(t, [lift + 0.03, lift + air], [0, angle]) for lift in lifts)
    bump = sum(_bump(t, lift, lift + air) for lift in lifts)
    peel = sum(_bump(t, lift - 0.06, lift + 0.6 * air) for lift in lifts)
    pitch = -14 * peel
    around = turned(yaw=yaw).apply(columns(sign * (9.5 + 1.5 * bump), ANKLE_HEIGHT + 4.5 * bump, -4.0))
    yaw = yaw + sign * 9
    rolled = turned(yaw=yaw).apply(_rolled_ankle(pitch))
    return Foot(around + rolled, yaw, pitch, 0.6 * np.maximum(-pitch, 0))


CLIPS: dict[str, Callable[[], Motion]] = {
    "walk": walk,
    "clap": clap,
    "hands_on_hips": hands_on_hips,
    "squat": squat,
    "wave": wave,
    "turn": turn,
}
