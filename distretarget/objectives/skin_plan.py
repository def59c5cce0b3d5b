"""The plan for a clip's skin: how far elbows and wrists move so that skin touches where it touches in the source, and
sinks in nowhere.

It begins with the poses that keep the contacts of joints. In each frame `skin.displacement` finds the displacements of
elbows and wrists that bring arms out of the body, and skins that touch to the gap of the source. These lead in time: a
limb that is about to sink in begins to leave its way before it arrives, and comes back afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.poses import Poses
from distretarget.ik.rigid_parts import posed_motion
from distretarget.ik.springs import Springs, no_springs
from distretarget.numerics.time_series import averaged, by_shot, smoothstep, widened
from distretarget.numerics.vectors import lengths, normalised
from distretarget.objectives.clip import Clip
from distretarget.objectives.skin import STIFFNESS, Skin, no_balls, skin_of
from distretarget.objectives.skins import BodySkin, Skins
from distretarget.skin.balls import Balls, segment_gaps
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.displacement import displacements

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Numbers = NDArray[np.intp]

FARTHEST = 0.15  # parts that are farther apart than this have nothing to do with each other [body units]
TOUCH, APART = 0.01, 0.04  # parts touch up to the first gap, and from the second on they do not [body units]
MARGIN = 0.01  # only what is less than this farther than the nearest touches [body units]
LEAD = 0.12  # a limb leaves its way over twice this time before it would sink in [s]
TRACKING = 300.0  # the stiffness with which elbows and wrists are brought to their places
CLEAR = 0.01  # parts that are farther apart than this by the plan do not touch in the solver [body units]
SETTLE = 0.04  # displacements are averaged over this time before and after, at last [s]

SOFT = {"upper arm": 0.01, "thigh": 0.01}  # how far the flesh of these gives way [body units]

# Segments that are one place to be touched: what is meant for one of them is meant for all.
PLACES = (
    ("head", "neck"),
    ("chest", "belly", "pelvis", "left thigh", "right thigh"),
    ("left shin", "right shin", "left foot", "right foot"),
    ("left hand", "left forearm", "left upper arm"),
    ("right hand", "right forearm", "right upper arm"),
)


@dataclass(frozen=True, eq=False)
class SkinPlan:
    """What the skin asks of the poses of a clip. Slicing selects frames. Lengths are in body units."""

    body: BodySkin | None  # the target's; None for a body without thickness
    v: Array  # (frames, parts + 1, 3), the poses that it begins with, as in `Poses` [rad, file units]
    ends: Array  # (frames, capsules, 2, 3), the ends of the capsules less their joints, in the rotation copy
    near: Flags  # (frames, pairs), whether a pair of segments may touch
    soft: Array  # (frames, pairs), how far two segments may overlap, because flesh gives way
    rest: Array  # (frames, pairs), the gap of legs
    weight: Array  # (frames, pairs), how firmly it is kept, 0 to 1
    places: Array  # (frames, displaced joints, 3), elbows and wrists less their shoulders
    displacements: Array  # (frames, displaced joints, 3), of elbows and wrists, from the first poses
    acts: Flags  # (frames,), whether anything changes

    def __len__(self) -> int:
        return len(self.acts)

    def __getitem__(self, frames: slice) -> SkinPlan:
        arrays = {each.name: getattr(self, each.name)[frames] for each in fields(self) if each.name != "body"}
        return replace(self, **arrays)

    def start(self, unit: float) -> Array:
        """The poses that the solver starts from, (frames, parts + 1, 3), with the root in body units."""
        start = self.v.copy()
        start[:, -1] /= unit
        return start

    def shift_of(self, joints: Numbers) -> Array:
        """How far joints are moved by what is planned, (frames, joints, 3)."""
        if self.body is None:
            return np.zeros((len(self), len(joints), 3))
        return self.body.displacements_of_joints(self.displacements, joints)

    @property
    def springs(self) -> Springs:
        """The springs that bring elbows and wrists to their places."""
        if self.body is None:
            return no_springs(len(self))
        A = np.broadcast_to(TRACKING * np.eye(3), (*self.places.shape, 3))
        return Springs(self.body.joints, self.body.anchors, self.places + self.displacements, A)

    @property
    def skin(self) -> Skin:
        """The surfaces of the body."""
        balls = no_balls() if self.body is None else self.body.balls
        return skin_of(balls, self.ends, self.near, self.soft, self.rest, STIFFNESS * self.weight)


def no_plan(clip: Clip) -> SkinPlan:
    """Return the plan for a clip of bodies without thickness."""
    frames, none = len(clip), np.zeros((len(clip), 0))
    start = np.broadcast_to(0.0, (frames, clip.parts.max() + 2, 3))
    ends, places = np.zeros((frames, 0, 2, 3)), np.zeros((frames, 0, 3))
    return SkinPlan(None, start, ends, none > 0, none, none, none, places, places, np.zeros(frames, bool))


def plan_skin(clip: Clip, skins: Skins, poses: Poses, meant: Array) -> SkinPlan:
    """Return the plan for a clip whose contacts of joints are solved; `meant` is that of `meant_contacts`."""
    source, target = skins.source, skins.target
    balls = target.balls
    posed = posed_motion(clip.copy, poses.v, clip.parts, clip.root + poses.v[:, -1])
    ends = target.posed(posed)
    gaps = segment_gaps(balls, ends, FARTHEST)
    in_source = _of_pairs(
        segment_gaps(source.balls, source.posed(clip.source), FARTHEST), source.balls.pairs, balls.pairs
    )

    def led(values: Array) -> Array:
        return by_shot(lambda each: widened(each, LEAD / clip.frame_time), clip.shots, values)

    firmness = meant * smoothstep((APART - in_source) / (APART - TOUCH)) * _nearest(balls, in_source)
    wanted = gaps + firmness * (np.maximum(in_source, 0.0) - gaps)
    soft = _softness(balls) + np.where(_gives_way(balls), np.maximum(-in_source - _softness(balls), 0.0), 0.0)
    near = (gaps < FARTHEST) | (firmness > 0.0)
    start = np.zeros((len(target.joints), 3))
    x = posed.positions / target.unit
    elbows, wrists = target.joints[::2], target.joints[1::2]
    arms_at = np.stack([x[:, target.anchors[::2]], x[:, elbows], x[:, wrists]], axis=2)
    raw = by_shot(
        lambda *of_shot: displacements(balls, target.displaced, *of_shot, start, given=False),
        clip.shots,
        ends,
        arms_at,
        near,
        soft,
        wanted,
        firmness,
    )
    size = led(lengths(raw))
    reach = 2 * round(LEAD / clip.frame_time) + 1
    direction = normalised(by_shot(lambda each: averaged(each, reach), clip.shots, raw))
    smooth = size[..., None] * direction
    out = displacements(balls, target.displaced, ends, arms_at, near, soft, wanted, 0.0 * firmness, smooth, given=True)
    final = by_shot(lambda each: averaged(each, max(round(SETTLE / clip.frame_time), 1)), clip.shots, out)
    arms = np.array(["arm" in SEGMENTS[limb] or "hand" in SEGMENTS[limb] for limb in balls.pairs[:, 0]])
    lack = np.where(arms, 0.0, led(np.maximum(-gaps - soft, 0.0)))
    moved = lengths(final).max(axis=1, initial=0.0) > 0.0
    touch = segment_gaps(balls, _displaced(ends, target, final), FARTHEST) + soft < CLEAR
    acts = moved | (lack > 0.0).any(axis=1) | touch.any(axis=1)
    return SkinPlan(
        body=target,
        v=poses.v,
        ends=target.turned(clip.copy),
        near=np.where(arms, touch, gaps + soft < FARTHEST) & acts[:, None],
        soft=soft,
        rest=gaps + soft + lack,
        weight=smoothstep(lack / 0.005),
        places=x[:, target.joints] - x[:, target.anchors],
        displacements=final,
        acts=acts,
    )


def _displaced(ends: Array, body: BodySkin, displacements: Array) -> Array:
    """The ends of capsules, (frames, capsules, 2, 3), with the displacements of elbows and wrists."""
    moved, how = ends.copy(), body.displaced
    for end in range(2):
        for k in range(2):
            shares = np.where(how.of_end[:, end, k] >= 0, how.end_shares[:, end, k], 0.0)
            moved[:, :, end] += shares[:, None] * displacements[:, how.of_end[:, end, k]]
    return moved


def _nearest(balls: Balls, gaps: Array) -> Array:
    """(frames, pairs), 1 for the pair with the least gap of all pairs of a limb and one place, 0 for pairs whose gap is
    larger by `MARGIN` and more.
    """
    place = _places()[balls.pairs[:, 1]]
    nearest = np.empty_like(gaps)
    for limb, where in {*zip(balls.pairs[:, 0].tolist(), place.tolist(), strict=True)}:
        on = (balls.pairs[:, 0] == limb) & (place == where)
        nearest[:, on] = gaps[:, on].min(axis=1)[:, None]
    return 1.0 - smoothstep((gaps - nearest) / MARGIN)


def _places() -> Numbers:
    """(segments + 1,), the number of the place that each segment belongs to; -1 for the last, which is none."""
    place = np.full(len(SEGMENTS) + 1, -1)
    for number, names in enumerate(PLACES):
        place[[SEGMENTS.index(name) for name in names]] = number
    return place


def _softness(balls: Balls) -> Array:
    """(pairs,), how far the flesh of two segments gives way [body units]."""
    soft = np.array([next((by for part, by in SOFT.items() if part in name), 0.0) for name in SEGMENTS])
    return np.asarray(soft[balls.pairs].sum(axis=1))


def _gives_way(balls: Balls) -> Flags:
    """(pairs,), whether two segments may overlap as far as the source's do: all but hands and forearms."""
    return np.array(["hand" not in SEGMENTS[limb] and "forearm" not in SEGMENTS[limb] for limb in balls.pairs[:, 0]])


def _of_pairs(gaps: Array, pairs: Numbers, wanted: Numbers) -> Array:
    """(frames, wanted pairs), the gaps of pairs, (frames, pairs); `FARTHEST` for those that are not there."""
    columns = {pair: column for column, pair in enumerate(map(tuple, pairs.tolist()))}
    result = np.full((len(gaps), len(wanted)), FARTHEST)
    for column, pair in enumerate(map(tuple, wanted.tolist())):
        if pair in columns:
            result[:, column] = gaps[:, columns[pair]]
    return result


def meant_contacts(skin: BodySkin, points: Numbers, u: Numbers, v: Numbers, f: Array) -> Array:
    """Return how much each pair of segments is meant to touch, (frames, pairs), 0 to 1: the largest activation f,
    (frames, contact pairs), of a pair of points u and v, (contact pairs,), of the first segment and of the place that
    the second belongs to. `points`, (points,), are the target's joints at the points.
    """
    place = _places()
    of_u, of_v = skin.of_joint[points][u], skin.of_joint[points][v]
    pairs = skin.balls.pairs
    meant = np.zeros((len(f), len(pairs)))
    for column, (limb, other) in enumerate(pairs.tolist()):
        on = ((of_u == limb) & (place[of_v] == place[other])) | ((of_v == limb) & (place[of_u] == place[other]))
        if on.any():
            meant[:, column] = f[:, on].max(axis=1)
    return meant
