"""The plan for a clip's skin: how far apart the parts of the target's body belong in each frame.

    G = gap_copy + a (gap_source - gap_copy) + e

gap_copy and gap_source are the gaps between two parts of the rotation copy and of the source, in body units of each;
the source's is at least 0. a is 1 while the two touch in the source, and they are meant to: then the gap is the
source's. e is how far the rest of the sum is below 0, at its largest around the frame: a limb that is about to sink in
begins to leave its way before it arrives, and comes back afterwards, so that it never stops all of a sudden.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.motion import Motion
from distretarget.numerics.time_series import by_shot, smoothstep, widened
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_pairs import NearPairs
from distretarget.objectives.skin import STIFFNESS, Skin, skin_of
from distretarget.objectives.skins import BodySkin, Skins
from distretarget.skin.balls import Balls, segment_gaps
from distretarget.skin.capsules import SEGMENTS

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

FARTHEST = 0.15  # parts that are farther apart than this have nothing to do with each other [body units]
NEAR = 0.08  # parts that are nearer than this in the rotation copy may touch in the result [body units]
TOUCH, APART = 0.01, 0.04  # parts touch up to the first gap, and from the second on they do not [body units]
LEAD = 0.12  # a part leaves its way over twice this time before it would sink in [s]
SETS_IN = 0.005  # the depth e at which the gap is kept with the full stiffness [body units]

# Segments that are one place to be touched: what is meant for one of them is meant for all.
PLACES = (
    ("head", "neck"),
    ("chest", "belly", "pelvis", "left thigh", "right thigh"),
    ("left shin", "right shin", "left foot", "right foot"),
    ("left hand", "left forearm", "left upper arm"),
    ("right hand", "right forearm", "right upper arm"),
)


def plan_skin(clip: Clip, skins: Skins, near: NearPairs) -> Skin:
    """Return the skin of the target in the frames of a clip, with contacts as in `near`."""
    source, target = skins.source, skins.target
    balls, ends = target.balls, target.turned(clip.copy)
    copied = segment_gaps(balls, _placed(ends, clip.copy, target), FARTHEST)
    in_source = segment_gaps(source.balls, _placed(source.turned(clip.source), clip.source, source), FARTHEST)
    in_source = _of_pairs(in_source, source.balls.pairs, balls.pairs)

    def led(values: Array) -> Array:
        return by_shot(lambda each: widened(each, LEAD / clip.frame_time), clip.shots, values)

    touching = smoothstep((APART - in_source) / (APART - TOUCH))
    of_point = target.of_joint[clip.distances.targets]
    a = _meant(balls, of_point, near) * led(touching)
    asked = copied + a * (np.maximum(in_source, 0.0) - copied)
    e = led(np.maximum(-asked, 0.0))
    k = STIFFNESS * np.maximum(smoothstep(e / SETS_IN), a)
    close = (copied < NEAR) | (k > 0.0)
    return skin_of(balls, ends, close, asked + e, k)


def _placed(ends: Array, motion: Motion, skin: BodySkin) -> Array:
    """(frames, capsules, 2, 3), the ends of capsules, given less their joints [body units]."""
    return ends + np.take(motion.positions, skin.capsules.joints, axis=1)[:, :, None] / skin.unit


def _of_pairs(gaps: Array, pairs: Numbers, wanted: Numbers) -> Array:
    """(frames, wanted pairs), the gaps of pairs, (frames, pairs); `FARTHEST` for those that are not there."""
    columns = {pair: column for column, pair in enumerate(map(tuple, pairs.tolist()))}
    result = np.full((len(gaps), len(wanted)), FARTHEST)
    for column, pair in enumerate(map(tuple, wanted.tolist())):
        if pair in columns:
            result[:, column] = gaps[:, columns[pair]]
    return result


def _meant(balls: Balls, of_point: Numbers, near: NearPairs) -> Array:
    """(frames, pairs), how much each pair of segments is meant to touch, 0 to 1: the largest activation of a pair of
    points of the first segment and of the place that the second belongs to.
    """
    place = np.full(len(SEGMENTS) + 1, -1)
    for number, names in enumerate(PLACES):
        place[[SEGMENTS.index(name) for name in names]] = number
    u, v = of_point[near.u], of_point[near.v]
    meant = np.zeros((len(near.f), len(balls.pairs)))
    for column, (limb, other) in enumerate(balls.pairs.tolist()):
        on = ((u == limb) & (place[v] == place[other])) | ((v == limb) & (place[u] == place[other]))
        if on.any():
            meant[:, column] = near.f[:, on].max(axis=1)
    return meant
