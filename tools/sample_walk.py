"""The walking clip. A foot's cycle starts at its heel strike; a phase is a fraction of that cycle."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    SIDES,
    STANDING,
    Arm,
    Foot,
    motion,
    rolled_ankle,
    swung_arm,
    trunk,
    turned,
)
from sample_tracks import FPS, Track, clock, columns, cosine
from scipy.interpolate import make_interp_spline

from distretarget.motion import Motion

STRIDE = 116.0  # how far a foot moves in a cycle [cm]
CYCLE = 62 / FPS  # [s]
CYCLES = 4
TOE_OUT = 5.0  # [degrees]
FLAT, HEEL_OFF, TOE_OFF = 0.10, 0.33, 0.61  # phases: foot flat on the floor, heel rises, toes leave the floor
AT_REST = [(1, 0.0), (2, 0.0)]  # ends of a spline without speed and acceleration

Curve = Callable[[Track], Track]

ROLL_OFF = make_interp_spline(
    [HEEL_OFF, 0.43, 0.52, TOE_OFF, 0.69, 0.82, 0.93, 1.0, 1 + FLAT],
    [0.0, -7.0, -25.0, -55.0, -59.0, -18.0, 14.0, 19.0, 0.0],
    k=5,
    bc_type=(AT_REST, AT_REST),
)
"""The foot's pitch from heel-off until the foot is flat again [degrees]."""


def _toe_return() -> Curve:
    """The toes' bend during the swing, from bent up at toe-off to straight [degrees]."""
    bent, slope, curve = (-float(ROLL_OFF(TOE_OFF, nu)) for nu in range(3))
    return make_interp_spline(
        [TOE_OFF, 0.70, 0.82, 0.92, 1.0],
        [bent, 52.0, 18.0, 3.0, 0.0],
        k=5,
        bc_type=([(1, slope), (2, curve)], AT_REST),
    )


def _stance_ankle(pitch: Track) -> Track:
    """(frames, 3), how far the left ankle moves while the foot rolls on the floor."""
    return turned(yaw=TOE_OUT).apply(rolled_ankle(pitch))


def _swing_ankle() -> Curve:
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


def _pitch(phase: Track) -> Track:
    """The foot's pitch [degrees]: 0 in mid-stance, else by `ROLL_OFF`."""
    late = np.where(phase < FLAT, phase + 1, phase)
    return np.where(late > HEEL_OFF, ROLL_OFF(np.maximum(late, HEEL_OFF)), 0.0)


def _toes(phase: Track, pitch: Track) -> Track:
    """The toes' bend [degrees]: it keeps them flat on the floor while the heel rises."""
    rising = np.where(phase > FLAT, -pitch, 0.0)
    return np.where(phase > TOE_OFF, _toe_return()(np.maximum(phase, TOE_OFF)), rising)


def _foot(t: Track, side: str) -> Foot:
    sign, ahead = (1, 0.0) if side == "Left" else (-1, 0.5)
    strides, phase = np.divmod(t / CYCLE + ahead, 1.0)
    pitch = _pitch(phase)
    swings = phase[:, None] > TOE_OFF
    ankle = np.where(swings, _swing_ankle()(np.maximum(phase, TOE_OFF)), _stance_ankle(pitch))
    ankle = ankle + columns(4.6, ANKLE_HEIGHT, (strides - ahead) * STRIDE)
    return Foot(ankle * (sign, 1, 1), np.full(len(t), sign * TOE_OUT), pitch, _toes(phase, pitch))


def _arm(t: Track, front: float) -> Arm:
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
    arms = {"Left": _arm(t, 0.5 * CYCLE), "Right": _arm(t, 0.0)}
    return motion(body, arms, {side: _foot(t, side) for side in SIDES})
