"""A performer with user constraints: contacts dropped and made, parts planted and directions kept.

The motion with all constraints is blended into the motion without: the difference, a rotation of each joint and an
offset of the root, is added with a weight that rises before a constraint and falls after it. Before and after the
frames that are solved, the difference of the nearest of these fades out. So frames without a constraint are not solved,
and the blend is as smooth as the motion below it. The motion without contacts that are dropped is blended into that
with all contacts in the same way.
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
from distretarget.objectives.body_skin import BodySkin, limbs_of
from distretarget.objectives.constraint_reach import LimbReach, with_looks
from distretarget.objectives.constraint_springs import correction, eased_gap, joint_offset, with_constraints, with_gaps
from distretarget.objectives.constraints import Constraint, Constraints, centimetres
from distretarget.objectives.contact import held_parts, solve_contact
from distretarget.objectives.skin import LimbTargets
from distretarget.objectives.supports import Supports
from distretarget.pipeline.performer import Performer
from distretarget.pipeline.result import RetargetResult

Offsets = Sequence[Array | None]

NOTICED = 0.003  # what is farther off than this is told [heights]
SMOOTHING = 0.1  # what constraints change is averaged over this time before and after [s]
ROUNDS = 2  # in which what is between parts is found
# Without skin, limbs close the distance that is left in rounds, each averaged over such a time before and after [s],
# until all are nearer than `MET` [heights], or a round brings them no nearer.
CLOSING = (0.1, 0.05, 0.05, 0.03, 0.03, 0.02, 0.0, 0.0)
MET = 0.002
FACES = 4  # times that hands turn to what they touch at an anchor, and arms reach for it: hands turn with forearms
SETTLES = 3  # times that it is found how far apart anchors are while skins touch
EARLY = 0.3  # with skin, the blend is complete where the share of constraints reaches this
TURNS = 4  # with skin it is solved so many times at most
GOES_ON = 0.1  # beyond its last frame a difference goes on changing at the same speed for about this time [s]
SLOPE = 0.05  # that speed is measured over this time [s]
LEAST = 1e-12  # the smallest angle that is divided by [rad]


@dataclass(frozen=True, eq=False)
class Unconstrained:
    """A performer's poses without user constraints, but without the contacts that are dropped, and their motion."""

    poses: Poses
    motion: Motion  # with limbs bent so that skin is kept apart and contacts closed


def dropping(performer: Performer, constraints: Constraints) -> Performer:
    """Return a performer without the contacts that constraints drop."""
    return replace(performer, clip=replace(performer.clip, drops=constraints.dropped)) if constraints else performer


def let_go(free: Performer, unconstrained: Unconstrained, drops: Constraints, mapper: Mapper) -> Unconstrained:
    """Return a solution that was made with all contacts without those that are dropped: around these, limbs are bent
    anew as their skin asks, and blended into the other frames, which stay as they are.
    """
    if not drops:
        return unconstrained
    poses = solve_contact(free.clip, free.supports, free.settings, mapper=mapper)
    bent = free.with_own_skin(free.posed(poses), wanted=drops.share > 0.0)
    return Unconstrained(poses, layered([drops], unconstrained.motion, bent, whole=True))


def constrain(performer: Performer, constraints: Constraints, offsets: Offsets = ()) -> Performer:
    """Return a performer with user constraints, in all frames in which they set in, hold or let go; `offsets` as
    `constraint_springs.with_constraints`.
    """
    made, match = constraints.made, performer.match
    offsets = offsets or [None] * len(made)
    supports = with_constraints(performer.supports, made, offsets, match.skins, match.undersides)
    return replace(dropping(performer, constraints), supports=supports)


def constrained_result(
    free: Performer, unconstrained: Unconstrained, constraints: Constraints, mapper: Mapper
) -> RetargetResult:
    """Solve a clip with user constraints, and return its result; `unconstrained` is it without those that are made.

    What limbs have to reach for after a round tells the next one how to bring parts together.
    """
    poses, bound = unconstrained.poses, constrain(free, constraints)
    if free.match.skins and any(constraint.anchors for constraint in constraints.made):
        constraints = settled(bound, unconstrained.motion, constraints, free.match.skins.target)
        bound = constrain(free, constraints)
    made = constraints.made
    held = _held(bound, poses, mapper)
    for _ in range(1, ROUNDS):
        closed = _closed(bound, bound.posed(held), made)
        offsets = [joint_offset(closed, each.pair, bound.clip) if each.pair else None for each in made]
        bound = constrain(free, constraints, offsets)
        held = _held(bound, poses, mapper)
    log = np.where(made.share > 0.0, held.log, poses.log)
    whole = free.match.skins is not None and not made.rest_on_body
    led = bound.posed(held)
    if whole:
        start = free.posed(poses)
        led = layered([made], start, _with_arms(led, start, unconstrained.motion, made, free))
    posed = layered([made], unconstrained.motion, met(bound, led, made), whole)
    bound = replace(bound, supports=blended_supports(free.supports, bound.supports, made.share))
    return replace(bound.result(replace(poses, log=log), posed=posed), unmet=tuple(unmet(bound, made, posed)))


def settled(performer: Performer, motion: Motion, constraints: Constraints, skin: BodySkin) -> Constraints:
    """Return constraints whose anchors are so far apart that the gaps of skin are as asked."""
    made = constraints.made
    for _ in range(SETTLES):
        motion = _closed(performer, motion, made)
        made = with_gaps(made, motion, skin)
    return replace(made, every=(*constraints.drops, *made))


def _held(performer: Performer, poses: Poses, mapper: Mapper) -> Poses:
    """The poses of a performer with constraints, changed steadily from those `poses` without them."""
    held = solve_contact(performer.clip, performer.supports, performer.settings, mapper=mapper)
    return replace(held, v=poses.v + _steady(performer, held.v - poses.v))


def _with_arms(held: Motion, free: Motion, apart: Motion, made: Constraints, performer: Performer) -> Motion:
    """A motion with the arms and shoulders of one without constraints; those of arms that are to reach for each other
    as skin keeps them `apart`, each on its own side.
    """
    clip, body = performer.clip, performer.match.matching.target
    trunk, arms = {0, clip.pelvis, *(body.anatomy.spine if body.anatomy else ())}, list[int]()
    for limb in limbs_of(body):
        shoulder = [joint for joint in clip.skeleton.line(limb.top) if joint not in trunk]
        arms += [*clip.skeleton.subtree(limb.top), *shoulder] if limb.is_arm else []
    meet = any({*constraint.pair} <= {*arms} for constraint in made if constraint.pair)
    rotations = np.array(held.rotations)
    rotations[:, arms] = (apart if meet else free).rotations[:, arms]
    return replace(held, rotations=rotations)


def _steady(performer: Performer, change: Array) -> Array:
    """What constraints change poses by, (frames, parts + 1, 3), averaged over time where nothing rests below a part."""
    held = held_parts(performer.clip, performer.supports, performer.settings)
    held = np.concatenate([held, held.max(axis=1, keepdims=True)], axis=1)[..., None]
    return held * change + (1.0 - held) * performer.clip.averaged(change, SMOOTHING)


def blended_supports(free: Supports, bound: Supports, share: Array) -> Supports:
    """Return supports with those of constraints where the share, (frames,), is 1, and `free` ones where it is 0."""
    own, share = np.zeros_like(bound.weights), share[:, None]
    own[:, : len(free.joints)] = free.weights
    return replace(bound, weights=(1.0 - share) * own + share * bound.weights)


def met(performer: Performer, motion: Motion, constraints: Constraints) -> Motion:
    """Return a motion that meets constraints. Skin stays outside: limbs bend out of it and to where constraints bring
    them in one solve; what that leaves is added to it in the next, as in the method of multipliers. Where parts are to
    rest on the body itself, they do, whatever skin they enter. Other frames are not solved.
    """
    skins, body, wanted = performer.match.skins, performer.match.matching.target, constraints.share > 0.0
    if skins is None or constraints.rest_on_body:
        closed = performer.with_own_skin(_closed(performer, motion, constraints), wanted=wanted)
        return _closed(performer, closed, constraints)  # what averages, and skin, have left
    limbs, weights = _reaching(performer, constraints), [constraint.weight for constraint in constraints]
    pairs = (skins.target.between(*constraint.joints) for constraint in constraints if constraint.anchors)
    anchored = np.concatenate([np.zeros(0, np.intp), *pairs])
    before = limbs.arms_out_of_trunk(with_looks(motion, constraints, body), weights)
    for _ in range(FACES if len(anchored) else 1):
        before = limbs.with_gaps_closed(before, weights, SMOOTHING)
    gaps = [eased_gap(constraints, constraint, skins, before) for constraint in constraints]
    places = [weight * (gap is None) for weight, gap in zip(weights, gaps, strict=True)]
    displacements, firmness = limbs.displacements(before, places)
    best, least = before, np.inf
    for _ in range(TURNS):
        targets = LimbTargets(displacements / body.unit, firmness, tuple(filter(None, gaps)), anchored)
        now = performer.with_own_skin(before, targets, wanted)
        left = _farthest(performer, constraints, now)
        if left < least:
            best, least = now, left
        if left <= MET * body.height or not firmness.any():
            break
        displacements += (firmness == 1.0)[..., None] * limbs.displacements(now, places)[0]
    return with_looks(best, constraints, body)


def _closed(performer: Performer, motion: Motion, constraints: Constraints) -> Motion:
    """A motion that meets constraints, whatever skin its limbs enter."""
    limbs, weights, body = _reaching(performer, constraints), constraints.all_firmness, performer.match.matching.target
    motion = limbs.arms_out_of_trunk(with_looks(motion, constraints, body), weights)
    left, last = np.inf, np.inf
    for steady in CLOSING:
        motion, last = limbs.with_gaps_closed(motion, weights, steady), left
        left = _farthest(performer, constraints, motion)
        if left <= MET * body.height or left >= last:
            break
    return with_looks(motion, constraints, body)


def _reaching(performer: Performer, constraints: Constraints) -> LimbReach:
    """The limbs of a performer, to be moved to its constraints."""
    return LimbReach(constraints, performer.supports, performer.match.matching.target, performer.match.skins)


def _farthest(performer: Performer, constraints: Constraints, posed: Motion) -> float:
    """How far a motion is off its constraints, at most [file units]."""
    return float(max((off.max() for _, off in _off(performer, constraints, posed)), default=0.0))


def unmet(performer: Performer, constraints: Constraints, posed: Motion) -> Iterator[Remark]:
    """Yield for each constraint of a performer that a motion does not meet how far it is off."""
    for constraint, off in _off(performer, constraints, posed):
        if off.max() > NOTICED * performer.match.matching.target.height:
            name, worst = " - ".join(constraint.entry.named), int(off.argmax())
            cm = centimetres(performer.clip.unit) * off[worst]
            yield Remark(f"{name} is missed by up to {cm:.1f} cm, at frame {worst}", worst, *constraint.entry.named)


def _off(performer: Performer, constraints: Constraints, posed: Motion) -> Iterator[tuple[Constraint, Array]]:
    """Yield constraints, and how far they are off in a motion where they are to be met, (frames,) [file units]."""
    clip = constraints.clip
    for constraint in constraints:
        off = lengths(correction(constraints, constraint, posed, performer.supports, performer.match.skins)) * clip.unit
        yield constraint, np.where(constraint.frames & (constraint.weight == 1.0), off, 0.0)


def layered(several: Sequence[Constraints], without: Motion, held: Motion, whole: bool = False) -> Motion:
    """Return the motion `held` in the frames of all constraints, blended into that `without` them as they set in and
    let go; where it is the `whole`, which sets in and lets go by itself, in the first and last frames of that.
    """
    constraints = [constraint for each in several for constraint in each]
    lead = np.max([constraint.lead * constraint.frames for constraint in constraints], axis=0)
    share = np.max([smoothstep(each.share / EARLY) if whole else each.share * each.on for each in several], axis=0)
    shots = np.sum([each.clip.shots for each in several], axis=0)  # a new shot at the cuts of any performer
    return _blended(without, held, share, lead, shots)


def _blended(without: Motion, held: Motion, share: Array, lead: Numbers, shots: Shots) -> Motion:
    """Blend the motion `held` into the motion `without` by `share`, (frames,), 0 to 1. Outside, the difference at the
    nearest frame that is held fades out over the `lead` of that frame, (frames,) [frames].

    Frames farther away do not change, nor do frames across a cut between `shots`, (frames,).
    """
    roots, rotations = np.array(without.root_positions), np.array(without.rotations)
    for shot in slices_of(shots):
        on = shot.start + np.flatnonzero(share[shot])
        if len(on):
            reach = int(lead[shot].max())
            near = slice(max(int(on[0]) - reach, shot.start), min(int(on[-1]) + 1 + reach, shot.stop))
            added = _added(without[near], held[near], share[near], lead[near])
            moved = near.start + np.flatnonzero(added.any(axis=(1, 2)))
            added = added[moved - near.start]
            turned = _quaternions(rotations[moved]) * Rotation.from_rotvec(added[:, :-1].reshape(-1, 3))
            rotations[moved] = turned.as_quat().reshape(rotations[moved].shape)
            roots[moved] += added[:, -1]
    whole = share == 1.0
    roots[whole], rotations[whole] = held.root_positions[whole], held.rotations[whole]
    return replace(without, root_positions=roots, rotations=rotations)


def _added(without: Motion, held: Motion, share: Array, lead: Numbers) -> Array:
    """(frames, joints + 1, 3), the rotation vectors of joints [rad], and last the offset of the root, that are added to
    the frames of one shot.
    """
    turns = (_quaternions(without.rotations).inv() * _quaternions(held.rotations)).as_rotvec()
    offsets = held.root_positions - without.root_positions
    differ = np.concatenate([turns.reshape(len(offsets), -1, 3), offsets[:, None]], axis=1)
    added, spans = share[:, None, None] * differ, spans_of(share > 0.0).tolist()
    slope, goes_on = round(SLOPE / without.frame_time), GOES_ON / without.frame_time

    def beyond(edge: int, inner: int, frames: Numbers) -> Array:
        """What an edge of a span adds in frames beyond it, with the slope between it and a frame inside."""
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
            kept = of_first if after else 1.0
            added[frames] += kept * beyond(last, max(last - slope, before[0]), frames)
        if after:
            kept = 1.0 - of_first if before else 1.0
            added[frames] += kept * beyond(after[0], min(after[0] + slope, after[1] - 1), frames)
    return np.asarray(added)


def _quaternions(rotations: Array) -> Rotation:
    return Rotation.from_quat(rotations.reshape(-1, 4))


def _nearest(vectors: Array, to: Array) -> Array:
    """(joints + 1, 3), rotation vectors, the other way round where that is nearer; the last is none."""
    others = vectors * (1.0 - 2.0 * np.pi / np.maximum(lengths(vectors), LEAST)[:, None])
    others[-1] = vectors[-1]
    return np.where((lengths(others - to) < lengths(vectors - to))[:, None], others, vectors)


def _ease(t: NDArray[np.floating[Any]]) -> Array:
    """1 at 0, and 0 from 1 on, with the least jerk in between."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t))
