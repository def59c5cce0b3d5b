"""Skin: limbs bend so that skin touches where it touches in the source, and sinks in nowhere.

It begins with the motion that keeps the contacts of joints. In each frame `skin.displacement` finds the displacements
of elbows, wrists and knees that bring limbs out of the body, and skins that touch to the gap of the source. These lead
in time: a limb that is about to sink in begins to leave its way before it arrives, and comes back afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.ik.poses import Chunk, chunks_of
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.parallel import blocks_of, in_threads
from distretarget.numerics.time_series import KeyFrames, Shots, by_shot, median_of_three, smoothstep, widened
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, normalised
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_pairs import Contacts
from distretarget.objectives.supports import Supports
from distretarget.rig import found_once
from distretarget.skin.balls import NEVER, Balls, balls_of, mean_radii, segment_gaps
from distretarget.skin.capsules import IS_ARM, PLACE, SEGMENTS, Capsules
from distretarget.skin.displacement import REACH, displacements
from distretarget.skin.limbs import Limb, bent, shares_of
from distretarget.skin.tangents import LEAST_SHARE, Displaced

TOUCH, APART = 0.01, 0.04  # parts touch up to the first gap, and from the second on they do not [body units]
MARGIN = 0.01  # only what is less than this farther than the nearest touches [body units]
LEAD = 0.08  # a limb leaves its way over twice this time before it would sink in [s]
SETTLE, MEET, LAST = 0.14, 0.06, 0.06  # what is left is brought out, and averaged over these times on each side [s]
RATE = 20.0  # displacements are found about as often, and interpolated [1/s]

LIMBS = (("UpperArm", "LowerArm", "Hand"), ("UpperLeg", "LowerLeg", "Foot"))

# How far flesh gives way to other flesh [mean radius of its capsules]; the skin of an upper arm is the chest's at the
# armpit.
FLESH = {"upper arm": 1.0, "thigh": 0.2, "pelvis": 0.16, "belly": 0.16}
SOFT = np.array([next((value for part, value in FLESH.items() if part in name), 0.0) for name in SEGMENTS])
IS_HARD = np.array(["hand" in name or "forearm" in name for name in SEGMENTS])
# Beside an upper arm that is all soft, a forearm gives way to the trunk by so much at the elbow, and less and less down
# to the wrist [radii]: of stout bodies the meshes sink in by 2 % of the height at most, with 0.5 by more.
ELBOW = 0.4
IS_FOREARM = np.array(["forearm" in name for name in SEGMENTS])
IS_TRUNK = np.array([name in ("chest", "belly", "pelvis") for name in SEGMENTS])


@dataclass(frozen=True, eq=False)
class BodySkin:
    """The skin of one body. Lengths of `balls` are in body units, all others in file units."""

    capsules: Capsules  # ordered by segment
    balls: Balls  # the same, and the balls of the limbs
    limbs: tuple[Limb, ...]  # arms, then legs
    displaced: Displaced  # how the balls move with middle and end of each limb
    of_joint: Numbers  # (joints,), the segment of each joint, that of its nearest ancestor with a capsule; -1 for none
    unit: float  # the body unit

    @classmethod
    def of(cls, body: Body, capsules: Capsules) -> BodySkin:
        """Return the skin of a body with these capsules."""
        pose, skeleton = body.reference, body.skeleton
        capsules = capsules[np.argsort(capsules.segments, kind="stable")]
        turned = Rotation.from_quat(pose.rotations[capsules.joints]).as_matrix()
        posed = np.einsum("cij,cej->cei", turned, capsules.ends) + pose.positions[capsules.joints, None]
        in_units = replace(capsules, ends=capsules.ends / body.unit, radii=capsules.radii / body.unit)
        balls = balls_of(in_units, posed / body.unit)
        own = dict(zip(capsules.joints.tolist(), capsules.segments.tolist(), strict=True))
        of_joint = [next((own[a] for a in skeleton.line(joint) if a in own), -1) for joint in range(len(skeleton))]
        limbs = limbs_of(body)
        ends = [shares_of(limbs, skeleton, pose.positions, capsules.joints, posed[:, end]) for end in range(2)]
        of_capsule, shares = ends[0][0], np.stack([share for _, share in ends], axis=1)
        t, on = balls.places[:, None], balls.carriers
        moving = (1.0 - t) * shares[on, 0] + t * shares[on, 1]
        is_leg = np.array([limb.top in {leg.hip for leg in body.legs or ()} for limb in limbs] + [True])
        moving[is_leg[of_capsule[on]], 1] = 0.0  # feet stay
        forearms = np.repeat(IS_FOREARM, np.diff(balls.of_ball))
        give = np.outer(ELBOW * balls.radii * forearms * (1.0 - moving[:, 1]), IS_TRUNK[capsules.segments])
        balls.spare[...] -= np.where(balls.spare < NEVER, give, 0.0)
        balls.spare[(moving**2).sum(axis=1) < LEAST_SHARE**2] = NEVER
        mutual = np.equal(*IS_ARM[balls.pairs].T)  # arms give way to arms and legs to legs, but legs not to arms
        return cls(
            capsules=capsules,
            balls=balls,
            limbs=limbs,
            displaced=Displaced(of_capsule, shares, mutual),
            of_joint=np.array(of_joint, np.intp),
            unit=body.unit,
        )

    def between(self, one: Numbers | Flags, other: Numbers | Flags) -> Numbers:
        """Return the pairs of segments of two parts of the body, given by their joints."""
        a, b = (np.setdiff1d(self.of_joint[joints], [-1]) for joints in (one, other))
        first, second = self.balls.pairs.T
        on = (np.isin(first, a) & np.isin(second, b)) | (np.isin(first, b) & np.isin(second, a))
        return np.flatnonzero(on)

    def thickness(self, joint: int) -> float:
        """Return the mean radius of the part of the body that a joint belongs to [body units]."""
        radii = self.balls.cap_radii[self.capsules.segments == self.of_joint[joint]]
        return float(radii.mean()) if radii.size else 0.0

    def posed(self, motion: Motion) -> Array:
        """Return the ends of the capsules in each frame, (frames, capsules, 2, 3) [body units]."""
        posed = self.capsules.posed(motion)
        posed /= self.unit
        return posed


def limbs_of(body: Body) -> tuple[Limb, ...]:
    """Return the limbs whose three joints are known, arms before legs."""
    roles = body.anatomy.roles if body.anatomy else {}
    named = [[side + part for part in parts] for parts in LIMBS for side in SIDES]
    known = [names for names in named if roles.keys() >= {*names}]
    return tuple(Limb(roles[top], roles[middle], roles[end], "Hand" in end) for top, middle, end in known)


@dataclass(frozen=True, eq=False)
class Skins:
    """The skins of source and target."""

    source: BodySkin
    target: BodySkin

    @classmethod
    def of(cls, matching: Matching, source: Capsules, target: Capsules) -> Skins | None:
        """Return the skins of a source and its target; None where a body has no capsules."""
        if not len(source) or not len(target):
            return None
        return cls(_skin_of(matching.source, source), _skin_of(matching.target, target))


@found_once
def _skin_of(body: Body, capsules: Capsules) -> BodySkin:
    """The skin of a body."""
    return BodySkin.of(body, capsules)


def with_skin(clip: Clip, skins: Skins, posed: Motion, supports: Supports, settings: ContactSettings) -> Motion:
    """Return the motion of a target with its limbs bent as its skin asks; `posed` is the motion before."""
    keys = KeyFrames.of(clip.shots, clip.frame_time, RATE)
    margin = round((4.0 * LEAD + SETTLE + MEET + 2.0 * LAST + 2.0 * keys.time) / clip.frame_time) + 2
    chunks = chunks_of(len(clip), margin)
    posed.positions  # noqa: B018 - once for all chunks

    def displaced(chunk: Chunk) -> Array:
        around = chunk.context
        d = _displaced(clip[around], skins, posed[around], supports[around], settings, keys[around])
        return d[chunk.frames.start - around.start : chunk.frames.stop - around.start]

    d = np.concatenate([*in_threads(displaced, chunks)])
    return bent(posed, skins.target.limbs, skins.target.unit * d)


def _displaced(
    clip: Clip, skins: Skins, posed: Motion, supports: Supports, settings: ContactSettings, keys: KeyFrames
) -> Array:
    """How far middle and end of each limb are displaced, (frames, limbs, 2, 3) [body units]."""
    body, source, at = skins.target, skins.source, keys.numbers
    balls = body.balls
    ends = median_of_three(body.posed(posed))  # ignores a single faulty frame
    in_source = segment_gaps(source.balls, median_of_three(source.posed(clip.source))[at], APART)
    in_source = of_pairs(in_source, source.balls.pairs, balls.pairs)
    soft = softness(balls, balls.pairs, in_source)
    touching = how_touching(balls.pairs[:, 0], PLACE[balls.pairs[:, 1]], in_source)
    firmness = touching * _meant(clip, body, touching, supports, settings, at)
    given = ends, limb_places(body, posed), how_free(clip, body, supports, settings)
    return led(balls, body.displaced, given, (soft, np.maximum(in_source, 0.0), firmness), keys)


def limb_places(body: BodySkin, posed: Motion) -> Array:
    """(frames, limbs, 3, 3), the top, the middle and the end of each limb [body units]."""
    joints = np.array([limb.joints for limb in body.limbs], np.intp).reshape(-1, 3)
    return median_of_three(posed.positions[:, joints]) / body.unit


def led(
    balls: Balls,
    displaced: Displaced,
    geometry: tuple[Array, Array, Array],
    asked: tuple[Any, ...],
    keys: KeyFrames,
    reach: float = REACH,
) -> Array:
    """Return displacements, (frames, limbs, 2, 3), that begin before they are needed and end after; only parts that
    both give way, such as hands that clap, meet without a lead. Of the arguments of `displacements`, `geometry` are
    `posed` to `free` in all frames, `asked` are `soft` to `firmness` at key frames.
    """
    find: Callable[..., Array] = partial(displacements, balls, displaced, reach=reach)
    at_keys, shots = tuple(each[keys.numbers] for each in geometry), keys.shots[keys.numbers]
    soft, aims, firmness = asked
    apart, none = np.where(displaced.mutual, NEVER, soft), np.zeros_like(soft)
    meets, others = np.where(displaced.mutual, firmness, 0.0), np.where(displaced.mutual, 0.0, firmness)
    sides = by_shot(find, shots, *at_keys, soft, aims, others) if meets.any() else None
    d = _led_by(by_shot(find, shots, *at_keys, apart, aims, others), shots, LEAD / keys.time)
    d = _averaged(find(*at_keys, apart, aims, none, d), shots, SETTLE / keys.time)
    d = keys.between(_averaged(find(*at_keys, soft, aims, meets, d, sides), shots, MEET / keys.time))
    soft, last = keys.between(soft), LAST / keys.frame_time
    left = find(*geometry, soft, soft, np.zeros_like(soft), d) - d
    return _averaged(d + _led_by(left, keys.shots, last / 2.0), keys.shots, last)


def _led_by(d: Array, shots: Shots, frames: float) -> Array:
    """Displacements held for so many frames before and after, and eased in and out over as many."""
    size = by_shot(partial(widened, frames=frames), shots, lengths(d))
    direction = by_shot(partial(averaged, reach=2 * round(frames) + 1), shots, d)
    return np.asarray(size[..., None] * normalised(direction))


def _averaged(d: Array, shots: Shots, frames: float) -> Array:
    """Displacements averaged over so many frames on each side, one at the least."""
    return by_shot(partial(averaged, reach=max(round(frames), 1)), shots, d)


def how_free(clip: Clip, body: BodySkin, supports: Supports, settings: ContactSettings) -> Array:
    """(frames, limbs, 2), how far middle and end of each limb can move, 0 to 1: not while they or what is beyond them
    rest on the world, nor while the limb touches another performer; feet never.
    """
    free = np.ones((len(clip), len(body.limbs), 2))
    held = [*zip(supports.joints.tolist(), supports.weights.T, strict=True)] if settings.foot_lock else []
    touches = [*supports.touches]
    for number, limb in enumerate(body.limbs):
        below = {*clip.skeleton.subtree(limb.end)}
        for joint, weight in held:
            if joint in below:
                free[:, number, 1] = np.minimum(free[:, number, 1], 1.0 - weight)
            elif joint == limb.middle:
                free[:, number, 0] = np.minimum(free[:, number, 0], 1.0 - weight)
        for joint, weight in touches:
            if joint in clip.skeleton.subtree(limb.top):
                free[:, number] = np.minimum(free[:, number], 1.0 - weight[:, None])
        if limb.top in {leg.hip for leg in clip.target_legs or ()}:
            free[:, number, 1] = 0.0
    return free


def how_touching(limbs: Numbers, places: Numbers, gaps: Array) -> Array:
    """(frames, pairs), how near pairs of a limb's segment and one at a place are by their gaps, 0 to 1: only arms, and
    only the nearest at each place.
    """
    return np.asarray(smoothstep((APART - gaps) / (APART - TOUCH)) * _nearest(limbs, places, gaps) * IS_ARM[limbs])


def _nearest(limbs: Numbers, places: Numbers, gaps: Array) -> Array:
    """(frames, pairs), 1 for the least gap of a limb and a place, 0 for gaps that are larger by `MARGIN` and more."""
    nearest = np.empty_like(gaps)
    for limb, where in {*zip(limbs.tolist(), places.tolist(), strict=True)}:
        on = (limbs == limb) & (places == where)
        nearest[:, on] = gaps[:, on].min(axis=1)[:, None]
    return 1.0 - smoothstep((gaps - nearest) / MARGIN)


def softness(balls: Balls, parts: Numbers, in_source: Array) -> Array:
    """(frames, pairs), how far segments may overlap [body units]: as far as their flesh gives way, and as far as the
    source's do; hands and forearms not at all. `parts`, (pairs, 2), are what parts of the body these are.
    """
    flesh = SOFT[parts] * mean_radii(balls)[balls.pairs]
    return np.where(IS_HARD[parts[:, 0]], 0.0, np.maximum(flesh.sum(axis=1), -in_source))


def of_pairs(gaps: Array, pairs: Numbers, wanted: Numbers) -> Array:
    """(frames, wanted pairs), the gaps of pairs, (frames, pairs); `APART` for those that are not there."""
    columns = {pair: column for column, pair in enumerate(map(tuple, pairs.tolist()))}
    found = np.array([columns.get(pair, -1) for pair in map(tuple, wanted.tolist())], np.intp)
    return np.take(np.pad(gaps, ((0, 0), (0, 1)), constant_values=APART), found, axis=1)


def _meant(
    clip: Clip, body: BodySkin, touching: Array, supports: Supports, settings: ContactSettings, at: Numbers
) -> Array:
    """(keys, pairs), how much each pair of segments is meant to touch, 0 to 1: the largest activation of a contact
    pair of the first segment and of the place that the second belongs to. Only blocks of frames in which any pair is
    `touching`, (keys, pairs), count, and of the hands' joints only wrists and what is farthest from them.
    """
    if not touching.any():
        return touching
    pairs, targets = body.balls.pairs, clip.distances.targets
    of_point = body.of_joint[targets]
    chosen = np.ones(len(targets), bool)
    for segment in (number for number, name in enumerate(SEGMENTS) if "hand" in name):
        points = np.flatnonzero(of_point == segment)
        if len(points):
            reach = clip.skeleton.paths_from(targets.item(points[0]))[targets[points]]
            chosen[points] = (points == points[0]) | (points == points[reach.argmax()])
    contacts, meant = Contacts.of(clip, settings, chosen), np.zeros(touching.shape)
    for block in blocks_of(len(clip)):
        keys = slice(*np.searchsorted(at, (block.start, block.stop)))
        if not touching[keys].any():
            continue
        near = contacts.near(block, supports[block].standing)
        of_u, of_v, f = of_point[near.u], of_point[near.v], near.f[at[keys] - block.start]
        for column in np.flatnonzero(touching[keys].any(axis=0)):
            limb, other = pairs[column]
            on = ((of_u == limb) & (PLACE[of_v] == PLACE[other])) | ((of_v == limb) & (PLACE[of_u] == PLACE[other]))
            if on.any():
                meant[keys, column] = f[:, on].max(axis=1)
    return meant
