"""The clip of sitting down on the floor and getting up, with both hands on the floor behind the body."""

from __future__ import annotations

import numpy as np
from sample_body import (
    ARM_LENGTH,
    SIDES,
    STANDING,
    WRIST_HEIGHT,
    Arm,
    Place,
    Trunk,
    aimed_arm,
    blend,
    flat_hand,
    hand,
    motion,
    raised_shoulder,
    trunk,
    turned,
    unit,
)
from sample_motions import planted_feet
from sample_supports import Rest, Sample, reached, resting, supports
from sample_tracks import Track, bump, clock, columns, cosine, held

DURATION = 5.0  # [s]
SEAT = Rest(2.1, 3.2, (0.0, 17.0, -52.0))  # of the hips
HAND = Rest(1.95, 3.35, (25.0, WRIST_HEIGHT, -74.0))  # of the left wrist
HAND_YAW = 130.0  # [degrees]


def sit() -> Sample:
    """Sit down on the floor, look around, and get up."""
    t = clock(DURATION)
    feet = planted_feet(t, width=26, toe_out=12)
    body = _trunk(t)
    arm = _arm(t, body.chest())
    whole = [Rest(0.0, DURATION, feet["Left"].ankle[0])]
    hands = [side + name for side in SIDES for name in ("Wrist", "Wrist_End")]
    table = [
        *supports(t, [side + name for side in SIDES for name in ("Ankle", "Toe", "Toe_End")], whole),
        *supports(t, hands, [HAND]),
        *supports(t, ["Hips", "LeftHip", "RightHip"], [SEAT]),
    ]
    return Sample(motion(body, dict.fromkeys(SIDES, arm), feet), tuple(table))


def _trunk(t: Track) -> Trunk:
    seated = held(t, 0.35, SEAT.start, SEAT.end, 4.75)
    back = held(t, 0.3, SEAT.start - 0.1, SEAT.end + 0.1, 4.7)
    x, height, behind = SEAT.place
    stooped = bump(t, 0.4, SEAT.start) + bump(t, SEAT.end, 4.8)
    pelvis = turned(pitch=3 - 33 * seated + 32 * stooped)
    bend = turned(pitch=2 + 3 * seated + 22 * stooped + 0.6 * cosine(t, 3.0))
    position = columns(x, STANDING - 3 + seated * (height - STANDING + 3), back * behind)
    look = turned(pitch=3 + 14 * stooped, yaw=18 * bump(t, 2.0, 3.3))
    return trunk(position, pelvis, bend, look)


def _arm(t: Track, chest: Place) -> Arm:
    """The left arm: it hangs, reaches forward for balance, and goes back to the floor."""
    position, rotation = chest
    forward = np.radians(4 + 70 * (bump(t, 0.3, 1.9) + bump(t, 3.3, 4.8)))
    fingers = unit(columns(0.14, -np.cos(forward), np.sin(forward)))
    wrist = position + rotation.apply(raised_shoulder(fingers) + fingers * 0.95 * ARM_LENGTH)
    free = rotation * hand(fingers, [-1.0, 0.0, 0.0])
    turn = blend(free, flat_hand(HAND_YAW), resting(t, Rest(1.75, 3.5, HAND.place), approach=0.6, leave=0.6))
    wrist = reached(t, wrist, [HAND], approach=0.75, leave=0.75)
    return aimed_arm("Left", chest, (wrist, turn), rotation.apply([0.35, 0.0, -1.0]))
