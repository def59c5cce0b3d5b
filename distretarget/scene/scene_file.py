"""Scene files: JSON with performers, their targets, props and options; and how to read and retarget such a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, get_args

from distretarget.body.build import BUILDS, Builds
from distretarget.contact_entries import NO_CONTACTS
from distretarget.errors import DistretargetError, MotionError, closest, counted, in_file
from distretarget.io.contacts_file import load_contacts
from distretarget.io.files import read_text, safe_file_name
from distretarget.io.input_file import load_file
from distretarget.io.json_node import Node, parse_json
from distretarget.io.map_json import load_map
from distretarget.io.obj import parse_obj, static_prop
from distretarget.io.reading import load_build, load_target, parse_motion
from distretarget.motion import Motion
from distretarget.objectives.resting_joints import Environment
from distretarget.pipeline.edits import NO_EDITS, Edits
from distretarget.pipeline.options import HoldMode, Options, SkinMode
from distretarget.pipeline.retargeting import Recipe
from distretarget.scene.props import Grip, Prop, PropScale, PropSurface, prop_of
from distretarget.scene.retargeting import SceneResult, retarget_transfers

SCENE_NAME = "scene.json"  # in a folder of scenes
HEADER = {"format": "distretarget-scene", "version": 1}
OPTIONS: dict[str, Callable[[Node], object]] = {
    "world_scale": Node.positive,
    "supports": lambda node: node.one_of(get_args(HoldMode)),
    "environment": lambda node: node.one_of(get_args(Environment)),
    "skin": lambda node: node.one_of(get_args(SkinMode)),
    "cut": Node.flag,
    "resample": Node.flag,
}
EDITS: dict[str, Callable[[Node], object]] = {
    "end": lambda node: node.text() if isinstance(node.value, str) else node.number(),
    "speed": Node.positive,
    "mirror": Node.flag,
    "turn": Node.number,
    "loop": Node.flag,
}


@dataclass(frozen=True, kw_only=True)
class SceneClip:
    """The file with the motion of a performer or a prop."""

    name: str  # of the performer or prop, and of its result
    file: Path  # BVH, or for a prop also OBJ
    start: float = 0.0  # time left out at the beginning [s]


@dataclass(frozen=True, kw_only=True)
class PerformerFiles(SceneClip):
    """A performer of a scene, with the paths of its target and of its map and contact files, if any. `skin` is as in
    `retarget_scene`, or an average build or the path of a character as thick as the target; None for that of the scene.
    `source_skin` is such a build of the source; None for its own mesh.
    """

    target: Path
    map_path: Path | None = None
    skin: SkinMode | Path | None = None
    source_skin: Path | None = None
    contacts: Path | None = None

    @property
    def skin_files(self) -> list[Path]:
        """The paths of the characters in `skin` and `source_skin`."""
        builds = (self.skin, self.source_skin)
        return [path for path in builds if isinstance(path, Path) and str(path) not in BUILDS]

    def recipe(self, options: Options) -> Recipe:
        """Read map and builds; `options` are those of the scene. Errors as in `load_map` and `load_build`."""
        build = self.skin if isinstance(self.skin, Path) else None
        skin: SkinMode | None = "auto" if isinstance(self.skin, Path) else self.skin
        options = replace(options, skin=skin or options.skin)
        builds = (self.source_skin, build) if options.skin != "none" else (None, None)
        source, target = (load_build(path) if path else None for path in builds)
        return Recipe(options, load_map(self.map_path), builds=Builds(source, target))


@dataclass(frozen=True, kw_only=True)
class PropFiles(SceneClip):
    """A prop of a scene, as `Prop`; one in a performer's file is held by the joint above, or by those in `held_by`."""

    part_of: Grip | None = None  # the joint of a performer at which the prop begins; None for a file of its own
    scale: PropScale = "world"
    held_by: tuple[Grip, ...] = ()


@dataclass(frozen=True, kw_only=True)
class SceneSetup:
    """A scene: the paths of its files, and its options.

    Attributes:
        performers, props: their files.
        world_scale, supports, environment, skin: as in `retarget_scene`.
        cut: cut all clips to the length of the shortest.
        resample: give all clips the frame time of the first.
        edits: edits of all clips together, after cutting and resampling.
    """

    performers: tuple[PerformerFiles, ...]
    props: tuple[PropFiles, ...] = ()
    world_scale: float | None = None
    supports: HoldMode = "hold"
    environment: Environment = "body"
    skin: SkinMode = "auto"
    cut: bool = False
    resample: bool = False
    edits: Edits = NO_EDITS

    @property
    def clips(self) -> list[SceneClip]:
        """Performers and props, in their order."""
        return [*self.performers, *self.props]

    @property
    def names(self) -> list[str]:
        """The names of performers and props, in their order."""
        return [clip.name for clip in self.clips]

    @property
    def inputs(self) -> list[Path]:
        """The paths of all files of the scene."""
        others = [(each.target, each.map_path, each.contacts, *each.skin_files) for each in self.performers]
        return [*(clip.file for clip in self.clips), *filter(None, chain(*others))]

    def read(self) -> tuple[list[Motion], list[Prop]]:
        """Read the edited motions of performers, and the props; a DistretargetError if a file is at fault."""
        count, own = len(self.performers), [prop for prop in self.props if prop.part_of is None]
        read = [_read(clip) for clip in (*self.performers, *own)]
        motions = [motion for motion, _ in read]
        moving = [number for number, motion in enumerate(motions) if number < count or len(motion) != 1]
        alike = synchronised([motions[each] for each in moving], cut=self.cut, resample=self.resample)
        for number, motion in zip(moving, alike, strict=True):
            motions[number] = motion
        with in_file(self.performers[0].file):
            motions = self.edits.together(motions[:count], motions[count:])
        in_files = ((motion, surface) for motion, (_, surface) in zip(motions[count:], read[count:], strict=True))
        parts = [next(in_files) if prop.part_of is None else (None, None) for prop in self.props]
        return motions[:count], [
            _prop_from(prop, motion, surface, motions)
            for prop, (motion, surface) in zip(self.props, parts, strict=True)
        ]

    def retargeted(self) -> SceneResult:
        """Read all files, and retarget the scene; errors as in `read` and `retarget_scene`."""
        sources, props = self.read()
        contacts = [load_contacts(each.contacts) if each.contacts else NO_CONTACTS for each in self.performers]
        options = Options(supports=self.supports, environment=self.environment, skin=self.skin)
        recipes = [performer.recipe(options) for performer in self.performers]
        targets = [load_target(performer.target) for performer in self.performers]
        transfers = [
            recipe.transfer(source, load_file(each.file), target, each.target)
            for each, recipe, source, target in zip(self.performers, recipes, sources, targets, strict=True)
        ]
        try:
            return retarget_transfers(transfers, props, contacts, self.world_scale)
        except DistretargetError as error:
            performer = self.performers[error.performer or 0]
            raise error.in_file(error.path or (performer.target if error.of_target else performer.file)) from None


def _read(clip: SceneClip) -> tuple[Motion, PropSurface | None]:
    """The motion in a file, from `start` unless it has one frame only; and the surface in an OBJ file, else None."""
    file, surface, is_prop = load_file(clip.file), None, isinstance(clip, PropFiles)
    if is_prop and file.kind == "BVH" and not file.text.lstrip().upper().startswith("HIERARCHY"):
        vertices, triangles = parse_obj(file.text, clip.file)
        motion = static_prop(vertices, clip.file.stem)
        surface = PropSurface.of_mesh(vertices - motion.positions[0, 0], triangles)
    else:
        motion, _ = parse_motion(file)
    if is_prop and len(motion) == 1:
        return motion, surface
    with in_file(clip.file):
        return from_start(motion, clip.start), surface


def from_start(motion: Motion, start: float) -> Motion:
    """Return the motion from `start` on [s]; raise a MotionError if it ends before that."""
    first = round(start / motion.frame_time)
    if first >= len(motion):
        raise MotionError(f"lasts {len(motion) * motion.frame_time:g} s; start before that")
    return motion[first:] if first else motion


def synchronised(motions: Sequence[Motion], *, cut: bool, resample: bool) -> list[Motion]:
    """Return motions at the frame time of the first, and as long as the shortest; a MotionError if lengths differ."""
    time = motions[0].frame_time_text
    counts = [motion.resampled_frames(time) if resample else len(motion) for motion in motions]
    frames = min(counts) if cut else counts[0]
    if resample:
        for number, count in enumerate(counts, 1):
            if count != frames and not cut:
                raise MotionError(
                    f"clip {number} has {counted(count, 'frame')} of {float(time):g} s, and clip 1 has {frames}; cut "
                    "them to the same frames"
                )
        motions = [motion.resampled(time, frames) for motion in motions]
    return [motion[:frames] if cut and len(motion) > frames else motion for motion in motions]


def _prop_from(prop: PropFiles, motion: Motion | None, surface: PropSurface | None, sources: Sequence[Motion]) -> Prop:
    """The prop with the motion of its own file; without one, with that of its joint in a performer's motion."""
    held_by = prop.held_by
    with in_file(prop.file):
        if motion is None:
            assert prop.part_of is not None
            source, joint = sources[prop.part_of.performer], prop.part_of.joint
            motion, above = prop_of(source, joint), source.skeleton.to_root(source.skeleton.index(joint))[1:2]
            held_by = held_by or tuple(Grip(prop.part_of.performer, source.skeleton.keys[each]) for each in above)
        return Prop(name=prop.name, motion=motion, scale=prop.scale, held_by=held_by, surface=surface)


def load_scene(path: str | Path) -> SceneSetup:
    """Return the scene in a file; paths in it start from its folder.

    Raises:
        FileError, SkeletonFileError: the file cannot be read, or breaks the format.
    """
    document = parse_json(path, read_text(path))
    fields = document.fields((*HEADER, "performers"), ("props", *OPTIONS, *EDITS))
    document.check_header(**HEADER)
    folder = Path(path).parent
    performers = [_performer(node, folder) for node in fields["performers"].items()]
    if not performers:
        fields["performers"].expected("at least one performer")
    props = [_prop(node, folder, performers) for node in fields.read("props", Node.items, list[Node]())]
    names = [clip.name for clip in (*performers, *props)]
    if doubled := [name for number, name in enumerate(names) if name in names[:number]]:
        fields["performers"].fail(f"{doubled[0]!r} is the name of two performers or props; give one of them another")
    options: dict[str, Any] = {key: read(fields[key]) for key, read in OPTIONS.items() if key in fields}
    edits: dict[str, Any] = {key: read(fields[key]) for key, read in EDITS.items() if key in fields}
    with in_file(path):
        return SceneSetup(performers=tuple(performers), props=tuple(props), **options, edits=Edits(**edits))


def _performer(node: Node, folder: Path) -> PerformerFiles:
    def path(node: Node) -> Path:
        return folder / node.text()

    fields = node.fields(("source", "target"), ("name", "map", "start", "skin", "source_skin", "contacts"))
    file, skin = path(fields["source"]), fields.read("skin", lambda node: _skin(node, folder), None)
    if skin == "none" and "source_skin" in fields:
        fields["source_skin"].fail('"skin": "none" leaves out all thickness; leave out "source_skin"')
    return PerformerFiles(
        name=fields.read("name", _name, file.stem),
        file=file,
        start=fields.read("start", _start, 0.0),
        target=path(fields["target"]),
        map_path=fields.read("map", path, None),
        skin=skin,
        source_skin=fields.read("source_skin", lambda node: _build(node, folder), None),
        contacts=fields.read("contacts", path, None),
    )


def _skin(node: Node, folder: Path) -> SkinMode | Path:
    """A skin mode or a build."""
    modes: tuple[SkinMode, ...] = get_args(SkinMode)
    return next((mode for mode in modes if node.text() == mode), None) or _build(node, folder, modes)


def _build(node: Node, folder: Path, others: Sequence[str] = ()) -> Path:
    """The name of an average build, or the path of a character."""
    if node.text() in BUILDS:
        return Path(node.text())
    if not Path(node.text()).suffix:
        names = ", ".join(f'"{name}"' for name in (*others, *BUILDS))
        node.expected(f'{names} or the path of a character, as "hero.glb"')
    return folder / node.text()


def _prop(node: Node, folder: Path, performers: Sequence[PerformerFiles]) -> PropFiles:
    fields = node.fields(("name",), ("file", "part_of", "scale", "held_by", "start"))
    if ("file" in fields) == ("part_of" in fields):
        node.fail('expected either "file" or "part_of"')
    names = [each.name for each in performers]
    part_of = fields.read("part_of", lambda node: _grip(node, names), None)
    return PropFiles(
        name=_name(fields["name"]),
        file=performers[part_of.performer].file if part_of else folder / fields["file"].text(),
        start=fields.read("start", _start, 0.0),
        part_of=part_of,
        scale=fields.read("scale", lambda node: _scale(node, names), "world"),
        held_by=tuple(_grip(each, names) for each in fields.read("held_by", Node.items, list[Node]())),
    )


def _grip(node: Node, performers: Sequence[str]) -> Grip:
    fields = node.fields(("performer", "joint"), ())
    return Grip(_number(fields["performer"], performers), fields["joint"].text())


def _scale(node: Node, performers: Sequence[str]) -> PropScale:
    if isinstance(node.value, float):
        return node.positive()
    return "world" if node.text() == "world" else _number(node, performers)


def _number(node: Node, performers: Sequence[str]) -> int:
    """The number of the performer with this name."""
    if node.text() not in performers:
        node.fail(f"no performer {node.text()!r}; {closest(node.text(), performers)}")
    return performers.index(node.text())


def _name(node: Node) -> str:
    """A name that a file can have on every system."""
    name = node.name()
    if safe_file_name(name) != name:
        node.expected("a name that a file can have, without slashes and colons")
    return name


def _start(node: Node) -> float:
    if node.number() < 0:
        node.expected("a time in seconds, from 0")
    return node.number()
