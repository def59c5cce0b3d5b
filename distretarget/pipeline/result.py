"""The result of retargeting: the motion, its baseline, metrics, warnings, and labels of its frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.engine_root import path_carriers
from distretarget.baseline.world import World
from distretarget.body.body import LOWEST_FRAMES, OFF_FLOOR, Body
from distretarget.body.skin_anchors import AnchoredSkin
from distretarget.body.tree_repairs import JointShift, Reparented
from distretarget.contact_entries import NO_CONTACTS, ContactList, DroppedContact
from distretarget.distances import DistanceProblem, posture_stress
from distretarget.errors import quoted
from distretarget.ik.spg import Effort
from distretarget.matching.matching import Matching
from distretarget.matching.undersides import Undersides
from distretarget.measure.comparison import (
    Comparison,
    Reference,
    find_arm_deviation,
    find_pops,
    find_shaking,
    find_turned,
)
from distretarget.measure.metrics import METRICS, NOT_RUN, Track, Tracks, Variant, clip_limits, clip_metrics, metrics_at
from distretarget.measure.skin import Skin, find_skin, find_surface
from distretarget.measure.verdict import Remark, limit_warnings, verdict
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import lowest_heights
from distretarget.numerics.parallel import mapper_for
from distretarget.numerics.vectors import Array, lengths
from distretarget.objectives.body_skin import Skins
from distretarget.objectives.paper import Postures
from distretarget.objectives.supports import RESTS, Supports
from distretarget.pipeline.causes import Causes
from distretarget.rig import rig_cached
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

COMPARED = 10  # time to measure a joint over that of its forward kinematics
TURNS = 15.0  # there is a warning if a body should turn by more than this and cannot [degrees]
NO_LEAP = 1.0  # who stays higher than this above the floor without rest does not leap, but flies or swims [leg lengths]
STRIDES = 12.0  # there is a warning if legs are farther apart at rest, seen from the side [degrees]
REACH = 0.025  # a resting joint is seen to miss its place from 5 % of a leg on, half a shoe's width [body units]
JUDGED = tuple(metric for metric in METRICS if metric.limit and metric.of_frames)  # the metrics that flag frames


@dataclass(frozen=True, eq=False)
class Match:
    """A source matched to its target."""

    world: World  # from the source's world to the target's
    matching: Matching  # which source joint drives which target joint
    skins: Skins | None = None  # their surfaces; None for stick figures
    mesh: SkinnedMesh | None = None  # of the target; None if its thickness is not that of a mesh
    source_mesh: SkinnedMesh | None = None  # of the source, if its own file has one
    skeleton: Skeleton | None = None  # of the target's file, if its parents or hips are others than the body's
    hips: JointShift | None = None  # from the hips of the target's file to those of its body; or None

    def in_file(self, motion: Motion) -> Motion:
        """Return a motion of the target's body on the skeleton of its file."""
        skeleton = self.skeleton
        motion = self.hips.inverse.motion(motion) if self.hips else motion
        return Reparented(skeleton, np.arange(len(skeleton))).motion(motion) if skeleton else motion

    @cached_property
    def undersides(self) -> Undersides | None:
        """The undersides of source and target, on which they rest; None for stick figures."""
        both = self.skins and (self.skins.source.capsules, self.skins.target.capsules)
        return Undersides.of(self.matching, both, self.mesh, self.source_mesh) if both else None

    @cached_property
    def anchored_skin(self) -> AnchoredSkin:
        """The skin of the target for anchors; that of an average body for a stick figure."""
        capsules = self.skins.target.capsules if self.skins else None
        return AnchoredSkin.of(self.matching.target, capsules, self.mesh)

    def on_body(self, motion: Motion) -> Motion:
        """Return a motion of the target's file on the skeleton of its body, the inverse of `in_file`."""
        own = self.matching.target.skeleton
        other_parents = (motion.skeleton.parents != own.parents).any()
        motion = Reparented(own, np.arange(len(own))).motion(motion) if other_parents else motion
        shift = Body.of(motion.skeleton).shift_to_thighs if (motion.skeleton.offsets != own.offsets).any() else None
        return shift.motion(motion) if shift else motion


@dataclass(frozen=True, eq=False, kw_only=True)
class Baseline:
    """A source and its rotation copy; attributes are as in `RetargetResult`."""

    match: Match
    source: Motion
    rotation_copy: Motion
    rise: float  # of the source, to the floor on which the target stands [source file units]
    distances: DistanceProblem

    @cached_property
    def reference(self) -> Reference:
        """The source, raised to the target's floor, as the reference of measurements."""
        match, up = self.match, self.match.world.up_vector
        source, target, skins, surface = match.matching.source, match.matching.target, None, None
        if match.skins:
            target_skin = _skin_of(target, match.skins.target.capsules, match.mesh)
            skins = _skin_of(source, match.skins.source.capsules, match.source_mesh), target_skin
            surface = find_surface(target.skeleton, match.skins.target.capsules, match.mesh)
        return Reference(self.source.moved(self.rise * up), match.matching, up, skins, surface)

    @cached_property
    def comparison(self) -> Comparison:
        """The rotation copy measured against the source, frame by frame."""
        return self.compared(self.reference)

    def compared(self, reference: Reference) -> Comparison:
        """Return the rotation copy measured against a reference, frame by frame."""
        comparison = reference.compare(self.match.on_body(self.rotation_copy))
        self.stress  # noqa: B018 - while its positions are known
        self.rotation_copy.clear_cache()
        return comparison

    @cached_property
    def stress(self) -> Array:
        """(frames,), `stress_of` the rotation copy."""
        return self.stress_of(self.rotation_copy)

    def stress_of(self, motion: Motion) -> Array:
        """(frames,), the stress of a motion, Eq. (2), over the squared height of the target's rest pose."""
        return self.relative * posture_stress(self.distances, self.source.positions, motion.positions)

    @property
    def relative(self) -> float:
        """The factor from stress in body sizes squared to stress in target heights squared."""
        return (self.distances.body_size / self.match.matching.target.height) ** 2


@rig_cached
def _skin_of(body: Body, capsules: Capsules, mesh: SkinnedMesh | None) -> Skin:
    return find_skin(body, capsules, mesh)


@dataclass(frozen=True, eq=False, kw_only=True)
class RetargetResult:
    """A retargeted motion, with its source, baseline, matching and solver effort.

    Attributes:
        baseline: the source and the rotation copy, which are the same for all results of a clip on a target.
        motion: on the target, with the source's frames and frame time.
        root_scale: target units per source unit of the root's path.
        effort: the solver's effort on each frame.
        supports: the joints that rest on the world, and their places; empty where all are free, as with the paper's
            objective.
        postures: the paper's solved points; None for the contact objective.
        contact_list: the entries of the contact file that it was made with.
        unmet: remarks on entries that are not fully met.
        drops: contacts that entries drop or replace; measurements leave them out.
    """

    baseline: Baseline
    motion: Motion
    root_scale: float
    effort: Effort
    supports: Supports
    postures: Postures | None
    contact_list: ContactList = NO_CONTACTS
    unmet: tuple[Remark, ...] = ()
    drops: tuple[DroppedContact, ...] = ()

    def __repr__(self) -> str:
        return f"<RetargetResult of {len(self.motion)} frames, mean stress {self.written_stress.mean():.3g}>"

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{name}</th>" for name in ("", "source", "copied rotations", "result"))
        rows = [
            f"<tr><th>{escape(f'{metric.label} {metric.symbol}')}</th>"
            + "".join(f"<td>{metric.brief(metrics.get(metric.key))}</td>" for metrics in self.metrics.values())
            for metric in metrics_at("line")
        ]
        lines = "".join(f"<p>{escape(line)}</p>" for line in (self.verdict, *self.warnings))
        return f"{self.motion._repr_html_()}<table><tr>{head}</tr>{'</tr>'.join(rows)}</tr></table>{lines}"

    @property
    def source(self) -> Motion:
        """The source's motion, in the target's world."""
        return self.baseline.source

    @property
    def rotation_copy(self) -> Motion:
        """The source's rotations on the target's bones."""
        return self.baseline.rotation_copy

    @property
    def matching(self) -> Matching:
        """Which source joint drives which target joint, and the two bodies."""
        return self.baseline.match.matching

    @property
    def world(self) -> World:
        """The axes, and the root's OFFSET."""
        return self.baseline.match.world

    @property
    def skins(self) -> Skins | None:
        """The surfaces of source and target; None for stick figures."""
        return self.baseline.match.skins

    @property
    def mesh(self) -> SkinnedMesh | None:
        """The target's mesh for the metrics of skin; None if these are measured by capsules."""
        return self.baseline.match.mesh

    @property
    def drivers(self) -> NDArray[np.intp]:
        """(target joints,), the source joint that drives each target joint, -1 for none."""
        return self.matching.drivers

    @property
    def copy_stress(self) -> Array:
        """(frames,), the stress of the rotation copy, Eq. (2), over the squared height of the target's rest pose."""
        return self.baseline.stress

    @cached_property
    def written_stress(self) -> Array:
        """(frames,), the stress of `motion`."""
        return self.baseline.stress_of(self.motion)

    @property
    def free_stress(self) -> Array | None:
        """(frames,), the stress of the paper's solved points; None without them."""
        return None if self.postures is None else self.baseline.relative * self.postures.stress

    @property
    def comparison(self) -> Comparison:
        """The result measured against the source, frame by frame."""
        return self._comparisons[0]

    @cached_property
    def _comparisons(self) -> tuple[Comparison, Comparison]:
        """Result and rotation copy measured against the source, which is itself measured once."""
        baseline, reference, of_copy = self.baseline, self.baseline.reference, lambda: self.baseline.comparison
        if self.drops:
            of_joint = self.skins.target.of_joint if self.skins else np.full(len(self.motion.skeleton), -1)
            reference = reference.without(self.drops, of_joint)
            of_copy = partial(baseline.compared, reference)
        side_by_side = mapper_for(len(self.motion), COMPARED * len(self.motion.skeleton))
        copy, result = side_by_side(lambda compare: compare(), (of_copy, partial(self._compared, reference)))
        return result, copy

    def _compared(self, reference: Reference) -> Comparison:
        comparison = reference.compare(self.baseline.match.on_body(self.motion))
        self.written_stress  # noqa: B018 - while its positions are known
        self.motion.clear_cache()
        return comparison

    @cached_property
    def tracks(self) -> dict[Variant, Tracks]:
        """The tracks of the metrics of source, rotation copy and result."""
        comparison, baseline = self._comparisons
        return {
            "source": comparison.source_tracks,
            "rotation_copy": {**baseline.tracks, "stress": Track(self.copy_stress), **NOT_RUN},
            "result": {**comparison.tracks, "stress": Track(self.written_stress), **self.run_tracks},
        }

    @cached_property
    def run_tracks(self) -> Tracks:
        """The tracks that only a run has: against the rotation copy, and frames that did not converge."""
        not_converged = np.zeros(len(self.motion))
        not_converged[self.effort.not_converged] = 1.0
        body, (of_result, of_copy) = self.matching.target, self._comparisons
        free = np.any([np.zeros(len(self.motion), bool), *(drop.frames for drop in self.drops)], axis=0)
        motions = self.baseline.match.on_body(self.rotation_copy), self.baseline.match.on_body(self.motion)
        shots, keys = self.matching.source.shots_of(self.source), self.motion.skeleton.keys
        return {
            "turned": find_turned(*motions, body),
            "arm_deviation": find_arm_deviation(*motions, body, of_copy, of_result, free),
            "shaking": Track(find_shaking(*motions, body, shots), parts=keys),
            "pop": Track(find_pops(*motions, body, shots), parts=keys),
            "not_converged": Track(not_converged),
        }

    @cached_property
    def metrics(self) -> dict[Variant, dict[str, float | None]]:
        """The metrics of the clip, by key, of source, rotation copy and result; None where nothing was measured."""
        return {side: clip_metrics(tracks) for side, tracks in self.tracks.items()}

    @property
    def verdict(self) -> str:
        """What was kept and what changed, in a sentence, with the names of metrics over their limits."""
        return "".join(self.remarks)

    @cached_property
    def remarks(self) -> tuple[Remark, ...]:
        """The verdict in parts, each with its frame and part of the body."""
        lost = [Remark(f"T{line[1:]}.") for line in self._lost_turn()]
        parts = lost or [*verdict(self.metrics, self.tracks)]
        for number, line in enumerate(self.unmet):
            parts += [Remark("; " if number else " Constraints met in part: "), line]
        return (*parts, *[Remark(".")] * bool(self.unmet))

    @property
    def labels(self) -> dict[str, NDArray[Any]]:
        """The labels of the frames, as `write_npz` writes them. All results on one target have the same names.

        - `support_names`, (joints,), and `support_weights`, (frames, joints): the target's joints, and how firmly each
          rests on the world, 1 while the source's joint rests, blended to 0.
        - `contact_names`, (pairs,), and `contact_gaps`, (frames, pairs): the regions of the body that can touch, and
          while they touch in the source how far their nearest joints are apart in the result [file units]; nan while
          they do not.
        - `shots`, (frames,): the number of the shot of each frame, from 0; it goes up at a cut.
        - `not_converged`, (frames,): whether the solver did not converge.
        - `flag_names`, (flags,), and `flags`, (frames, flags): the metrics with a limit, and whether a frame is
          above it, of the metrics that are over their limits in the clip as a whole.
        """
        weights = np.zeros((len(self.motion), len(self.motion.skeleton)))
        for joint, weight in zip(self.supports.joints, self.supports.weights.T, strict=True):  # an ankle may be its toe
            weights[:, joint] = np.maximum(weights[:, joint], weight)
        contact_names, contact_gaps = _contact_gaps(self)
        return {
            "support_names": np.array(self.motion.skeleton.keys, np.str_),
            "support_weights": weights,
            "contact_names": np.array(contact_names, np.str_),
            "contact_gaps": contact_gaps,
            "shots": self.matching.source.shots_of(self.source),
            "not_converged": self.run_tracks["not_converged"].values > 0.0,
            "flag_names": np.array([metric.key for metric in JUDGED], np.str_),
            "flags": _flags(self),
        }

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Warnings, one line each: first on faults of the two bodies, then on metrics over their limits and resting
        joints that miss their places. The latter are left out if the body cannot turn, which explains them.
        """
        lost_turn = (*self._lost_turn(),)
        odd = (*self._lost_path(), *lost_turn, *self._doubtful_sides(), *self._strides_at_rest(), *self._off_floor())
        if lost_turn:
            return (*odd, *self.unmet)
        causes = Causes(self.motion, self.matching, self.supports, self.effort)
        over = limit_warnings(self.metrics, self.tracks, causes.of)
        return (*odd, *over, *self._missed_places(causes), *self.unmet)

    def _lost_path(self) -> Iterator[Remark]:
        travels = len(self.source) > 0 and np.ptp(self.source.root_positions, axis=0).any()
        if travels and path_carriers(self.motion.skeleton, self.matching.body_joints) is None:
            root = self.motion.skeleton.names[0]
            lack = f"the target's root {root!r} and the joints below lack position channels"
            yield Remark(f"the body stays in place: {lack}")

    def _lost_turn(self) -> Iterator[Remark]:
        skeleton, pelvis = self.motion.skeleton, self.matching.pelvis
        if any(skeleton.rotation_axes(joint) for joint in skeleton.to_root(pelvis)):
            return
        turn = np.degrees(Rotation.from_quat(self.rotation_copy.world_rotations_of(pelvis)).magnitude()).max(
            initial=0.0
        )
        if turn > TURNS:
            lack = f"the target's root {skeleton.names[0]!r} lacks rotation channels"
            yield Remark(f"the body keeps its heading and does not turn, by up to {turn:.0f} degrees: {lack}")

    def _doubtful_sides(self) -> Iterator[Remark]:
        for name, body in (("source", self.matching.source), ("target", self.matching.target)):
            if body.anatomy and (what := body.anatomy.swapped_sides):
                named = "left and right" if what == "sides" else f"left and right of the {what}"
                yield Remark(f"the {name}'s names exchange {named}; they are taken as the body shows them")
            elif body.anatomy and body.anatomy.method == "shape" and not body.stands and body.motion is None:
                first = "the side that comes first in the file is taken for it; give a map, or names of joints"
                yield Remark(f"neither names nor rest pose show the left side of the {name}: {first}")

    def _strides_at_rest(self) -> Iterator[Remark]:
        advice = {"source": "give a pose in which it stands with --rest", "target": "export it in a T-pose or A-pose"}
        for name, body in (("source", self.matching.source), ("target", self.matching.target)):
            matters = body.stands_at_rest and body.standing is None and not self.matching.is_same_rig
            if matters and body.at_rest and body.at_rest.stride > STRIDES:
                taken = f"the {name} strides at rest, and how trunk, hands and head turn there is taken for its build"
                yield Remark(f"{taken}; {advice[name]}")

    def _off_floor(self) -> Iterator[Remark]:
        source, body = self.source, self.matching.source
        if len(source) and body.legs:
            joints = np.flatnonzero(body.regions.of_joint >= 0)
            heights = lowest_heights(source.positions, self.world.up_vector, joints) / body.leg_length
            low, high = np.percentile(heights, [LOWEST_FRAMES, 100.0 - LOWEST_FRAMES])
            if high < -OFF_FLOOR or low > (OFF_FLOOR if self.supports.weights.any() else NO_LEAP):
                off, side = (-high, "below") if high < 0.0 else (low, "above")
                yield Remark(f"the source stays {100.0 * off:.0f} % of a leg {side} height 0, and the result with it")

    def _missed_places(self, causes: Causes) -> Iterator[Remark]:
        held, keys = self.supports, self.motion.skeleton.keys
        away = lengths(self.motion.positions_of(held.joints) - held.places) / self.matching.target.unit
        short = np.where((held.weights > RESTS) & (away > REACH), away, 0.0)
        frames = np.flatnonzero(short.any(axis=1))
        if len(frames):
            worst, support = np.unravel_index(short.argmax(), short.shape)
            short_of = dict.fromkeys(keys[joint] for joint in held.joints[short.any(axis=0)])  # an ankle may be its toe
            leg = causes.leg_of(int(support))
            stretched = leg is not None and causes.is_straight(leg, int(worst))
            missing, most = 200 * short[worst, support], keys[held.joints[support]]  # a body unit is two legs long
            yield Remark(
                f"resting joints do not reach their places in {len(frames)} of {len(short)} frames (first: frame "
                f"{frames[0]}): {quoted(short_of)}; most: {most} in frame {worst}, {missing:.1f} % of a leg away"
                f"{', because the leg is straight' if stretched else ''}",
                int(worst),
                most,
            )


def _contact_gaps(result: RetargetResult) -> tuple[list[str], NDArray[np.float64]]:
    """The pairs of regions of the target that are no neighbours, and their gaps."""
    contacts, regions, positions = result.comparison.contacts, result.matching.target.regions, result.motion.positions
    pairs = np.argwhere(np.triu(~regions.neighbours, 1)).tolist()
    names = [f"{regions.names[a]} - {regions.names[b]}" for a, b in pairs]
    columns = np.array([names.index(name) for name in contacts.candidates.names], np.intp)
    gaps = np.full((len(positions), len(names)), np.nan)
    apart = positions[contacts.frame, contacts.u] - positions[contacts.frame, contacts.v]
    gaps[contacts.frame, columns[contacts.regions]] = lengths(apart)
    return names, gaps


def _flags(result: RetargetResult) -> NDArray[np.bool_]:
    frames, tracks, limits = len(result.motion), result.tracks["result"], clip_limits(result.metrics)
    flags = np.zeros((frames, len(JUDGED)), bool)
    for column, metric in enumerate(JUDGED):
        limit = limits[metric.key]
        if limit is not None and metric.over_limit(result.metrics):
            flags[:, column] = metric.over_time(tracks, frames) > (0.0 if metric.reduction == "frames" else limit)
    return flags
