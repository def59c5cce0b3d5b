"""A performer: a source and its target, from the match of the two to the result of the solved poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.engine_root import EngineRoot, along_channels, find_engine_root
from distretarget.baseline.rotation_copy import RootScale
from distretarget.baseline.world import find_world
from distretarget.body.body import Body
from distretarget.body.build import OWN_BUILDS, Build, Builds, bare_mesh, capsules_by_build, capsules_of
from distretarget.body.single_bones import straightened
from distretarget.body.tree_repairs import JointShift, without_exported_ends, without_twins
from distretarget.errors import MotionError
from distretarget.ik.poses import LEAST_TURN, Poses, fit_rotations, posed_motion
from distretarget.matching.matching import Matching, match
from distretarget.motion import Motion, check_usable
from distretarget.numerics.vectors import Array, Flags, extent, lengths
from distretarget.objectives.activation import DEFAULT_SETTINGS, ContactSettings
from distretarget.objectives.body_skin import Skins
from distretarget.objectives.clip import Clip
from distretarget.objectives.floor import find_flesh, find_floor_springs, rise_of_flesh
from distretarget.objectives.foot_lock import feet_within_reach, find_foot_lock, hips_rise
from distretarget.objectives.heels import with_low_heels
from distretarget.objectives.leg_bends import with_straight_knees, with_swinging_feet_up
from distretarget.objectives.paper import Postures
from distretarget.objectives.resting_joints import find_resting_joints, root_shift, with_resting_joints
from distretarget.objectives.skin import LimbTargets, with_skin
from distretarget.objectives.supports import Supports, no_supports
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.result import Baseline, Match, RetargetResult
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh
from distretarget.target import AnyTarget, LoadedTarget, SkeletonEdit, Target

HIPS_RANGE = 2.0  # most distance of the hips from the root's path [body units]
FEET_RANGE = 3.0  # most distance of an ankle from the rotation copy's on that path [body units]
ROUNDING_ERROR = 1e-9  # rounding error far from the origin [of the distance from it]
REPORT = "please report this with the clip and the target"


@dataclass(frozen=True, eq=False)
class Transfer:
    """The parameters of `retarget` that decide how a source is matched to its target."""

    source: Motion
    target: AnyTarget
    options: Options = DEFAULT_OPTIONS
    joint_map: JointMap | None = None
    rest: Motion | None = None
    builds: Builds = OWN_BUILDS

    @property
    def loaded(self) -> LoadedTarget:
        """The target as `load_target` returns it."""
        match self.target:
            case Motion():
                return Target(self.target.rigid_skeleton, {}, "", self.target)
            case Skeleton():
                return Target(self.target, {}, "")
            case _:
                return self.target

    @property
    def goal(self) -> Target:
        """The body to retarget to."""
        return self.loaded.for_source(self.source.rigid_skeleton)


def match_performer(transfer: Transfer) -> Match:
    """Match a source to its target; errors as in `retarget`."""
    goal, hips = _with_hips_at_thighs(transfer.goal)
    matched = _match_joints(transfer, goal, hips)
    has_skin = transfer.options.objective != "paper" and transfer.options.skin != "none"
    matched = _with_skins(matched, transfer, goal) if has_skin else matched
    matching, on_mesh = matched.matching, matched.undersides is not None and matched.undersides.feet_on_mesh
    shown = matching.with_resting_soles if on_mesh else matching.with_untilted_soles
    return matched if shown is matching else replace(matched, matching=shown)


@lru_cache(maxsize=4)
def _with_hips_at_thighs(goal: Target) -> tuple[Target, JointShift | None]:
    """A target with its hips joint at its thighs, and how far it is from there in the file; None if it is there.
    Cached for a batch of clips with the same target.
    """
    hips = Body.of(goal.skeleton, goal.motion).shift_to_thighs
    if hips is None:
        return goal, None
    moved = replace(
        goal,
        skeleton=hips.skeleton(goal.skeleton),
        motion=goal.motion and hips.motion(goal.motion),
        mesh=cache(lambda: (mesh := goal.mesh()) and hips.mesh(mesh)),
        capsules=goal.capsules and hips.capsules(goal.capsules),
    )
    return moved, hips


def _match_joints(transfer: Transfer, goal: Target, hips: JointShift | None) -> Match:
    """The match of a source to its target, without skins."""
    in_file, options = transfer.goal.skeleton, transfer.options
    check_usable(transfer.source, "the source")
    if not in_file.lengths.max() >= SMALLEST:
        raise MotionError(f"no bone of the target has a length; its OFFSETs are all below {SMALLEST:g}")
    pairs = {**goal.map, **(transfer.joint_map or {})}
    named = {*filter(None, pairs.values())}

    def repaired(motion: Motion) -> Motion:
        return without_twins(without_exported_ends(motion, in_file, named), named)

    source_body = Body.of_motion(repaired(transfer.source)).with_hips_at_thighs
    if transfer.rest is not None:
        source_body = source_body.standing_as(repaired(transfer.rest))
    body = Body.of(goal.skeleton, goal.motion)
    ups = {"source_up": options.source_up, "target_up": options.target_up}
    world = find_world(source_body, body, **ups, root_offset=options.root_offset)
    matching = match(straightened(world.to_target_axes(source_body), body), body.with_up(world.up), pairs)
    is_other = hips or (body.skeleton.parents != in_file.parents).any()
    return Match(world, matching, skeleton=in_file if is_other else None, hips=hips)


def _with_skins(matched: Match, transfer: Transfer, goal: Target) -> Match:
    """The match with the skins of both bodies, if they are known, and with the soles that these show."""
    builds, matching = transfer.builds, matched.matching
    mesh = None if builds.target else _bare(goal)
    source_build = builds.source or _build_of_rig(matching, goal, mesh, transfer)
    skins = _find_skins(matching, goal, source_build, transfer)
    if skins is None:
        return matched
    source_mesh = source_build.mesh_on(matching.source.skeleton) if source_build else None
    skins = skins.on_meshes(source_mesh, mesh, matching)
    matching = matching.with_mesh_soles(mesh)
    return replace(matched, matching=matching, skins=skins, mesh=mesh, source_mesh=source_mesh)


def _build_of_rig(matching: Matching, goal: Target, mesh: SkinnedMesh | None, transfer: Transfer) -> Build | None:
    """The build of the target, with its mesh, for a source that is the same rig and so as thick; else None."""
    own = goal.is_measured and transfer.builds.target is None and transfer.options.skin != "average"
    if not own or not matching.is_same_rig or matching.target.anatomy is None:
        return None
    return Build.of(matching.target, _capsules_of(goal, matching.target), mesh)


def _find_skins(matching: Matching, goal: Target, source_build: Build | None, transfer: Transfer) -> Skins | None:
    """Skins of source and target; None without capsules or thickness. A changed source has the source's build."""
    builds, average = transfer.builds, transfer.options.skin == "average"
    build = builds.target or (builds.source if isinstance(transfer.target, SkeletonEdit) else None)
    if not (average or build or goal.is_measured):
        return None
    source, build = capsules_by_build(matching.source, source_build), None if average else build
    target = capsules_by_build(matching.target, build) if build or average else _capsules_of(goal, matching.target)
    return Skins.of(matching, source, target)


@lru_cache(maxsize=4)
def _bare(target: Target) -> SkinnedMesh | None:
    """The mesh of a human target without what its hands hold, cached for a batch of clips with the same target."""
    mesh, body = target.mesh(), Body.of(target.skeleton, target.motion)
    return bare_mesh(body, mesh) if mesh and body.anatomy else None


def _capsules_of(target: Target, matched: Body) -> Capsules:
    """The capsules of a target as it is matched: left and right may be exchanged in its names."""
    body = Body.of(target.skeleton, target.motion)
    is_mirrored = matched.anatomy != body.anatomy and matched.anatomy == body.mirrored.anatomy
    return capsules_of(body.mirrored, target.mesh(), target.radii) if is_mirrored else target_capsules(target)


@lru_cache(maxsize=4)
def target_capsules(target: Target) -> Capsules:
    """Return the capsules of a target, from its mesh or radii, or of an average body."""
    if target.capsules is not None:
        return target.capsules
    return capsules_of(Body.of(target.skeleton, target.motion), target.mesh(), target.radii)


@dataclass(frozen=True, eq=False)
class Performer:
    """A matched source and target, with the inputs of the solvers; it turns their poses into a result."""

    match: Match  # source and target
    engine_root: EngineRoot  # the target's root on the floor, if it has one
    clip: Clip  # the clip for the solvers
    baseline: Baseline  # against which its results are measured
    supports: Supports  # the joints that rest on the world
    settings: ContactSettings  # of the contact objective

    @classmethod
    def of(cls, match: Match, scale: RootScale, options: Options = DEFAULT_OPTIONS) -> Performer:
        """Return the performer of a match at a scale, without supports; a MotionError if there is no root to follow."""
        engine_root = find_engine_root(match.matching, scale, options.root_follows)
        clip = Clip.of(match.matching, scale)
        clip = replace(clip, by_skin=match.skins.target.can_touch) if match.skins else clip
        baseline = Baseline(
            match=match,
            source=clip.source,
            rotation_copy=match.in_file(along_channels(engine_root.placed(clip.copy), match.matching.body_joints)),
            rise=scale.rise / scale.height,
            distances=clip.distances,
        )
        return cls(match, engine_root, clip, baseline, no_supports(len(clip)), DEFAULT_SETTINGS)

    def with_supports(self, options: Options, settings: ContactSettings) -> Performer:
        """Return the performer with the supports found in the source, and its root path adapted to them."""
        undersides = self.match.undersides
        clip = self.clip if options.supports == "free" else with_low_heels(self.clip, undersides)
        feet = find_foot_lock(clip, undersides)
        clip = clip.raised(np.outer(hips_rise(clip, feet, undersides), clip.up))
        supports = feet
        if options.supports == "hold":
            if resting := find_resting_joints(clip, feet, options.environment, undersides):
                clip = clip.raised(root_shift(clip, feet, resting))
                supports = with_resting_joints(clip, feet, resting)
            flesh = find_flesh(clip, supports.weights, undersides)
            clip = clip.raised(np.outer(rise_of_flesh(clip, supports, flesh), clip.up))
            supports = feet_within_reach(clip, supports)
            supports = replace(supports, floor=find_floor_springs(clip, supports.weights, undersides, flesh))
        if options.supports != "free":
            limbs = self.match.matching.target.limbs
            clip = with_straight_knees(with_swinging_feet_up(clip, feet, limbs, undersides), supports, limbs)
        else:
            settings = replace(settings, foot_lock=0.0)
        return replace(self, clip=clip, supports=supports, settings=settings)

    def posed(self, poses: Poses) -> Motion:
        """Return the motion of the poses, before limbs are bent by skin and a root on the floor is placed."""
        return posed_motion(self.clip.copy, poses.v, self.clip.parts, self.clip.root + poses.v[:, -1])

    def with_own_skin(
        self,
        posed: Motion,
        targets: LimbTargets | None = None,
        wanted: Flags | None = None,
        self_contact: Array | None = None,
    ) -> Motion:
        """Return a motion with its limbs bent by `with_skin`; the same motion without skin."""
        if skins := self.match.skins:
            return with_skin(self.clip, skins, posed, self.supports, self.settings, targets, wanted, self_contact)
        return posed

    def result(self, poses: Poses, postures: Postures | None = None, posed: Motion | None = None) -> RetargetResult:
        """Return the result of the poses, with the paper's points if any. `posed` is its motion; by default that of the
        poses with limbs bent by the performer's own skin. A MotionError that names joint and frame if it is wrong.
        """
        self.clip.copy.clear_cache()  # poses are solved; turning the copy by them takes no positions
        posed = self.with_own_skin(self.posed(poses)) if posed is None else posed
        if self._lacks_channels(posed):  # take the closest motion
            moved = replace(self.clip.copy, root_positions=posed.root_positions)
            posed = fit_rotations(moved, posed.positions, np.arange(1, len(posed.skeleton)), self.clip.roots)
        placed = along_channels(self.engine_root.placed(posed), self.match.matching.body_joints)
        motion = self.match.in_file(placed)
        check_finite(motion)
        check_places(posed, self.clip)
        for each in (motion, self.baseline.rotation_copy):  # frees memory, as writing takes no positions
            each.clear_cache()
        return RetargetResult(
            baseline=self.baseline,
            motion=motion,
            root_scale=self.clip.scale.height,
            effort=poses.effort,
            supports=self.supports if self.settings.foot_lock else no_supports(len(motion)),
            postures=postures,
            drops=self.clip.drops,
        )

    def _lacks_channels(self, posed: Motion) -> bool:
        """Whether a joint may need rotations for which it has too few channels."""
        skeleton, turns = posed.skeleton, np.abs(posed.rotations[..., :3]).max(axis=(0, 2), initial=0.0)
        axes = [len(skeleton.rotation_axes(joint)) for joint in range(len(skeleton))]
        inner = [bool(each) for each in skeleton.children]
        each = zip(axes, inner, turns, strict=True)
        return any(0 < own < 3 or (not own and carries and turn > LEAST_TURN) for own, carries, turn in each)


def check_places(posed: Motion, clip: Clip) -> None:
    """Raise a MotionError unless a result has its source's frames, and hips and ankles near those of the copy."""
    if len(posed) != len(clip):
        raise MotionError(f"the result has {len(posed)} frames, the source {len(clip)}; {REPORT}")
    joints = np.array([clip.pelvis, *(pair.target.ankle for pair in clip.legs)])
    copied = clip.copy_on_path(joints)
    away = lengths(posed.positions_of(joints) - copied) / (clip.unit + ROUNDING_ERROR * extent(copied[:, 0]))
    for some, most in ((slice(1), HIPS_RANGE), (slice(1, None), FEET_RANGE)):
        far = f"is more than {most:g} heights away from where copied rotations put it"
        _refuse_first(~(away[:, some] <= most), posed, joints[some], far)


def check_finite(motion: Motion) -> None:
    """Check that all positions are finite, and within the bound; a MotionError that names joint and frame if not."""
    if extent(motion.positions) <= LARGEST:
        return
    joints, farthest = np.arange(len(motion.skeleton)), np.abs(motion.positions).max(axis=2)
    _refuse_first(~np.isfinite(farthest), motion, joints, "is nowhere, at no finite position")
    _refuse_first(
        farthest > LARGEST, motion, joints, f"is beyond {LARGEST:g}", "use other units, or a smaller root scale"
    )


def _refuse_first(
    wrong: NDArray[np.bool_], motion: Motion, joints: NDArray[np.intp], fault: str, advice: str = REPORT
) -> None:
    """Raise an error for the first frame in which a joint is wrong, (frames, joints), if there is one."""
    if wrong.any():
        frame, column = np.argwhere(wrong)[0]
        key = motion.skeleton.keys[joints[column]]
        raise MotionError(f"frame {frame} of the result is wrong: {key!r} {fault}; {advice}")
