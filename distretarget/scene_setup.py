"""Everything that a scene is made of: who is in it, on which bodies, with which things and options."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from distretarget.alignment import aligned
from distretarget.errors import DistretargetError, MotionError
from distretarget.io.bvh import parse_bvh, read_bvh
from distretarget.io.files import read_text
from distretarget.io.map_json import joint_map, load_map
from distretarget.io.obj import parse_obj
from distretarget.io.target_file import load_target
from distretarget.motion import Motion
from distretarget.performer import Held
from distretarget.scene import SceneResult, retarget_scene
from distretarget.solve.resting_joints import Scene
from distretarget.thing import Grip, Thing, ThingScale, prop_of


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
class ThingFiles:
    """A thing of a scene, by files.

    Attributes:
        name: of the thing, and of its result.
        origin: the path of a BVH or OBJ file; or, for a prop in a performer's file, who has it and its joint there.
        scale: as in `Thing`.
        held_by: as in `Thing`.
        start: how much of the clip is left out at its beginning [s].
    """

    name: str
    origin: Path | Grip
    scale: ThingScale = "world"
    held_by: tuple[Grip, ...] = ()
    start: float = 0.0

    @property
    def file(self) -> Path | None:
        """The file of its own, if it has one."""
        return self.origin if isinstance(self.origin, Path) else None

    def made(self, own: Mapping[str, Motion], sources: Sequence[Motion]) -> Thing:
        """Return the thing, given the motions of things with a file of their own, by name, and those of the performers.

        A prop is held by the joint that it hangs on, unless something else is said to hold it.
        """
        if isinstance(self.origin, Path):
            return Thing(name=self.name, motion=own[self.name], scale=self.scale, held_by=self.held_by)
        source, joint = sources[self.origin.performer], self.origin.joint
        above = source.skeleton.line(source.skeleton.index(joint))[1:2]
        held_by = self.held_by or tuple(Grip(self.origin.performer, source.skeleton.keys[each]) for each in above)
        return Thing(name=self.name, motion=prop_of(source, joint), scale=self.scale, held_by=held_by)


@dataclass(frozen=True, kw_only=True)
class SceneSetup:
    """Everything that a scene is made of, but for the contents of its files.

    Attributes:
        performers, things: who and what is in it.
        world_scale, supports, scene: as in `retarget_scene`.
        cut: cut all clips to the frames of the shortest.
        resample: give all clips the frame time of the first.
    """

    performers: tuple[PerformerFiles, ...]
    things: tuple[ThingFiles, ...] = ()
    world_scale: float | None = None
    supports: Held = "hold"
    scene: Scene = "body"
    cut: bool = False
    resample: bool = False

    @property
    def inputs(self) -> list[Path]:
        """All files that the scene is made of."""
        paths = [path for each in self.performers for path in (each.source, each.target, each.map_path) if path]
        return [*paths, *self._own_files()]

    @property
    def names(self) -> list[str]:
        """The names of performers and things, in their order."""
        return [each.name for each in self.performers] + [thing.name for thing in self.things]

    @property
    def files(self) -> dict[str, Path]:
        """The file in which the motion of each performer and thing is, by name."""
        sources = [each.source for each in self.performers]
        origins = [each.origin for each in self.things]
        files = [origin if isinstance(origin, Path) else sources[origin.performer] for origin in origins]
        return dict(zip(self.names, [*sources, *files], strict=True))

    def read(self) -> tuple[list[Motion], list[Thing]]:
        """Read the motions of the performers, and the things.

        Raises:
            DistretargetError: a file cannot be read, or ends before its start, or has no such prop.
        """
        clips = self._clips()
        sources = clips[: len(self.performers)]
        own = dict(zip((thing.name for thing in self.things if thing.file), clips[len(sources) :], strict=True))
        return sources, [self._made(thing, own, sources) for thing in self.things]

    def retargeted(self, progress: Callable[[int], object] = lambda _sweep: None) -> SceneResult:
        """Read all files, and retarget the scene.

        Raises:
            DistretargetError: a file cannot be read, or the scene cannot be retargeted.
        """
        sources, things = self.read()
        targets, maps = [], []
        for performer, source in zip(self.performers, sources, strict=True):
            target = load_target(performer.target).for_source(source.rigid_skeleton)
            maps.append(joint_map(source.rigid_skeleton, target, performer.target, load_map(performer.map_path)))
            targets.append(target)
        try:
            return retarget_scene(
                sources,
                targets,
                things,
                joint_maps=maps,
                world_scale=self.world_scale,
                supports=self.supports,
                scene=self.scene,
                progress=progress,
            )
        except DistretargetError as error:
            raise error.in_file(error.path or self.performers[0].source) from None

    def _made(self, thing: ThingFiles, own: Mapping[str, Motion], sources: Sequence[Motion]) -> Thing:
        try:
            return thing.made(own, sources)
        except DistretargetError as error:
            raise error.in_file(self.files[thing.name]) from None

    def _own_files(self) -> list[Path]:
        """The files of things that have one of their own."""
        return [thing.file for thing in self.things if thing.file]

    def _clips(self) -> list[Motion]:
        """The motions in the files of performers and things, with the same frames as far as the options ask for it."""
        files = [*(each.source for each in self.performers), *self._own_files()]
        motions = [read_bvh(each.source) for each in self.performers] + [read_thing(file) for file in self._own_files()]
        starts = [each.start for each in self.performers] + [thing.start for thing in self.things if thing.file]
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


def read_thing(path: Path) -> Motion:
    """Return the motion of a thing in a BVH or OBJ file; the content decides which it is.

    Raises:
        FileError: the file cannot be read.
        BvhError: it is neither.
    """
    text = read_text(path)
    return parse_bvh(text, path) if text.lstrip().upper().startswith("HIERARCHY") else parse_obj(text, path)
