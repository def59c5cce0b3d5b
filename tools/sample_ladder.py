"""The clip of steps up a ladder: hands and feet go from rung to rung in turn."""

from __future__ import annotations

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    OFFSET,
    SIDES,
    STANDING,
    Arm,
    Foot,
    Place,
    Trunk,
    aimed_arm,
    flipped,
    hand,
    mirrored,
    motion,
    trunk,
    turned,
)
from sample_supports import FLOOR, WORLD, Rest, Sample, stepped, supports
from sample_tracks import Track, bump, clock, columns, cosine, eased

DURATION = 4.8  # [s]
SPACING = 28.0  # of the rungs [cm]
LADDER = 44.0  # before the middle of the body [cm]
GRIP = np.array([17.0, 1.0, LADDER - 3.0])  # the left wrist, from the height of its rung
FOOTHOLD = np.array([9.0, ANKLE_HEIGHT, LADDER]) - OFFSET["LeftToe"] * (0, 0, 1)  # the left ankle, likewise
FLOOR_PLACE = np.array([9.0, ANKLE_HEIGHT, 10.0])  # the left ankle on the floor
PALM = hand(fingers=[-0.1, 0.55, 0.82], palm=[0.0, -0.82, 0.55])

# Rungs that are held, and when the hand or the foot arrives and leaves [s]; rung 0 is the floor.
HANDS = {
    "Left": ((5, -1.0, 1.45), (7, 2.15, DURATION)),
    "Right": ((5, -1.0, 0.3), (6, 0.8, 3.3), (8, 3.95, DURATION)),
}
FEET = {
    "Left": ((0, -1.0, 0.65), (1, 1.25, 3.1), (3, 3.75, DURATION)),
    "Right": ((0, -1.0, 1.6), (2, 2.3, DURATION)),
}


def climb_ladder() -> Sample:
    """From the floor up to the second and third rung."""
    t = clock(DURATION)
    body = _trunk(t)
    arms, feet, table = {}, {}, []
    for side in SIDES:
        grips = [Rest(start, end, _placed(side, GRIP, rung)) for rung, start, end in HANDS[side]]
        arms[side] = _arm(t, side, body.chest(), grips)
        table += supports(t, [side + "Wrist", side + "Wrist_End"], grips, WORLD)
        steps = [
            Rest(start, end, _placed(side, FOOTHOLD if rung else FLOOR_PLACE, rung)) for rung, start, end in FEET[side]
        ]
        feet[side] = _foot(t, side, steps)
        for rest, (rung, _, _) in zip(steps, FEET[side], strict=True):
            joints = [side + name for name in ("Ankle", "Toe", "Toe_End")]
            table += supports(t, joints, [rest], WORLD if rung else FLOOR)
    return Sample(motion(body, arms, feet), tuple(table))


def _placed(side: str, place: Track, rung: int) -> Track:
    """(3,), a place on the left side, at the height of a rung, or its mirror image."""
    left = place + np.array([0.0, rung * SPACING, 0.0])
    return left if side == "Left" else flipped(left)


def _trunk(t: Track) -> Trunk:
    height = STANDING - 3.0 + eased(t, [1.5, 2.6, 2.95, 4.1], [0, 26.0, 26.0, 52.0])
    aside = eased(t, [0.2, 0.7, 1.4, 1.9, 2.6, 3.2, 3.9, 4.6], [0, -2.5, -2.5, 3.0, 3.0, -3.0, -3.0, 0])
    ahead = eased(t, [0.4, 2.2], [0.0, 5.0])
    pelvis = turned(pitch=6.0, yaw=-0.8 * aside, roll=0.8 * aside)
    bend = turned(pitch=3.0 + 0.5 * cosine(t, 2.4), yaw=1.2 * aside, roll=-aside)
    look = turned(pitch=-14 + 4 * bump(t, 0.5, 1.4) + 10 * bump(t, 2.9, 3.9), yaw=aside)
    return trunk(columns(aside, height, ahead), pelvis, bend, look)


def _arm(t: Track, side: str, chest: Place, grips: list[Rest]) -> Arm:
    wrist = stepped(t, grips, arc=(0.0, 2.0, -9.0))
    palm = PALM if side == "Left" else mirrored(PALM)
    return aimed_arm(side, chest, (wrist, palm), [0.5 if side == "Left" else -0.5, -1.0, -0.2])


def _foot(t: Track, side: str, steps: list[Rest]) -> Foot:
    sign = 1 if side == "Left" else -1
    still = np.zeros(len(t))
    return Foot(stepped(t, steps, arc=(sign * 2.0, 4.0, -14.0)), still + sign * 14.0, still, still)
