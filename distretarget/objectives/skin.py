"""Skin: limbs bend so that skin touches where it touches in the source, and sinks in nowhere.

It begins with the motion that keeps the contacts of joints. In each frame `skin.displacement` finds how elbows, wrists
and knees bring limbs out of the body. From there `ik.limb_bends` solves for all frames at once: limbs stay outside,
skins that touch come to the gap of the source, and limbs move as smoothly as that lets them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.ik.limb_bends import FADES, TAU, bends
from distretarget.ik.limb_terms import Frames
from distretarget.ik.poses import Chunk, chunks_of
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_threads
from distretarget.numerics.time_series import Shots, by_shot, smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.clip import Clip
from distretarget.objectives.supports import Supports
from distretarget.rig import found_once
from distretarget.skin.balls import NEVER, Balls, balls_of, mean_radii, segment_gaps
from distretarget.skin.capsules import IS_ARM, PLACE, SEGMENTS, Capsules
from distretarget.skin.displacement import displacements
from distretarget.skin.limbs import Limb, bent, shares_of
from distretarget.skin.tangents import LEAST_SHARE, Displaced

TOUCH, APART = 0.01, 0.04  # parts touch up to the first gap, and from the second on they do not [body units]
REACH = 0.06  # what is farther apart than this in the result is not brought to touch [body units]

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
    chunks = chunks_of(len(clip), round(FADES * TAU / clip.frame_time))
    posed.positions  # noqa: B018 - once for all chunks

    def displaced(chunk: Chunk) -> Array:
        around = chunk.context
        d = _displaced(clip[around], skins, posed[around], supports[around], settings)
        return d[chunk.frames.start - around.start : chunk.frames.stop - around.start]

    d = np.concatenate([*in_threads(displaced, chunks)])
    return bent(posed, skins.target.limbs, skins.target.unit * d)


def _displaced(clip: Clip, skins: Skins, posed: Motion, supports: Supports, settings: ContactSettings) -> Array:
    """How far middle and end of each limb are displaced, (frames, limbs, 2, 3) [body units]."""
    body, source, balls = skins.target, skins.source, skins.target.balls
    in_source = segment_gaps(source.balls, source.posed(clip.source), APART)
    in_source = of_pairs(in_source, source.balls.pairs, balls.pairs)
    spots = Spots.of(balls.pairs[:, 0], PLACE[balls.pairs[:, 1]])
    gaps = spots.least(in_source)
    touching = how_touching(spots, gaps)
    frames = Frames(
        posed=body.posed(posed),
        limbs=limb_places(body, posed),
        free=how_free(clip, body, supports, settings),
        soft=softness(balls, balls.pairs, in_source),
        aims=np.maximum(gaps, 0.0),
        firmness=touching * _meant(clip, body, spots),
    )
    return brought_out(balls, body.displaced, spots, frames, body.limbs, clip.shots, clip.frame_time, REACH)


def brought_out(
    balls: Balls,
    displaced: Displaced,
    spots: Spots,
    frames: Frames,
    limbs: Sequence[Limb],
    shots: Shots,
    frame_time: float,
    reach: float,
) -> Array:
    """Return how far to displace limbs, (frames, limbs, 2, 3), from where they are; see `ik.limb_bends.bends`."""
    start = by_shot(partial(displacements, balls, displaced), shots, *frames[:4])
    arms = np.array([limb.is_arm for limb in limbs], bool)
    return bends(balls, displaced, spots.of_pair, frames, arms, start, shots, frame_time, reach)


@dataclass(frozen=True, eq=False)
class Spots:
    """Where limbs can touch: segments of limbs, and the places that they touch. What is meant for a pair of segments is
    meant for all pairs of its spot, of which the nearest touches.
    """

    limbs: Numbers  # (spots,), the segment of the limb
    places: Numbers  # (spots,), the place
    of_pair: Numbers  # (pairs,), the spot of each pair of segments

    @classmethod
    def of(cls, limbs: Numbers, places: Numbers) -> Spots:
        """Return the spots of pairs, (pairs,), of segments of limbs and places."""
        both, of_pair = np.unique(np.stack([limbs, places]), axis=1, return_inverse=True)
        return cls(both[0], both[1], of_pair.ravel())

    def least(self, gaps: Array) -> Array:
        """(frames, spots), the least of the gaps of each spot's pairs, (frames, pairs)."""
        least = np.full((len(gaps), len(self.limbs)), np.inf)
        for pair, spot in enumerate(self.of_pair):
            np.minimum(least[:, spot], gaps[:, pair], out=least[:, spot])
        return least


def limb_places(body: BodySkin, posed: Motion) -> Array:
    """(frames, limbs, 3, 3), the top, the middle and the end of each limb [body units]."""
    joints = np.array([limb.joints for limb in body.limbs], np.intp).reshape(-1, 3)
    return np.asarray(posed.positions[:, joints] / body.unit)


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


def how_touching(spots: Spots, gaps: Array) -> Array:
    """(frames, spots), how near limbs are to what they touch, 0 to 1, by gaps, (frames, spots); only arms touch."""
    return np.asarray(smoothstep((APART - gaps) / (APART - TOUCH)) * IS_ARM[spots.limbs % len(SEGMENTS)])


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


def _meant(clip: Clip, body: BodySkin, spots: Spots) -> Array:
    """(frames, spots), how much each is meant to be touched, 0 to 1: by an arm as far as it is raised or bent, as one
    that hangs is near the body anyway; and none that is dropped.
    """
    of_joint, sources = body.of_joint, clip.distances.sources
    of_point, arms = of_joint[clip.distances.targets], PLACE[:-1][IS_ARM]
    meant = np.ones((len(clip), len(spots.limbs)))
    for spot, (limb, place) in enumerate(zip(spots.limbs, spots.places, strict=True)):
        if place not in arms:
            meant[:, spot] = clip.raised_arms[:, sources[of_point == limb]].max(axis=1, initial=0.0)
        ends = np.flatnonzero(of_joint == limb), np.flatnonzero(PLACE[of_joint] == place)
        for drop in clip.drops:
            if any(
                np.isin(a, one).any() and np.isin(b, other).any()
                for a, b in (ends, ends[::-1])
                for one, other in [drop.parts]
            ):
                meant[drop.frames, spot] = 0.0
    return meant
