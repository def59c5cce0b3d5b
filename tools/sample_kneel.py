"""The clip of a kneel: a step forward, the right knee comes to the floor, and the body rises and closes the step."""

from __future__ import annotations

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    OFFSET,
    SHANK,
    STANDING,
    THIGH,
    AimedFoot,
    Arm,
    Foot,
    Trunk,
    motion,
    swung_arm,
    trunk,
    turned,
    unit,
)
from sample_supports import Rest, Sample, resting, stepped, supports
from sample_tracks import Track, bump, clock, columns, cosine, eased, held

DURATION = 5.2  # [s]
STEP = 72.0  # [cm]
KNEE_HEIGHT = 5.5  # of a knee that rests on the floor [cm]
TIPTOE = 62.0  # the right foot's heel up while the knee rests [degrees]
KNEEL = (1.9, 3.1)  # when the right knee comes to rest and leaves [s]
LEFT_STEP, RIGHT_STEP = (0.35, 0.95), (3.7, 4.5)  # when the feet leave the floor and come to rest [s]
TOE = np.array([-10.0, 0.0, -4.0]) + OFFSET["RightToe"] + (0.0, ANKLE_HEIGHT, 0.0)  # the right toe joint


def kneel() -> Sample:
    """A kneel on the right knee, and rise."""
    t = clock(DURATION)
    left_rests = [
        Rest(-1.0, LEFT_STEP[0], (10.0, ANKLE_HEIGHT, -4.0)),
        Rest(LEFT_STEP[1], DURATION, (10.0, ANKLE_HEIGHT, STEP - 4.0)),
    ]
    toe_rests = [Rest(-1.0, RIGHT_STEP[0], TOE), Rest(RIGHT_STEP[1], DURATION, TOE + np.array([0.0, 0.0, STEP]))]
    heel = eased(t, [0.55, KNEEL[0], KNEEL[1], 3.7, 4.45], [0, TIPTOE, TIPTOE, 58, 0])
    ankle = stepped(t, toe_rests, arc=(0.0, 4.0, 0.0)) - turned(pitch=heel).apply(OFFSET["RightToe"])
    knee_rest = Rest(*KNEEL, _knee(ankle[round(KNEEL[0] / DURATION * (len(t) - 1))]))
    down = resting(t, knee_rest, approach=1.0, leave=0.95)
    body = _trunk(t, down, np.asarray(knee_rest.place))
    hip = body.hip("Right")
    aim = columns(0.0, 0.0, 1 - down) + down[:, None] * unit(knee_rest.place - hip)
    left = Foot(
        stepped(t, left_rests, arc=(0.0, 6.0, 0.0)), np.full(len(t), 5.0), 12 * bump(t, 0.5, 0.95), np.zeros(len(t))
    )
    right = AimedFoot(ankle, turned(pitch=heel), heel, aim)
    heel_down = [Rest(-1.0, 0.55, TOE), Rest(RIGHT_STEP[1], DURATION, TOE)]
    table = [
        *supports(t, ["LeftAnkle", "LeftToe", "LeftToe_End"], left_rests),
        *supports(t, ["RightToe", "RightToe_End"], toe_rests),
        *supports(t, ["RightAnkle"], [*heel_down, knee_rest]),
        *supports(t, ["RightKnee"], [knee_rest]),
    ]
    arms = {"Left": _arm(t, down, 0.0), "Right": _arm(t, down, 0.3)}
    return Sample(motion(body, arms, {"Left": left, "Right": right}), tuple(table))


def _knee(ankle: Track) -> Track:
    """(3,), where the right knee rests before this ankle."""
    drop = KNEE_HEIGHT - ankle[1]
    return ankle + np.array([0.0, drop, np.sqrt(SHANK**2 - drop**2)])


def _trunk(t: Track, down: Track, knee: Track) -> Trunk:
    """A trunk whose right hip is as far from the resting knee as the thigh is long."""
    ahead = eased(t, [0.2, KNEEL[0] + 0.05, KNEEL[1] - 0.1, 4.75], [0, 46, 46, STEP])
    lean = bump(t, 0.7, 2.2) + bump(t, 2.9, 4.4)
    pelvis = turned(pitch=3 + 7 * lean, yaw=-4 * down)
    side = eased(t, [0.1, 0.5, 1.1, 4.0, 4.4, 5.1], [0, -3.0, 0, 0, 2.5, 0])
    free = eased(t, [0.2, 1.0, 3.8, 4.8], [STANDING - 2.0, 80, 80, STANDING - 2.0])
    hip = columns(side, 0.0, ahead) + pelvis.apply(OFFSET["RightHip"])
    across = (hip[:, 0] - knee[0]) ** 2 + (hip[:, 2] - knee[2]) ** 2
    kneeling = knee[1] + np.sqrt(np.maximum(THIGH**2 - across, 0.0)) - hip[:, 1]
    height = free + down * (kneeling - free)
    bend = turned(pitch=2 + 9 * lean + 0.6 * cosine(t, 2.6), yaw=4 * down)
    return trunk(columns(side, height, ahead), pelvis, bend, turned(pitch=4 + 12 * lean))


def _arm(t: Track, down: Track, late: float) -> Arm:
    swing = held(t, 0.4, 0.9, 1.2, 1.8)
    return swung_arm(
        flexion=-3 + 14 * down + (8 if late else -8) * swing,
        abduction=9 + 5 * down,
        elbow=18 + 22 * down + 1.2 * cosine(t, 3.0, late),
        roll=18,
        pronation=8,
        wrist=8,
    )
