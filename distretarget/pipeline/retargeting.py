"""Retarget one clip: motion and target in, motion and metrics out; or files in, and the clip to write out."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import NoneType

import numpy as np

from distretarget.baseline.rotation_copy import RootScale, find_root_scale
from distretarget.baseline.world import raised_onto_soles
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.checks import check_callable, check_kind
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import SAY_IN_A_MAP, MatchingError, in_file, quoted
from distretarget.ik.poses import Mapper, Progress, ignore_progress
from distretarget.io.files import STANDARD_INPUT
from distretarget.io.gltf_scene import FACE_LEFT_OUT, find_expressions
from distretarget.io.input_file import InputFile, OutputKind
from distretarget.io.map_json import MapFile, joint_map
from distretarget.io.motion_writer import DEFAULT_OUTPUT, NamedClip, OutputSettings, as_written
from distretarget.io.reading import CharacterTarget, TargetFile, parse_motion, with_source
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_threads
from distretarget.numerics.vectors import Array
from distretarget.objectives.activation import DEFAULT_SETTINGS, ContactSettings
from distretarget.objectives.constraints import Constraints
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.paper import find_distances, solve_paper
from distretarget.pipeline.constrained_motion import Unconstrained, blended_in, constrained_result, unmet, without_drops
from distretarget.pipeline.edits import NO_EDITS, Edits
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.performer import Performer, Transfer, match_performer
from distretarget.pipeline.result import RetargetResult
from distretarget.skeleton import JointMap, Skeleton
from distretarget.target import AnyTarget, LoadedTarget, SkeletonEdit, Target

MOST_NAMES = 12  # of expressions in a line


def retarget(
    source: Motion,
    target: AnyTarget,
    options: Options = DEFAULT_OPTIONS,
    *,
    joint_map: JointMap | None = None,
    rest: Motion | None = None,
    builds: Builds = OWN_BUILDS,
    settings: ContactSettings = DEFAULT_SETTINGS,
    contacts: ContactList = NO_CONTACTS,
    mapper: Mapper | None = None,
    progress: Progress | None = None,
) -> RetargetResult:
    """Retarget a motion to another body.

    Args:
        source: the motion to retarget.
        target: the body to retarget it to, with any names, rest pose and axes: the result of `load_target`, with the
            joint map of its file; a skeleton; or a motion of the body, which also shows its axes, and how its limbs
            bend where the rest pose does not.
        options: how to retarget it.
        joint_map: the source key for each target key, or None for joints that nothing should drive; it overrides the
            target file's map. All other joints are matched by names or by shape.
        rest: a motion of the source's joints in whose first frame the body stands, in T-pose, A-pose or with arms down,
            for a source whose rest pose does not show it (`docs/rigs.md`).
        builds: how thick the bodies are, if another file than their own shows it (`load_build`). By default a source
            that is the target's rig is as thick as the target, and any other an average body of its age.
        settings: of the contact objective; the paper's objective has none.
        contacts: which contacts to keep, drop, make or change, which parts to plant, and which distances and directions
            to keep (`load_contacts`, `find_contacts`); all others are kept as found.
        mapper: solves the chunks of a long clip: `map`, the `map` of an executor, or by default one thread per core.
            The result is the same. The paper's objective has no chunks.
        progress: called with the number of frames solved since the last call.

    Raises:
        MatchingError: the two bodies cannot be matched.
        MapError: `joint_map` names joints that are not there.
        MotionError: the source has no frames, or positions too large to compute with, or a body has no extent; or
            the root is to follow the source's root, and the source has none on the floor; or `rest` has other joints
            than the source, or nobody stands in it.
        ContactsError: an entry of `contacts` does not suit the clip.
        SettingsError: an argument has the wrong type.
    """
    check_kind("source", source, Motion)
    check_kind("target", target, Motion, Skeleton, Target, SkeletonEdit)
    check_kind("options", options, Options)
    check_kind("joint_map", joint_map, Mapping, NoneType)
    check_kind("rest", rest, Motion, NoneType)
    check_kind("builds", builds, Builds)
    check_kind("settings", settings, ContactSettings)
    check_kind("contacts", contacts, ContactList)
    mapper, progress = in_threads if mapper is None else mapper, ignore_progress if progress is None else progress
    check_callable("mapper", mapper)
    check_callable("progress", progress)
    transfer = Transfer(source, target, options, joint_map, rest, builds)
    return prepare(transfer, settings).solved(contacts, mapper, progress)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A clip on its target, with all that does not depend on user constraints, for several results."""

    performer: Performer  # source and target, with the supports of the source
    options: Options
    unconstrained: Unconstrained | None = None  # its solution without user constraints, once it is `once_solved`

    def solved(
        self, contacts: ContactList = NO_CONTACTS, mapper: Mapper = in_threads, progress: Progress = ignore_progress
    ) -> RetargetResult:
        """Return the result with user constraints; parameters and errors as in `retarget`."""
        performer = self.performer
        blend = performer.settings.blend
        constraints = Constraints.of(contacts, performer.clip, performer.match.anchored_skin, blend)
        if self.options.objective == "paper":
            return _by_paper(performer, contacts, constraints, progress)
        free = without_drops(performer, constraints.drops)
        if free is performer or performer.match.skins:
            unconstrained = self.unconstrained or _unconstrained(performer, mapper, progress)
            unconstrained = unconstrained.without(constraints.drops, free, mapper)
        else:  # springs take so little time that all frames are solved again
            unconstrained = _unconstrained(free, mapper, progress)
        if not constraints.made:
            return replace(free.result(unconstrained.poses, posed=unconstrained.motion), contact_list=contacts)
        return replace(constrained_result(free, unconstrained, constraints, mapper), contact_list=contacts)

    def once_solved(self, progress: Progress = ignore_progress) -> Prepared:
        """Return it with `unconstrained` solved, unless the objective is the paper's."""
        if self.options.objective == "paper":
            return self
        return replace(self, unconstrained=_unconstrained(self.performer, in_threads, progress))


def _unconstrained(performer: Performer, mapper: Mapper, progress: Progress) -> Unconstrained:
    poses = solve_contact(performer.clip, performer.supports, performer.settings, mapper=mapper, progress=progress)
    performer.clip.copy.clear_cache()  # turning the copy by the poses takes no positions
    return Unconstrained(poses, performer.with_own_skin(performer.posed(poses)))


def prepare(transfer: Transfer, settings: ContactSettings = DEFAULT_SETTINGS) -> Prepared:
    """Match a clip to its target, and find its supports; errors as in `retarget`."""
    options, match = transfer.options, match_performer(transfer)
    match = replace(match, matching=raised_onto_soles(match.matching, options.root_scale, match.undersides))
    performer = Performer.of(match, RootScale.even(options.root_scale or find_root_scale(match.matching)), options)
    if options.objective == "paper":
        return Prepared(replace(performer, settings=settings), options)
    return Prepared(performer.with_supports(options, settings), options)


def _by_paper(
    performer: Performer, contacts: ContactList, constraints: Constraints, progress: Progress
) -> RetargetResult:
    """The result of the paper's objective, with the distances that a user sets."""
    distances = find_distances(contacts, constraints) if constraints else None
    poses, postures = solve_paper(performer.clip, progress)
    if distances is None:
        return performer.result(poses, postures)
    held, postures = solve_paper(performer.clip, set_by_user=distances)
    posed = blended_in([constraints], performer.posed(poses), performer.posed(held))
    result = performer.result(held, postures, posed=posed)
    return replace(result, contact_list=contacts, unmet=tuple(unmet(performer, constraints, posed)))


@contextmanager
def with_advice(source: str | Path, target: str | Path) -> Iterator[None]:
    """Make a MatchingError within name the file at fault, and advise to write a map, with the command for it."""
    try:
        yield
    except MatchingError as error:
        command = f"distretarget skeleton match {argument(source)} {argument(target)} -o MAP.json"
        advised = error.advised(f"{SAY_IN_A_MAP}: `{command}`, then --map MAP.json")
        raise advised.in_file(source if error.is_of_source else target) from error


def argument(path: str | Path) -> str:
    """Return the path as a command-line argument, quoted for a shell."""
    return "-" if path == STANDARD_INPUT else shlex.quote(str(path))


@dataclass(frozen=True)
class Recipe:
    """How clips are read, retargeted and written.

    Attributes:
        options: how to retarget.
        map_file: which source joint drives which target joint (`load_map`).
        clip: the animation to read of files that have several; "#2" is the second.
        fps: the frame rate to sample animations at [frames/s]; their own keys by default.
        writing: how motions are put into files.
        builds: how thick the bodies are, if other files than their own show it.
        edits: how each clip is cut, mirrored, turned, sped up or made a loop.

    Raises:
        SettingsError: a value has the wrong type.
    """

    options: Options = DEFAULT_OPTIONS
    map_file: MapFile = field(default_factory=lambda: MapFile({}, ""))
    clip: str | None = None
    fps: float | None = None
    writing: OutputSettings = DEFAULT_OUTPUT
    builds: Builds = OWN_BUILDS
    edits: Edits = NO_EDITS

    def __post_init__(self) -> None:
        check_kind("clip", self.clip, str, NoneType)
        kinds = {"options": Options, "map_file": MapFile, "writing": OutputSettings, "builds": Builds, "edits": Edits}
        for name, kind in kinds.items():
            check_kind(name, getattr(self, name), kind)

    @cached_property
    def settings(self) -> dict[str, object]:
        """All that decides an output, as JSON values: options, map, hashes of builds, and changed other settings."""
        pairs: dict[str, object] = {"map": dict(self.map_file.pairs) or None}
        if self.map_file.rest:
            pairs["rest"] = dict(self.map_file.rest.rotations)
        sides = {"source_build": self.builds.source, "target_build": self.builds.target}
        hashes = {side: build.hash for side, build in sides.items() if build is not None}
        defaults = {"clip": None, "fps": None, **asdict(DEFAULT_OUTPUT), **asdict(NO_EDITS)}
        given = {"clip": self.clip, "fps": self.fps, **asdict(self.writing), **asdict(self.edits)}
        changed = {key: value for key, value in given.items() if value != defaults[key]}
        return asdict(self.options) | pairs | hashes | changed

    def read(self, source: InputFile) -> tuple[Motion, tuple[str, ...]]:
        """Return the edited motion of a clip, and a line on each thing left out; errors as in `parse_motion`."""
        motion, lost = parse_motion(source, self.clip, self.fps)
        with in_file(source.path):
            return self.edits.of(motion), lost

    def name_of(self, source: InputFile) -> str:
        """Return the name of the animation that is written for a clip."""
        return self.clip if self.clip and not self.clip.startswith("#") else Path(source.path).stem

    def transfer(self, motion: Motion, source: InputFile, target: LoadedTarget, path: str | Path) -> Transfer:
        """Return the transfer of a motion, from a file, to a target in another; errors name the file at fault."""
        skeleton = motion.rigid_skeleton
        pairs = joint_map(skeleton, target.for_source(skeleton), path, self.map_file)
        rest = self.map_file.rest.on(skeleton) if self.map_file.rest else None
        builds = self.builds if self.options.skin == "none" else with_source(self.builds, source)
        return Transfer(motion, target, self.options, pairs, rest, builds)


DEFAULT_RECIPE = Recipe()


@dataclass(frozen=True, eq=False)
class Converted:
    """A clip on its target."""

    result: RetargetResult  # with the motion as the output file holds it
    clip: NamedClip  # to write
    lacking: tuple[str, ...] | None = None  # the source's expressions that the target lacks; None if none are written

    def left_out(self, lost: Sequence[str]) -> Iterator[str]:
        """Yield the lines of `Recipe.read` on what is left out; of expressions only those that the target lacks."""
        for line in lost:
            if line != FACE_LEFT_OUT or self.lacking is None:
                yield line
            elif self.lacking:
                yield f"expressions that the target lacks are left out: {quoted(self.lacking, MOST_NAMES)}"


@dataclass(frozen=True, eq=False)
class Conversion:
    """A clip prepared for results that differ only in contacts."""

    prepared: Prepared  # on its target
    source: InputFile  # its mesh shows how thick the performer is, unless the recipe has a build
    target: TargetFile
    recipe: Recipe

    @classmethod
    def of(cls, motion: Motion, source: InputFile, target: TargetFile, recipe: Recipe) -> Conversion:
        """Prepare a motion that `Recipe.read` returned; errors as in `prepare`, which name the file at fault."""
        body = target.target.for_source(motion.rigid_skeleton)
        transfer = recipe.transfer(motion, source, body, target.path)
        with in_file(source.path), with_advice(source.path, target.path):
            prepared = prepare(transfer)
        return cls(prepared, source, target, recipe)

    def converted(
        self,
        name: str,
        kinds: tuple[OutputKind, ...],
        contacts: ContactList = NO_CONTACTS,
        progress: Progress = ignore_progress,
    ) -> Converted:
        """Retarget the clip with a user's contacts, as an animation of a `name`. The motion is measured as written to
        the first of the `kinds` of outputs; errors are those of `retarget`, and name the file at fault.
        """
        with in_file(self.source.path):
            result = self.prepared.solved(contacts, progress=progress)
        writing = self.recipe.writing
        clip = writing.clip(result.motion, name, result.world.up_vector)
        result = replace(result, motion=as_written(result.motion, kinds[0], writing.precision, self.target))
        clip = replace(clip, labels=result.labels) if "arrays" in kinds else clip
        face = self.target.target.face if isinstance(self.target.target, CharacterTarget) else None
        if "character" not in kinds or face is None or self.source.kind != "glTF":
            return Converted(result, clip)
        expressions = self._expressions(result.motion)
        lacking = tuple(name for name in expressions if name.casefold() not in face.targets)
        return Converted(result, replace(clip, weights=face.weights(expressions)), lacking)

    def _expressions(self, motion: Motion) -> dict[str, Array]:
        """The expressions of the source, (frames,) each, by name, with the edits of its `motion`."""
        curves = find_expressions(self.source.gltf, self.recipe.clip)

        def values_at(times: Array) -> Array:
            return np.stack([curve.at(times, rotates=False)[:, 0] for curve in curves.values()], axis=1)

        if not curves:
            return {}
        values = self.recipe.edits.of_values(values_at, len(motion), motion.frame_time)
        return dict(zip(curves, values.T, strict=True))
