"""The clip of a cartwheel to the left. The second half is the first half mirrored, backwards in time."""

from __future__ import annotations

import numpy as np
from sample_body import (
    ANKLE_HEIGHT,
    ARM_LENGTH,
    SHANK,
    SIDES,
    STANDING,
    THIGH,
    WRIST_HEIGHT,
    AimedFoot,
    Arm,
    Place,
    Trunk,
    aimed_arm,
    blend,
    flat_hand,
    hand,
    mirrored,
    motion,
    raised_shoulder,
    trunk,
    turned,
    unit,
    within_reach,
)
from sample_supports import Rest, Sample, reached, resting, supports
from sample_tracks import Track, bump, clock, columns, eased, held
from scipy.interpolate import make_interp_spline

DURATION = 3.4  # [s]
MIDDLE = 157.5  # where the body is upside down, along the way to the left [cm]
AT_REST = [(1, 0.0), (2, 0.0)]  # ends of a spline without speed and acceleration
SWING = 0.45  # of a leg between the floor and the air, and of the first and the last step [s]
FEET_BEHIND = -4.0  # of the ankles, behind the middle of the body [cm]

# Keys of the first half: time [s], how far the pelvis has turned [degrees], its way to the left and its height [cm].
UPSIDE_DOWN = 102.3  # height of the pelvis at half-time [cm]
KEYS = np.array(
    [
        [0.45, 0.0, 30.0, STANDING - 3.0],
        [0.95, 42.0, 42.0, 86.7],
        [1.25, 106.0, 86.2, 85.2],
        [1.45, 147.5, 120.2, 94.5],
    ]
)
# Where the left hand and both feet rest in the first half: start, end [s], way to the left [cm].
LEFT_HAND, LEFT_HAND_LEAVES = (1.25, 135.0), 1.88
FEET = {"Left": ((-1.0, 0.5, 40.0), (0.95, 1.3, 75.0)), "Right": ((-1.0, 1.0, 20.0),)}


def cartwheel() -> Sample:
    """A cartwheel: left hand, right hand, right foot, left foot, and the right foot closes."""
    t = clock(DURATION)
    body = _trunk(t)
    hands, feet = _hand_rests(), _foot_rests()
    arms = {side: _arm(t, side, body.chest(), hands[side]) for side in SIDES}
    legs = {side: _foot(t, side, body, feet[side]) for side in SIDES}
    table = [
        *(row for side in SIDES for row in supports(t, [side + "Wrist", side + "Wrist_End"], [hands[side]])),
        *(row for side in SIDES for row in supports(t, [side + "Ankle", side + "Toe", side + "Toe_End"], feet[side])),
    ]
    return Sample(motion(body, arms, legs), tuple(table))


def _backwards(rest: Rest) -> Rest:
    """The rest of the other side in the second half."""
    x, y, z = rest.place
    return Rest(DURATION - rest.end, DURATION - rest.start, (2 * MIDDLE - x, y, z))


def _hand_rests() -> dict[str, Rest]:
    start, way = LEFT_HAND
    left = Rest(start, LEFT_HAND_LEAVES, (way, WRIST_HEIGHT, 4.0))
    return {"Left": left, "Right": _backwards(left)}


def _foot_rests() -> dict[str, list[Rest]]:
    first = {
        side: [Rest(start, end, (way, ANKLE_HEIGHT, FEET_BEHIND)) for start, end, way in rests]
        for side, rests in FEET.items()
    }
    return {
        "Left": first["Left"] + [_backwards(rest) for rest in first["Right"]],
        "Right": first["Right"] + [_backwards(rest) for rest in reversed(first["Left"])],
    }


def _track(t: Track, column: int, whole: float, middle: float) -> Track:
    """A spline through the keys, the value at half-time, and `whole` minus the keys backwards."""
    times = [*KEYS[:, 0], DURATION / 2, *(DURATION - KEYS[::-1, 0])]
    first = KEYS[:, column]
    second = whole - first[::-1] if whole else first[::-1]
    spline = make_interp_spline(times, [*first, middle, *second], k=5, bc_type=(AT_REST, AT_REST))
    return spline(np.clip(t, times[0], times[-1]))


def _turned_by(t: Track) -> Track:
    """How far the body has turned [degrees]."""
    return _track(t, 1, 360.0, 180.0)


def _trunk(t: Track) -> Trunk:
    roll = -_turned_by(t)
    way, height = _track(t, 2, 2 * MIDDLE, MIDDLE), _track(t, 3, 0.0, UPSIDE_DOWN)
    pelvis = turned(pitch=3.0, roll=roll)
    aside = eased(t, [0.7, 1.25, 1.7, 2.15, 2.7], [0, -42, 0, 42, 0])
    bend = turned(pitch=2.0, roll=aside)
    return trunk(
        columns(way, height, 0.0), pelvis, bend, pelvis * bend * turned(pitch=-12 * held(t, 0.6, 1.2, 2.2, 2.8))
    )


def _arm(t: Track, side: str, chest: Place, rest: Rest) -> Arm:
    """An arm that is raised from the side of the body to over the head, and lowered at the end."""
    position, rotation = chest
    raised = held(t, 0.05, 0.75, DURATION - 0.75, DURATION - 0.05)
    lift = np.radians(12 + 148 * raised)
    fingers = columns(np.sin(lift), -np.cos(lift), 0.12)
    outer = columns(-np.cos(lift) * raised, -np.sin(lift), raised - 1.2)
    palm = columns(raised - 1, 0.0, raised)
    sign = (1, 1, 1) if side == "Left" else (-1, 1, 1)
    along = unit(fingers)
    wrist = position + rotation.apply(sign * (raised_shoulder(along) + along * 0.94 * ARM_LENGTH))
    free, floor = hand(fingers, palm), flat_hand(168.0)
    if side == "Right":
        free, floor = mirrored(free), mirrored(floor)
    early = Rest(rest.start - 0.08, rest.end + 0.08, rest.place)
    turn = blend(rotation * free, floor, resting(t, early, approach=0.3, leave=0.3))
    wrist = reached(t, wrist, [rest], approach=0.3, leave=0.3)
    return aimed_arm(side, chest, (wrist, turn), rotation.apply(outer * sign))


def _foot(t: Track, side: str, body: Trunk, rests: list[Rest]) -> AimedFoot:
    """A foot that rests at its places, and else is at the end of a straight leg that swings about the hip."""
    sign = 1 if side == "Left" else -1
    hip = body.hip(side)
    free = held(t, 0.75, 1.35, DURATION - 1.35, DURATION - 0.75)
    angle = -_turned_by(t) + sign * (3 + 42 * free)
    ankle = hip + _swung(t, angle, hip, rests)
    step = bump(t, 0.5, 0.5 + SWING) if side == "Left" else bump(t, DURATION - 0.5 - SWING, DURATION - 0.5)
    weights = [resting(t, rest, approach=0.25, leave=0.25) for rest in rests]
    level = sum(weights)
    roll = (1 - level) * angle + sum(weight * _whole_turn(rest) for weight, rest in zip(weights, rests, strict=True))
    return AimedFoot(
        within_reach(hip, ankle + columns(0.0, 6.0 * step, 0.0), THIGH + SHANK),
        turned(roll=roll) * turned(pitch=40 * free * (1 - level) ** 2, yaw=sign * 12.0),
        np.zeros(len(t)),
        body.local["Hips"].apply([0.25 * sign, 0.0, 1.0]),
    )


def _swung(t: Track, angle: Track, hip: Track, rests: list[Rest]) -> Track:
    """(frames, 3), from the hip to the ankle, by a turn about the hip from the free leg's angle [degrees] to the places
    where the foot rests.
    """
    leg = columns(angle, 0.967 * (THIGH + SHANK), 0.0)
    way = leg
    for rest in rests:
        across, up, ahead = (np.asarray(rest.place) - hip).T
        placed = columns(np.degrees(np.arctan2(across, -up)) + _whole_turn(rest), np.hypot(across, up), ahead)
        way = way + resting(t, rest, approach=SWING, leave=SWING)[:, None] * (placed - leg)
    angle, length, ahead = way.T
    return columns(np.sin(np.radians(angle)) * length, -np.cos(np.radians(angle)) * length, ahead)


def _whole_turn(rest: Rest) -> float:
    """The angle of a standing leg, after the body has gone round in the second half [degrees]."""
    return 0.0 if rest.start < DURATION / 2 else -360.0
