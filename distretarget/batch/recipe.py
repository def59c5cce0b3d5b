"""How the clips of a batch are read, retargeted and written: what is the same for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace

from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.io.map_json import MapFile
from distretarget.io.motion_writer import DEFAULT_OUTPUT, OutputSettings
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options


@dataclass(frozen=True)
class Reading:
    """Which animation of a file is read, and at which frame rate; see `read_motion`."""

    clip: str | None = None
    fps: float | None = None


DEFAULT_READING = Reading()


@dataclass(frozen=True)
class Recipe:
    """How a clip is read, retargeted and written."""

    options: Options = DEFAULT_OPTIONS
    map_file: MapFile = field(default_factory=lambda: MapFile({}, ""))
    reading: Reading = DEFAULT_READING
    writing: OutputSettings = DEFAULT_OUTPUT
    builds: Builds = OWN_BUILDS

    def of_animation(self, name: str | None) -> Recipe:
        """Return the recipe for an animation of a file that has several; the same if there is no name."""
        return replace(self, reading=replace(self.reading, clip=name)) if name else self

    @property
    def settings(self) -> Mapping[str, object]:
        """What decides an output, as JSON values: the fields of `Options`, `map` (None for no map), hashes of builds,
        and of how clips are read and written what is not as usual.
        """
        pairs: dict[str, object] = {"map": dict(self.map_file.pairs) or None}
        if self.map_file.rest:
            pairs["rest"] = dict(self.map_file.rest.rotations)
        sides = {"source_build": self.builds.source, "target_build": self.builds.target}
        hashes = {side: build.hash for side, build in sides.items() if build is not None}
        usual = asdict(DEFAULT_READING) | asdict(DEFAULT_OUTPUT)
        given = asdict(self.reading) | asdict(self.writing)
        others = {key: value for key, value in given.items() if value != usual[key]}
        return asdict(self.options) | pairs | hashes | others
