"""A performer with user constraints: contacts dropped and made, parts planted and directions kept.

The motion with all constraints is blended into the motion without: the difference, a rotation of each joint and an
offset of the root, is added with a weight that rises before a constraint and falls after it. Outside the solved frames,
the difference of the nearest solved frame fades out. So frames without a constraint are not solved, and the blend is as
smooth as the motion below it. A motion with some contacts dropped is blended into that with all contacts in the same
way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.ik.poses import Mapper, Poses
from distretarget.measure.verdict import Remark
from distretarget.motion import Motion
from distretarget.numerics.time_series import Shots, slices_of, smoothstep, spans_of
from distretarget.numerics.vectors import Array, Numbers, lengths
from distretarget.objectives.constraint_reach import LimbReach, with_looks
from distretarget.objectives.constraint_springs import correction, eased_gap, joint_offset, with_constraints, with_gaps
from distretarget.objectives.constraints import Constraint, Constraints, centimetres
from distretarget.objectives.contact import held_parts, solve_contact
from distretarget.objectives.skin import LimbTargets
from distretarget.objectives.supports import Supports
from distretarget.pipeline.performer import Performer
from distretarget.pipeline.result import RetargetResult

Offsets = Sequence[Array | None]

NOTICED = 0.003  # constraints missed by more than this are reported [heights]
SMOOTHING = 0.1  # changes by constraints are averaged over this time before and after [s]
ROUNDS = 2  # of solving the springs, each with the offsets between parts that the last one found
# Without skin, limbs reach for their constraints in rounds, each averaged over such a time before and after [s], until
# all errors are below `MET` [heights], or a round makes them no smaller.
ROUND_SMOOTHING = (0.1, 0.05, 0.05, 0.03, 0.03, 0.02, 0.0, 0.0)
MET = 0.002
FACING_ROUNDS = 4  # in each, hands turn to face their anchors and arms reach for them: hands turn with forearms
ANCHOR_ROUNDS = 3  # of finding the distance between anchors at which skins have the wanted gap
EARLY = 0.3  # with skin, the blend is complete where the share of constraints reaches this
MOST_SOLVES = 4  # with skin
GOES_ON = 0.1  # outside the solved frames, a difference goes on changing at the same rate for about this time [s]
SLOPE = 0.05  # this rate is measured over this time [s]
LEAST = 1e-12  # the smallest angle that is divided by [rad]


@dataclass(frozen=True, eq=False)
class Unconstrained:
    """A performer's solution without the constraints that a user makes."""

    poses: Poses
    motion: Motion  # of these poses, with limbs bent by skin

    def without(self, drops: Constraints, free: Performer, mapper: Mapper) -> Unconstrained:
        """Return it without dropped contacts: around these frames limbs are bent anew, with `free`, and blended in."""
        if not drops:
            return self
        poses = solve_contact(free.clip, free.supports, free.settings, mapper=mapper)
        bent = free.with_own_skin(free.posed(poses), wanted=drops.share > 0.0)
        return Unconstrained(poses, blended_in([drops], self.motion, bent, has_onset=True))


def without_drops(performer: Performer, drops: Constraints) -> Performer:
    """Return a performer without the contacts in `drops`."""
    return replace(performer, clip=replace(performer.clip, drops=drops.dropped)) if drops else performer


def constrain(performer: Performer, constraints: Constraints, offsets: Offsets = ()) -> Performer:
    """Return a performer with user constraints where they have a weight; `offsets` as in `with_constraints`."""
    made, match = constraints.made, performer.match
    offsets = offsets or [None] * len(made)
    supports = with_constraints(performer.supports, made, offsets, match.skins, match.undersides)
    return replace(without_drops(performer, constraints), supports=supports)


def constrained_result(
    free: Performer, unconstrained: Unconstrained, constraints: Constraints, mapper: Mapper
) -> RetargetResult:
    """Solve a clip with user constraints: the springs of a round keep the offsets that limbs reached in the last."""
    poses, bound = unconstrained.poses, constrain(free, constraints)
    if free.match.skins and any(constraint.anchors for constraint in constraints.made):
        made, motion = constraints.made, unconstrained.motion
        for _ in range(ANCHOR_ROUNDS):  # until distances between anchors give skins the wanted gaps
            motion = _reached(bound, motion, made)
            made = with_gaps(made, motion, free.match.skins.target)
        constraints = replace(made, every=(*constraints.drops, *made))
        bound = constrain(free, constraints)
    made = constraints.made
    solved = _solved(bound, poses, mapper)
    for _ in range(1, ROUNDS if any(each.pair for each in made) else 1):
        reached = _reached(bound, bound.posed(solved), made)
        offsets = [joint_offset(reached, each.pair, bound.clip) if each.pair else None for each in made]
        bound = constrain(free, constraints, offsets)
        solved = _solved(bound, poses, mapper)
    log = np.where(made.share > 0.0, solved.log, poses.log)
    by_skin = free.match.skins is not None and not made.rest_on_body
    motion = bound.posed(solved)
    if by_skin:
        start = free.posed(poses)
        motion = blended_in([made], start, _with_arms(motion, start, unconstrained.motion, made, free))
    posed = blended_in([made], unconstrained.motion, meet(bound, motion, made), by_skin)
    bound = replace(bound, supports=blended_supports(free.supports, bound.supports, made.share))
    return replace(bound.result(replace(poses, log=log), posed=posed), unmet=tuple(unmet(bound, made, posed)))


def _solved(performer: Performer, poses: Poses, mapper: Mapper) -> Poses:
    """The poses of a performer with constraints; their change from `poses` is averaged over time."""
    solved = solve_contact(performer.clip, performer.supports, performer.settings, mapper=mapper)
    held = held_parts(performer.clip, performer.supports, performer.settings)  # what rests is not averaged
    held = np.concatenate([held, held.max(axis=1, keepdims=True)], axis=1)[..., None]
    change = solved.v - poses.v
    change = held * change + (1.0 - held) * performer.clip.averaged(change, SMOOTHING)
    return replace(solved, v=poses.v + change)


def _with_arms(motion: Motion, free: Motion, apart: Motion, made: Constraints, performer: Performer) -> Motion:
    """A motion with arms and shoulders of `free`; if the arms reach for each other, those of `apart`."""
    clip, body = performer.clip, performer.match.matching.target
    trunk, arms = {0, clip.pelvis, *(body.anatomy.spine if body.anatomy else ())}, list[int]()
    for limb in body.limbs:
        shoulder = [joint for joint in clip.skeleton.to_root(limb.top) if joint not in trunk]
        arms += [*clip.skeleton.subtree(limb.top), *shoulder] if limb.is_arm else []
    arms_meet = any({*constraint.pair} <= {*arms} for constraint in made if constraint.pair)
    rotations = np.array(motion.rotations)
    rotations[:, arms] = (apart if arms_meet else free).rotations[:, arms]
    return replace(motion, rotations=rotations)


def blended_supports(free: Supports, bound: Supports, share: Array) -> Supports:
    """Blend the weights of `bound` supports, which have more joints, into `free` ones by `share`, (frames,)."""
    weights, share = np.zeros_like(bound.weights), share[:, None]
    weights[:, : len(free.joints)] = free.weights
    return replace(bound, weights=(1.0 - share) * weights + share * bound.weights)


def meet(performer: Performer, motion: Motion, constraints: Constraints) -> Motion:
    """Return a motion that meets constraints in their frames. The errors that one solve of limbs and skin leaves are
    added to the targets of the next, as in the method of multipliers; parts that rest on the body enter its skin.
    """
    skins, body, wanted = performer.match.skins, performer.match.matching.target, constraints.share > 0.0
    if skins is None or constraints.rest_on_body:
        reached = performer.with_own_skin(_reached(performer, motion, constraints), wanted=wanted)
        return _reached(performer, reached, constraints)  # the errors that averages and skin have left
    limbs, weights = _reaching(performer, constraints), [constraint.weight for constraint in constraints]
    pairs = (skins.target.between(*constraint.joints) for constraint in constraints if constraint.anchors)
    anchored = np.concatenate([np.zeros(0, np.intp), *pairs])
    before = limbs.arms_out_of_trunk(with_looks(motion, constraints, body), weights)
    for _ in range(FACING_ROUNDS if len(anchored) else 1):
        before = limbs.with_gaps_closed(before, weights, SMOOTHING)
    gaps = [eased_gap(constraints, constraint, skins, before) for constraint in constraints]
    places = [weight * (gap is None) for weight, gap in zip(weights, gaps, strict=True)]
    displacements, firmness = limbs.displacements(before, places)
    best, least = before, np.inf
    for _ in range(MOST_SOLVES):
        targets = LimbTargets(displacements / body.unit, firmness, tuple(filter(None, gaps)), anchored)
        now = performer.with_own_skin(before, targets, wanted)
        error = _largest_error(performer, constraints, now)
        if error < least:
            best, least = now, error
        if error <= MET * body.height or not firmness.any():
            break
        displacements += (firmness == 1.0)[..., None] * limbs.displacements(now, places)[0]
    return with_looks(best, constraints, body)


def _reached(performer: Performer, motion: Motion, constraints: Constraints) -> Motion:
    """A motion that meets constraints, whatever skin its limbs enter."""
    limbs, weights, body = _reaching(performer, constraints), constraints.all_firmness, performer.match.matching.target
    motion = limbs.arms_out_of_trunk(with_looks(motion, constraints, body), weights)
    error, last = np.inf, np.inf
    for smoothing in ROUND_SMOOTHING:
        motion, last = limbs.with_gaps_closed(motion, weights, smoothing), error
        error = _largest_error(performer, constraints, motion)
        if error <= MET * body.height or error >= last:
            break
    return with_looks(motion, constraints, body)


def _reaching(performer: Performer, constraints: Constraints) -> LimbReach:
    """The limbs of a performer, to be moved to its constraints."""
    return LimbReach(constraints, performer.supports, performer.match.matching.target, performer.match.skins)


def _largest_error(performer: Performer, constraints: Constraints, posed: Motion) -> float:
    """The largest distance of a motion from its constraints [file units]."""
    return float(max((errors.max() for _, errors in _errors(performer, constraints, posed)), default=0.0))


def unmet(performer: Performer, constraints: Constraints, posed: Motion) -> Iterator[Remark]:
    """Yield a remark with the largest error of each constraint of a performer that a motion does not meet."""
    for constraint, errors in _errors(performer, constraints, posed):
        if errors.max() > NOTICED * performer.match.matching.target.height:
            name, worst = " - ".join(constraint.entry.names), int(errors.argmax())
            cm = centimetres(performer.clip.unit) * errors[worst]
            yield Remark(f"{name} is missed by up to {cm:.1f} cm, at frame {worst}", worst, *constraint.entry.names)


def _errors(performer: Performer, constraints: Constraints, posed: Motion) -> Iterator[tuple[Constraint, Array]]:
    """Yield constraints with their errors in a motion, (frames,) [file units]; 0 where the weight is less than 1."""
    clip = constraints.clip
    for constraint in constraints:
        off = lengths(correction(constraints, constraint, posed, performer.supports, performer.match.skins)) * clip.unit
        yield constraint, np.where(constraint.frames & (constraint.weight == 1.0), off, 0.0)


def blended_in(several: Sequence[Constraints], without: Motion, bound: Motion, has_onset: bool = False) -> Motion:
    """Blend `bound` into the motion without constraints by their share; if it has an onset itself, early in theirs."""
    constraints = [constraint for each in several for constraint in each]
    lead = np.max([constraint.lead * constraint.frames for constraint in constraints], axis=0)
    share = np.max([smoothstep(each.share / EARLY) if has_onset else each.share * each.on for each in several], axis=0)
    shots = np.sum([each.clip.shots for each in several], axis=0)  # a new shot at the cuts of any performer
    return _blended(without, bound, share, lead, shots)


def _blended(without: Motion, bound: Motion, share: Array, lead: Numbers, shots: Shots) -> Motion:
    """Blend `bound` into `without` by `share`, (frames,). Outside, the difference at the nearest frame with a share
    fades out over its `lead`, (frames,), but not across a cut between `shots`, (frames,).
    """
    roots, rotations = np.array(without.root_positions), np.array(without.rotations)
    for shot in slices_of(shots):
        on = shot.start + np.flatnonzero(share[shot])
        if len(on):
            reach = int(lead[shot].max())
            near = slice(max(int(on[0]) - reach, shot.start), min(int(on[-1]) + 1 + reach, shot.stop))
            added = _added(without[near], bound[near], share[near], lead[near])
            moved = near.start + np.flatnonzero(added.any(axis=(1, 2)))
            added = added[moved - near.start]
            turned = _quaternions(rotations[moved]) * Rotation.from_rotvec(added[:, :-1].reshape(-1, 3))
            rotations[moved] = turned.as_quat().reshape(rotations[moved].shape)
            roots[moved] += added[:, -1]
    whole = share == 1.0
    roots[whole], rotations[whole] = bound.root_positions[whole], bound.rotations[whole]
    return replace(without, root_positions=roots, rotations=rotations)


def _added(without: Motion, bound: Motion, share: Array, lead: Numbers) -> Array:
    """(frames, joints + 1, 3), what blending adds to a shot: rotation vectors of joints [rad], the root's offset.
    It may be 0 where the share is 1, as `bound` is taken there.
    """
    slope, goes_on = round(SLOPE / without.frame_time), GOES_ON / without.frame_time
    spans, used = spans_of(share > 0.0).tolist(), share < 1.0
    for first, end in spans:
        used[[first, min(first + slope, end - 1), max(end - 1 - slope, first), end - 1]] = True
    turns = (_quaternions(without.rotations[used]).inv() * _quaternions(bound.rotations[used])).as_rotvec()
    differ = np.zeros((len(share), len(without.skeleton) + 1, 3))
    differ[used, :-1] = turns.reshape(len(used[used]), -1, 3)
    differ[used, -1] = bound.root_positions[used] - without.root_positions[used]
    added = share[:, None, None] * differ

    def beyond(edge: int, inner: int, frames: Numbers) -> Array:
        """The fading difference in frames beyond the edge of a span, with the slope between edge and a frame inside."""
        t = np.abs(frames - edge)
        far = goes_on * (1.0 - np.exp(-t / goes_on)) / max(abs(edge - inner), 1)
        change = differ[edge] - _nearest(differ[inner], differ[edge])
        ease = share[edge] * _ease(t / (lead[edge] + 1.0))
        return np.asarray(ease[:, None, None] * (differ[edge] + far[:, None, None] * change))

    for before, after in pairwise([None, *spans, None]):
        frames = np.arange(before[1] if before else 0, after[0] if after else len(added))
        of_first = _ease((np.arange(len(frames)) + 1.0) / (len(frames) + 1.0))[:, None, None]
        if before:
            last = before[1] - 1
            weight = of_first if after else 1.0
            added[frames] += weight * beyond(last, max(last - slope, before[0]), frames)
        if after:
            weight = 1.0 - of_first if before else 1.0
            added[frames] += weight * beyond(after[0], min(after[0] + slope, after[1] - 1), frames)
    return np.asarray(added)


def _quaternions(rotations: Array) -> Rotation:
    return Rotation.from_quat(rotations.reshape(-1, 4))


def _nearest(vectors: Array, to: Array) -> Array:
    """(joints + 1, 3), rotation vectors, or those the other way round if nearer; the last row is an offset."""
    others = vectors * (1.0 - 2.0 * np.pi / np.maximum(lengths(vectors), LEAST)[:, None])
    others[-1] = vectors[-1]
    return np.where((lengths(others - to) < lengths(vectors - to))[:, None], others, vectors)


def _ease(t: NDArray[np.floating[Any]]) -> Array:
    """A minimum-jerk fade from 1 at 0 to 0 at 1."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t))
