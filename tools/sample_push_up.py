"""The clip of two push-ups: a straight body turns about the toes while hands and toes rest on the floor."""

from __future__ import annotations

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
    flipped,
    motion,
    trunk,
    turned,
)
from sample_supports import Rest, Sample, supports
from sample_tracks import Track, clock, columns, cosine, held

LEG_LENGTH = 0.9996 * (THIGH + SHANK)  # of a leg stretched almost straight
TOE = np.array([OFFSET["LeftHip"][0], 3.0, 0.0])  # where the left toe joint rests
HAND_PLACE = np.array([25.0, WRIST_HEIGHT, 126.0])  # where the left wrist rests
HAND_YAW = 8.0  # [degrees]


def push_up() -> Sample:
    """Two push-ups."""
    t = clock(4.4)
    depth = held(t, 0.4, 1.35, 1.45, 2.2) + held(t, 2.35, 3.2, 3.3, 4.1)
    tiptoe = 70 + 6 * depth
    ankle = TOE - turned(pitch=tiptoe).apply(OFFSET["LeftToe"])
    body = _plank(t, depth, ankle)
    wrist = np.tile(HAND_PLACE, (len(t), 1))
    arm = aimed_arm("Left", body.chest(), (wrist, flat_hand(HAND_YAW)), elbow=[0.75, 0.35, -0.75])
    forward = body.local["Hips"].apply([0.0, 0.0, 1.0])
    left = AimedFoot(ankle, turned(pitch=tiptoe), tiptoe, forward)
    right = AimedFoot(flipped(ankle), turned(pitch=tiptoe), tiptoe, forward)
    rest = [Rest(0.0, t[-1], HAND_PLACE)]
    joints = [side + name for side in SIDES for name in ("Wrist", "Wrist_End", "Toe", "Toe_End")]
    return Sample(
        motion(body, dict.fromkeys(SIDES, arm), {"Left": left, "Right": right}), tuple(supports(t, joints, rest))
    )


def _plank(t: Track, depth: Track, ankle: Track) -> Trunk:
    """A body in line with the legs, which rises from the ankles towards the head."""
    rise = 16.7 - 12.7 * depth  # [degrees]
    pelvis = turned(pitch=90 - rise - 2.5)
    legs = turned(pitch=90 - rise).apply([0.0, LEG_LENGTH, 0.0])
    hip = pelvis.apply(OFFSET["LeftHip"])
    bend = turned(pitch=2.0 + 2.0 * depth + 0.6 * cosine(t, 2.2))
    position = (ankle + legs - hip) * (0, 1, 1)
    return trunk(columns(*position.T), pelvis, bend, turned(pitch=62 - rise / 2 + 6 * depth))
