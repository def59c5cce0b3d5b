"""Sample scenes of two performers who touch each other."""

from __future__ import annotations

import numpy as np
from sample_body import OFFSET, STANDING, Foot, Trunk, hand, mirrored, trunk, turned
from sample_motions import planted_feet, standing_trunk
from sample_partners import Reach, SampleScene, contact, facing, on_body, opposite, performer
from sample_tracks import Track, bump, clock, columns, cosine, eased, held

DURATION = 2.6  # [s]
FORWARD = hand(fingers=[0.0, 0.0, 1.0], palm=[-1.0, 0.0, 0.0])  # of a left hand, the thumb up
UPRIGHT = hand(fingers=[0.0, 1.0, 0.1], palm=[0.0, -0.1, 1.0])  # of a left hand, the palm forward


def _standing(t: Track, shift: float = 0.0, lean: Track | float = 0.0) -> Trunk:
    """A trunk that leans by `lean` [degrees] and stands with the hips `shift` to the left."""
    return standing_trunk(t, shift + 0.0 * t, turned(pitch=2 + np.asarray(lean)))


def handshake() -> SampleScene:
    """Two people shake their right hands, three times."""
    t, gap = clock(DURATION), 86.0
    start, end = 0.8, 1.9
    weight = held(t, 0.15, start, end, 2.5)
    shake = 3.0 * held(t, start, start + 0.2, end - 0.2, end) * cosine(t, 0.35, start)
    wrist = columns(-1.5, 104 + shake, gap / 2 - 7)
    reach = {"Right": Reach(wrist, mirrored(FORWARD), weight)}
    lead, follower = performer(t, _standing(t, 1.0), reach), performer(t, _standing(t, -1.5), reach)
    touches = (
        contact((0, "RightWrist_End"), (1, "RightWrist"), start, end),
        contact((0, "RightWrist"), (1, "RightWrist_End"), start, end),
    )
    return SampleScene({"one": lead, "other": facing(follower, gap)}, touches)


def high_five() -> SampleScene:
    """Two people clap their right hands above their shoulders, for a tenth of a second."""
    t, gap = clock(2.0), 92.0
    start, end = 0.9, 1.0
    weight = held(t, 0.2, start, end, 1.8)
    one, other = (
        {"Right": Reach(columns(x, 150, gap / 2 - 1.5), mirrored(UPRIGHT), weight, (-0.4, -1.0, 0.0))}
        for x in (-10.0, 10.0)
    )
    lead, follower = performer(t, _standing(t, 1.0), one), performer(t, _standing(t, 1.0), other)
    touches = (
        contact((0, "RightWrist"), (1, "RightWrist"), start, end),
        contact((0, "RightWrist_End"), (1, "RightWrist_End"), start, end),
    )
    return SampleScene({"one": lead, "other": facing(follower, gap)}, touches)


def waltz() -> SampleScene:
    """Two people in a closed hold sway from side to side."""
    t, gap = clock(DURATION), 40.0
    sway = 4.0 * cosine(t, 1.7)
    look = turned(pitch=2.0, yaw=14.0 + 0 * t)
    lead, follower = standing_trunk(t, sway, look), standing_trunk(t, -sway, look)
    joined = columns(38 + sway, 128 + 2 * cosine(t, 1.1), gap / 2 - 1)
    back = opposite(on_body(follower.chest(), [12.0, -6.0, -9.0]), gap)
    shoulder = opposite(on_body(lead.chest(), OFFSET["RightCollar"] + OFFSET["RightShoulder"] + [1.0, 4.5, 2.0]), gap)
    ones = np.ones(len(t))
    level = hand(fingers=[0.9, 0.1, 0.35], palm=[-0.3, 0.0, 1.0])
    behind = mirrored(hand(fingers=[-0.9, 0.1, 0.4], palm=[-0.3, 0.0, -1.0]))
    above = hand(fingers=[0.2, -0.3, 0.9], palm=[0.0, -1.0, -0.3])
    one = {"Left": Reach(joined, level, ones, (0.6, -0.8, -0.2)), "Right": Reach(back, behind, ones, (-1.0, -0.1, 0.0))}
    other = {
        "Right": Reach(opposite(joined + columns(0.0, 0.0, 2.0), gap), mirrored(level), ones, (-0.6, -0.8, -0.2)),
        "Left": Reach(shoulder, above, ones, (1.0, -0.2, 0.0)),
    }
    touches = (
        contact((0, "LeftWrist"), (1, "RightWrist"), 0.0, t[-1]),
        contact((1, "LeftWrist"), (0, "RightShoulder"), 0.0, t[-1]),
    )
    motions = {"lead": performer(t, lead, one), "follower": facing(performer(t, follower, other), gap)}
    return SampleScene(motions, touches)


def lift() -> SampleScene:
    """One person lifts the other by the chest."""
    t, gap = clock(DURATION), 34.0
    start, end = 0.7, 2.0
    rise = 18.0 * held(t, start, 1.2, 1.5, end)
    lead, still = _standing(t, 0.0, 4.0), _standing(t)
    follower = Trunk(still.position + columns(0.0, rise, 0.0), still.local)
    feet = {
        side: Foot(foot.ankle + columns(0.0, rise, 0.0), foot.yaw, foot.pitch - 1.6 * rise, foot.toe)
        for side, foot in planted_feet(t, width=20, toe_out=8).items()
    }
    weight = held(t, 0.1, start, end, 2.5)
    grip = hand(fingers=[-0.1, 0.1, 1.0], palm=[-1.0, 0.0, 0.0])
    one, other = {}, {}
    for side, sign, turn in (("Left", 1.0, grip), ("Right", -1.0, mirrored(grip))):
        ribs = opposite(on_body(follower.chest(), [-sign * 15.0, -10.0, 4.0]), gap)
        one[side] = Reach(ribs, turn, weight, (sign, -0.6, 0.0))
        mirror = "Right" if side == "Left" else "Left"
        top = OFFSET[mirror + "Collar"] + OFFSET[mirror + "Shoulder"] + [0.0, 4.5, 2.0]
        above = hand(fingers=[0.1, -0.3, 0.9], palm=[0.0, -1.0, -0.3])
        place = opposite(on_body(lead.chest(), top), gap)
        other[side] = Reach(place, above if side == "Left" else mirrored(above), weight, (sign, -0.5, 0.0))
    touches = tuple(
        contact((1, f"{side}Wrist"), (0, f"{mirror}Shoulder"), start, end)
        for side, mirror in (("Left", "Right"), ("Right", "Left"))
    )
    motions = {"lead": performer(t, lead, one), "follower": facing(performer(t, follower, other, feet), gap)}
    return SampleScene(motions, touches)


def push() -> SampleScene:
    """One person pushes the other at both shoulders, who sways back."""
    t, gap = clock(DURATION), 60.0
    start, end = 0.7, 1.9
    back = 5.0 * bump(t, start, end)
    one = trunk(
        columns(0.0, STANDING - 1.0, 1.0 * back),
        turned(pitch=3 + back),
        turned(pitch=3 + 0.5 * back),
        turned(pitch=3 + 0 * t),
    )
    other = trunk(
        columns(0.0, STANDING - 1.0, -0.4 * back),
        turned(pitch=3 - 0.6 * back),
        turned(pitch=2 - 0.6 * back),
        turned(pitch=2 + eased(t, [0.6, 1.2], [0, 3])),
    )
    weight = held(t, 0.1, start, end, 2.5)
    reaches, touches = {}, []
    for side, sign, turn in (("Left", 1.0, UPRIGHT), ("Right", -1.0, mirrored(UPRIGHT))):
        mirror = "Right" if side == "Left" else "Left"
        shoulder = OFFSET[mirror + "Collar"] + OFFSET[mirror + "Shoulder"] + [0.0, -3.0, 4.5]
        place = opposite(on_body(other.chest(), shoulder), gap)
        reaches[side] = Reach(place, turn, weight, (sign, -0.8, -0.2))
        touches.append(contact((0, f"{side}Wrist"), (1, f"{mirror}Shoulder"), start, end))
    motions = {"one": performer(t, one, reaches), "other": facing(performer(t, other, {}), gap)}
    return SampleScene(motions, tuple(touches))
