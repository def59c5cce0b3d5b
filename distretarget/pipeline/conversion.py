"""Convert a clip from its file to the output on a target, for the command line, batches, scenes and the studio."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import NoneType

import numpy as np

from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.checks import check_kind
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import in_file, quoted
from distretarget.ik.poses import Progress, ignore_progress
from distretarget.io.expressions import find_expressions
from distretarget.io.formats import OutputKind
from distretarget.io.gltf_scene import FACE_LEFT_OUT
from distretarget.io.input_file import InputFile
from distretarget.io.map_json import MapFile, joint_map
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import DEFAULT_OUTPUT, NamedClip, OutputSettings, as_written
from distretarget.io.target_file import CharacterTarget, TargetFile, with_source
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array
from distretarget.pipeline.edits import NO_EDITS, Edits
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.performer import Transfer
from distretarget.pipeline.result import RetargetResult
from distretarget.pipeline.retargeting import Prepared, prepare, with_advice
from distretarget.target import LoadedTarget

MOST_NAMES = 12  # of expressions in a line


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
        check_kind("options", self.options, Options)
        check_kind("map_file", self.map_file, MapFile)
        check_kind("clip", self.clip, str, NoneType)
        check_kind("writing", self.writing, OutputSettings)
        check_kind("builds", self.builds, Builds)
        check_kind("edits", self.edits, Edits)

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
