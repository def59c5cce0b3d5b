"""The clip of a hand on a wall: the palm stays while the body sways, and a foot steps back and forth."""

from __future__ import annotations

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    ARM_LENGTH,
    SIDES,
    STANDING,
    Arm,
    Foot,
    Place,
    Trunk,
    aimed_arm,
    blend,
    hand,
    mirrored,
    motion,
    raised_shoulder,
    trunk,
    turned,
    unit,
)
from sample_motions import hanging_arm
from sample_supports import WORLD, Rest, Sample, reached, resting, stepped, supports
from sample_tracks import Track, bump, clock, columns, cosine, eased

DURATION = 5.0  # [s]
WALL = 56.0  # before the standing body [cm]
HAND = Rest(1.0, 4.0, (-24.0, 131.0, WALL - 4.0))  # of the right wrist; the palm touches the wall
PALM = mirrored(hand(fingers=[0.12, 1.0, 0.14], palm=[0.0, -0.14, 1.0]))
STEP = -26.0  # of the left foot [cm]


def hand_on_wall() -> Sample:
    """The right hand on a wall; the left foot steps back and forward again."""
    t = clock(DURATION)
    x, z = 10.0, -4.0
    left = [
        Rest(-1.0, 1.5, (x, ANKLE_HEIGHT, z)),
        Rest(2.05, 2.95, (x + 2, ANKLE_HEIGHT, z + STEP)),
        Rest(3.5, DURATION, (x, ANKLE_HEIGHT, z)),
    ]
    right = [Rest(0.0, DURATION, (-x, ANKLE_HEIGHT, z))]
    still = np.zeros(len(t))
    lifted = bump(t, 1.5, 2.05) + bump(t, 2.95, 3.5)
    feet = {
        "Left": Foot(stepped(t, left, arc=(0.0, 5.0, 0.0)), still + 8, -8 * lifted, 8 * lifted),
        "Right": Foot(stepped(t, right, arc=(0.0, 0.0, 0.0)), still - 8, still, still),
    }
    body = _trunk(t)
    arms = {"Left": hanging_arm(t), "Right": _arm(t, body.chest())}
    table = supports(t, ["RightWrist", "RightWrist_End"], [HAND], WORLD)
    for side, rests in zip(SIDES, (left, right), strict=True):
        table += supports(t, [side + name for name in ("Ankle", "Toe", "Toe_End")], rests)
    return Sample(motion(body, arms, feet), tuple(table))


def _trunk(t: Track) -> Trunk:
    aside = eased(t, [0.3, 1.3, 2.2, 2.8, 4.0, 4.8], [0, -4.5, 2.5, -4.5, -2.0, 0])
    ahead = eased(t, [0.3, 1.2, 2.3, 2.8, 3.8, 4.8], [0, 3.0, -7.0, -6.0, 4.0, 0])
    lean = eased(t, [0.3, 1.2, 2.3, 3.8, 4.8], [0, 4.0, 7.0, 5.0, 0])
    position = columns(aside, STANDING - 1.3 - 0.4 * np.abs(eased(t, [1.2, 2.3, 2.8, 3.8], [0, 7, 7, 0])), ahead)
    pelvis = turned(pitch=3 + 0.5 * lean, yaw=0.3 * aside, roll=0.3 * aside)
    bend = turned(pitch=2 + lean + 0.6 * cosine(t, 3.2), yaw=5 * bump(t, 0.4, 4.6), roll=-0.5 * aside)
    return trunk(position, pelvis, bend, turned(pitch=4 + lean, yaw=-6 * bump(t, 0.3, 4.7)))


def _arm(t: Track, chest: Place) -> Arm:
    """The right arm: it hangs, and the hand goes to the wall and back."""
    position, rotation = chest
    fingers = unit(np.array([[0.12, -0.98, 0.08]]))
    shoulder = raised_shoulder(fingers) + fingers * 0.94 * ARM_LENGTH
    hanging = position + rotation.apply(np.repeat(shoulder * (-1, 1, 1), len(t), axis=0))
    free = rotation * mirrored(hand(fingers, [-1.0, 0.0, 0.0]))
    wrist = reached(t, hanging, [HAND], approach=0.75, leave=0.75) - columns(
        0.0, 0.0, 7.0 * (bump(t, 0.25, 1.0) + bump(t, 4.0, 4.75))
    )
    turn = blend(free, PALM, resting(t, Rest(0.95, 4.05, HAND.place), approach=0.6, leave=0.6))
    return aimed_arm("Right", chest, (wrist, turn), rotation.apply([-0.6, -0.7, -0.5]))
