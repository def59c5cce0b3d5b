"""Scene files: JSON that names the performers, their bodies, props and options; and the scene that they describe."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast, get_args

from distretarget.errors import DistretargetError, MotionError, closest
from distretarget.io.bvh import parse_bvh, read_bvh
from distretarget.io.files import read_text
from distretarget.io.json_node import Node, parse_json
from distretarget.io.map_json import joint_map, load_map
from distretarget.io.obj import parse_obj
from distretarget.io.target_file import load_target
from distretarget.motion import Motion
from distretarget.objectives.resting_joints import Environment
from distretarget.pipeline.options import HoldMode
from distretarget.scene.prop import Grip, Prop, PropScale, prop_of
from distretarget.scene.retargeting import SceneResult, retarget_scene
from distretarget.synchronise import aligned


@dataclass(frozen=True, kw_only=True)
class PerformerFiles:
    """A performer of a scene, by files.

    Attributes:
        name: of the performer, and of its result.
        source: path of its BVH file.
        target: path of its target.
        map_path: path of a map file, if any.
        start: how much of the clip is left out at its beginning [s].
    """

    name: str
    source: Path
    target: Path
    map_path: Path | None = None
    start: float = 0.0


@dataclass(frozen=True, kw_only=True)
class PropFiles:
    """A prop of a scene, by files.

    Attributes:
        name: of the prop, and of its result.
        origin: the path of a BVH or OBJ file; or, for a prop in a performer's file, who has it and its joint there.
        scale: as in `Prop`.
        held_by: as in `Prop`.
        start: how much of the clip is left out at its beginning [s].
    """

    name: str
    origin: Path | Grip
    scale: PropScale = "world"
    held_by: tuple[Grip, ...] = ()
    start: float = 0.0

    @property
    def file(self) -> Path | None:
        """The file of its own, if it has one."""
        return self.origin if isinstance(self.origin, Path) else None

    def made(self, own: Mapping[str, Motion], sources: Sequence[Motion]) -> Prop:
        """Return the prop, given the motions of props with a file of their own, by name, and those of the performers.

        A prop is held by the joint that it hangs on, unless something else is said to hold it.
        """
        if isinstance(self.origin, Path):
            return Prop(name=self.name, motion=own[self.name], scale=self.scale, held_by=self.held_by)
        source, joint = sources[self.origin.performer], self.origin.joint
        above = source.skeleton.line(source.skeleton.index(joint))[1:2]
        held_by = self.held_by or tuple(Grip(self.origin.performer, source.skeleton.keys[each]) for each in above)
        return Prop(name=self.name, motion=prop_of(source, joint), scale=self.scale, held_by=held_by)


@dataclass(frozen=True, kw_only=True)
class SceneSetup:
    """Everything that a scene is made of, but for the contents of its files.

    Attributes:
        performers, props: who and what is in it.
        world_scale, supports, environment: as in `retarget_scene`.
        cut: cut all clips to the frames of the shortest.
        resample: give all clips the frame time of the first.
    """

    performers: tuple[PerformerFiles, ...]
    props: tuple[PropFiles, ...] = ()
    world_scale: float | None = None
    supports: HoldMode = "hold"
    environment: Environment = "body"
    cut: bool = False
    resample: bool = False

    @property
    def inputs(self) -> list[Path]:
        """All files that the scene is made of."""
        paths = [path for each in self.performers for path in (each.source, each.target, each.map_path) if path]
        return [*paths, *self._own_files()]

    @property
    def names(self) -> list[str]:
        """The names of performers and props, in their order."""
        return [each.name for each in self.performers] + [prop.name for prop in self.props]

    @property
    def files(self) -> dict[str, Path]:
        """The file in which the motion of each performer and prop is, by name."""
        sources = [each.source for each in self.performers]
        origins = [each.origin for each in self.props]
        files = [origin if isinstance(origin, Path) else sources[origin.performer] for origin in origins]
        return dict(zip(self.names, [*sources, *files], strict=True))

    def read(self) -> tuple[list[Motion], list[Prop]]:
        """Read the motions of the performers, and the props.

        Raises:
            DistretargetError: a file cannot be read, or ends before its start, or has no such prop.
        """
        clips = self._clips()
        sources = clips[: len(self.performers)]
        own = dict(zip((prop.name for prop in self.props if prop.file), clips[len(sources) :], strict=True))
        return sources, [self._made(prop, own, sources) for prop in self.props]

    def retargeted(self, progress: Callable[[int], object] = lambda _sweep: None) -> SceneResult:
        """Read all files, and retarget the scene.

        Raises:
            DistretargetError: a file cannot be read, or the scene cannot be retargeted.
        """
        sources, props = self.read()
        targets, maps = [], []
        for performer, source in zip(self.performers, sources, strict=True):
            target = load_target(performer.target).for_source(source.rigid_skeleton)
            maps.append(joint_map(source.rigid_skeleton, target, performer.target, load_map(performer.map_path)))
            targets.append(target)
        try:
            return retarget_scene(
                sources,
                targets,
                props,
                joint_maps=maps,
                world_scale=self.world_scale,
                supports=self.supports,
                environment=self.environment,
                progress=progress,
            )
        except DistretargetError as error:
            raise error.in_file(error.path or self.performers[0].source) from None

    def _made(self, prop: PropFiles, own: Mapping[str, Motion], sources: Sequence[Motion]) -> Prop:
        try:
            return prop.made(own, sources)
        except DistretargetError as error:
            raise error.in_file(self.files[prop.name]) from None

    def _own_files(self) -> list[Path]:
        """The files of props that have one of their own."""
        return [prop.file for prop in self.props if prop.file]

    def _clips(self) -> list[Motion]:
        """The motions in the files of performers and props, with the same frames as far as the options ask for it."""
        files = [*(each.source for each in self.performers), *self._own_files()]
        motions = [read_bvh(each.source) for each in self.performers] + [read_prop(file) for file in self._own_files()]
        starts = [each.start for each in self.performers] + [prop.start for prop in self.props if prop.file]
        moving = [number for number, motion in enumerate(motions) if len(motion) != 1]
        for number in moving:
            seconds = len(motions[number]) * motions[number].frame_time
            if starts[number] >= seconds:
                raise MotionError(f"lasts {seconds:g} s; start before that").in_file(files[number])
        clips = aligned(
            [motions[number] for number in moving],
            [starts[number] for number in moving],
            cut=self.cut,
            resample=self.resample,
        )
        for number, clip in zip(moving, clips, strict=True):
            motions[number] = clip
        return motions


def read_prop(path: Path) -> Motion:
    """Return the motion of a prop in a BVH or OBJ file; the content decides which it is.

    Raises:
        FileError: the file cannot be read.
        BvhError: it is neither.
    """
    text = read_text(path)
    return parse_bvh(text, path) if text.lstrip().upper().startswith("HIERARCHY") else parse_obj(text, path)


FORMAT = "distretarget-scene"
VERSION = 1
SCENE_NAME = "scene.json"  # of scenes in a folder of scenes
HEADER_KEYS = ("format", "version")
OPTION_KEYS = ("props", "world_scale", "supports", "environment", "cut", "resample")


def load_scene(path: str | Path) -> SceneSetup:
    """Return the scene in a file; paths in it start from its folder.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: it breaks the format.
    """
    return parse_scene(read_text(path), path)


def parse_scene(text: str, path: str | Path) -> SceneSetup:
    """Return the scene in the text of a file as `load_scene` does."""
    document = parse_json(path, text)
    fields = document.fields((*HEADER_KEYS, "performers"), OPTION_KEYS)
    for key, known in zip(HEADER_KEYS, (FORMAT, VERSION), strict=True):
        if fields[key].value != known or isinstance(fields[key].value, bool):
            fields[key].expected(json.dumps(known))
    folder = Path(path).parent
    performers = tuple(_performer(node, folder) for node in fields["performers"].items())
    if not performers:
        fields["performers"].expected("at least one performer")
    names = [each.name for each in performers]
    props = tuple(_prop(node, folder, names) for node in fields["props"].items()) if "props" in fields else ()
    _check_names(fields, [*names, *(prop.name for prop in props)])
    return SceneSetup(
        performers=performers,
        props=props,
        world_scale=fields["world_scale"].positive() if "world_scale" in fields else None,
        supports=cast(HoldMode, fields["supports"].one_of(get_args(HoldMode)) if "supports" in fields else "hold"),
        environment=cast(
            Environment, fields["environment"].one_of(get_args(Environment)) if "environment" in fields else "body"
        ),
        cut="cut" in fields and fields["cut"].flag(),
        resample="resample" in fields and fields["resample"].flag(),
    )


def _performer(node: Node, folder: Path) -> PerformerFiles:
    fields = node.fields(("source", "target"), ("name", "map", "start"))
    source = folder / fields["source"].text()
    return PerformerFiles(
        name=_name(fields["name"]) if "name" in fields else source.stem,
        source=source,
        target=folder / fields["target"].text(),
        map_path=folder / fields["map"].text() if "map" in fields else None,
        start=_start(fields),
    )


def _prop(node: Node, folder: Path, performers: Sequence[str]) -> PropFiles:
    fields = node.fields(("name",), ("file", "part_of", "scale", "held_by", "start"))
    if ("file" in fields) == ("part_of" in fields):
        node.fail('expected either "file" or "part_of"')
    held_by = fields["held_by"].items() if "held_by" in fields else []
    return PropFiles(
        name=_name(fields["name"]),
        origin=folder / fields["file"].text() if "file" in fields else _grip(fields["part_of"], performers),
        scale=_scale(fields["scale"], performers) if "scale" in fields else "world",
        held_by=tuple(_grip(each, performers) for each in held_by),
        start=_start(fields),
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
    """A name that can be that of a file."""
    name = node.name()
    if name in (".", "..") or "/" in name or "\\" in name:
        node.expected("a name without slashes")
    return name


def _start(fields: dict[str, Node]) -> float:
    if "start" not in fields:
        return 0.0
    if fields["start"].number() < 0:
        fields["start"].expected("a time in seconds, from 0")
    return fields["start"].number()


def _check_names(fields: dict[str, Node], names: Sequence[str]) -> None:
    for number, name in enumerate(names):
        if name in names[:number]:
            fields["performers"].fail(f"{name!r} is the name of two performers or props; give one of them another")
