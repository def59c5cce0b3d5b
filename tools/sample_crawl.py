"""The clip of a crawl on hands and knees: a hand and the knee of the other side move together."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from sample_body import (
    OFFSET,
    SHANK,
    SIDES,
    THIGH,
    WRIST_HEIGHT,
    AimedFoot,
    Trunk,
    aimed_arm,
    flat_hand,
    mirrored,
    motion,
    trunk,
    turned,
    unit,
)
from sample_supports import Rest, Sample, stepped, supports
from sample_tracks import FPS, Track, bump, clock, columns, cosine

STRIDE = 44.0  # how far a hand or a knee moves in a cycle [cm]
CYCLE = 72 / FPS  # [s]
CYCLES = 3
SWING = 0.44  # part of the cycle for which a hand or a knee moves
KNEE_HEIGHT, INSTEP_HEIGHT = 5.5, 6.0  # of knee and ankle that rest on the floor [cm]
INSTEP = 150.0  # turn of a foot whose back lies on the floor, from the standing foot [degrees]
HAND_AHEAD = 44.0  # of the wrist before the knee of the same side, both in the middle of their stance [cm]


def crawl() -> Sample:
    """Three cycles of a crawl."""
    t = clock(CYCLES * CYCLE)
    knees = {side: _rests(t, 0.5 * (side == "Right"), _outward(side, 9.5), KNEE_HEIGHT, 0.0) for side in SIDES}
    hands = {side: _rests(t, 0.5 * (side == "Left"), _outward(side, 19.0), WRIST_HEIGHT, HAND_AHEAD) for side in SIDES}
    below = {side: stepped(t, knees[side], arc=(0.0, 0.0, 0.0)) for side in SIDES}
    body = _trunk(t, below)
    arms = {}
    for side in SIDES:
        wrist = stepped(t, hands[side], arc=(0.0, 7.0, 0.0))
        palm = flat_hand(12.0) if side == "Left" else mirrored(flat_hand(12.0))
        arms[side] = aimed_arm(side, body.chest(), (wrist, palm), elbow=[_outward(side, 0.35), 0.3, -1.0])
    legs = {side: _leg(t, body.hip(side), below[side], knees[side]) for side in SIDES}
    table = []
    for side in SIDES:
        table += supports(t, [side + name for name in ("Knee", "Ankle", "Toe", "Toe_End")], knees[side])
        table += supports(t, [side + "Wrist", side + "Wrist_End"], hands[side])
    return Sample(motion(body, arms, legs), tuple(table))


def _outward(side: str, x: float) -> float:
    return x if side == "Left" else -x


def _rests(t: Track, late: float, x: float, height: float, ahead: float) -> list[Rest]:
    """Where a hand or a knee rests in each cycle; `late` is when its first swing begins, as a part of the cycle."""
    rests = []
    for cycle in range(-2, CYCLES + 1):
        start, end = cycle + late + SWING, cycle + late + 1
        if end >= 0 and start * CYCLE <= t[-1]:
            rests.append(Rest(start * CYCLE, end * CYCLE, (x, height, ahead + STRIDE * (start + end) / 2)))
    return rests


def _trunk(t: Track, below: dict[str, Track]) -> Trunk:
    """A trunk that moves forward at constant speed, each hip as far from its knee as the thigh is long."""
    phase = t / CYCLE
    sway = cosine(phase, 1.0, 0.72)
    pitch, yaw = 83 + 0.8 * cosine(phase, 0.5, 0.1), 4 * cosine(phase, 1.0, 0.5)
    ahead = STRIDE * phase + 4.0
    height, roll = np.full(len(t), 50.0), np.zeros(len(t))
    for _ in range(60):
        position = columns(1.6 * sway, height, ahead)
        pelvis = turned(pitch=0.0, yaw=yaw) * turned(roll=roll) * turned(pitch=pitch)
        rise = {}
        for side in SIDES:
            hip = position + pelvis.apply(OFFSET[side + "Hip"])
            across = np.sum((hip - below[side])[:, [0, 2]] ** 2, axis=1)
            rise[side] = below[side][:, 1] + np.sqrt(THIGH**2 - across) - hip[:, 1]
        height = height + (rise["Left"] + rise["Right"]) / 2
        roll = roll + np.degrees((rise["Left"] - rise["Right"]) / (2 * OFFSET["LeftHip"][0]))
    bend = turned(pitch=8.0, yaw=-2 * yaw)
    return trunk(position, pelvis, bend, turned(pitch=48.0, yaw=0.4 * yaw))


def _leg(t: Track, hip: Track, below: Track, rests: list[Rest]) -> AimedFoot:
    """A leg that kneels, and slides forward with its knee and its foot a little over the floor."""
    lift = sum(bump(t, before.end, after.start) for before, after in pairwise(rests))
    up = columns(0.0, lift, 0.0)
    knee = hip + THIGH * unit(below + 2.5 * up - hip)
    level = np.sqrt(SHANK**2 - (INSTEP_HEIGHT - KNEE_HEIGHT) ** 2)
    behind = below + np.array([0.0, INSTEP_HEIGHT - KNEE_HEIGHT, -level])
    ankle = knee + SHANK * unit(behind + 3.0 * up - knee)
    return AimedFoot(ankle, turned(pitch=INSTEP - 4 * lift), np.zeros(len(t)), knee - hip)
