"""Measure how far forearms and hands are inside trunk, head and legs, by winding numbers of the posed mesh.

    python benchmarks/winding.py CHARACTER MOTION [--step 1]
    python benchmarks/winding.py CHARACTER CLIP --retarget

CHARACTER is a GLB, glTF or VRM; MOTION any motion of its joints (BVH, GLB): the skin is posed here, not by the package.
With `--retarget`, the clip is retargeted first, and the rotation copy is measured beside the result, each with what the
package's own metrics `skin_frames` and `skin_depth` say of it. Prints the share of the points of forearms and hands
that are inside [%], the frames in which more than 1 % are [%], and how deep the deepest is [% of height]. Points inside
already in the bind pose do not count. Needs the extra `bench`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import igl
import numpy as np
from numpy.typing import NDArray
from skins import Skin, capped

from distretarget import Motion, load_target, read_motion, retarget
from distretarget.target import Target

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

MANY = 0.01  # share of the points inside above which a frame counts


@dataclass(frozen=True, eq=False)
class Inside:
    """What of forearms and hands is inside the body in each measured frame.

    Attributes:
        share: (frames,), of their points.
        depth: (frames,), of the deepest point; 0 where none is inside [% of height].
    """

    share: Array
    depth: Array

    @property
    def metrics(self) -> tuple[float, float, float]:
        """Mean share [%], frames with more than 1 % inside [%], deepest [% of height]."""
        return 100 * float(self.share.mean()), 100 * float((self.share > MANY).mean()), float(self.depth.max())

    def __str__(self) -> str:
        share, frames, depth = self.metrics
        return f"inside {share:.2f} %, frames with more than 1 %: {frames:.1f} %, deepest {depth:.2f} % of height"


class Solid:
    """A part of a skin as a closed surface: its own triangles, and fans that close its holes."""

    def __init__(self, skin: Skin, *parts: str) -> None:
        self.triangles = skin.triangles_of(skin.of_parts(*parts))
        fans, self._holes = capped(self.triangles, len(skin.points))
        self._closed = np.concatenate([self.triangles, fans])

    def contains(self, points: Array, queries: Array) -> NDArray[np.bool_]:
        """(queries,), whether each is inside while the skin's points are at `points`, (points, 3)."""
        middles = [points[hole].mean(axis=0) for hole in self._holes]
        return np.asarray(igl.fast_winding_number(np.vstack([points, *middles]), self._closed, queries) > 0.5)

    def distances(self, points: Array, queries: Array) -> Array:
        """(queries,), the distance of each from the surface, not from the fans."""
        if not len(queries):
            return np.zeros(0)
        return np.sqrt(igl.point_mesh_squared_distance(queries, points, self.triangles)[0])


class Sinking:
    """Forearms and hands of a skin against its trunk, head and legs."""

    def __init__(self, skin: Skin) -> None:
        self.skin = skin
        self.body = Solid(skin, "hips", "chest", "head", "leg")
        limbs = np.flatnonzero(skin.of_parts("forearm", "hand"))
        self.limbs = limbs[~self.body.contains(skin.points, skin.points[limbs])]

    def of_frame(self, points: Array) -> tuple[float, float]:
        """The share of the points of forearms and hands inside the body, and the depth of the deepest [% of height]."""
        queries = points[self.limbs]
        within = self.body.contains(points, queries)
        depth = self.body.distances(points, queries[within]).max(initial=0.0)
        return float(within.mean()), float(100 * depth / self.skin.height)

    def of(self, motion: Motion, frames: Numbers) -> Inside:
        """What is inside in some frames of a motion."""
        rows = np.array([self.of_frame(points) for points in self.skin.frames(motion, frames)])
        return Inside(rows[:, 0], rows[:, 1])


def motions(character: Path, clip: Path, retargeted: bool) -> Iterator[tuple[str, Motion, str]]:
    """The motions to measure, by name, and what the package's metrics say of each."""
    target, motion = load_target(character), read_motion(clip)
    if not retargeted:
        yield "", motion if motion.skeleton.looks_back == target.skeleton.looks_back else motion.turned_round(), ""
        return
    result = retarget(motion, target)
    for name, made in (("rotation_copy", result.rotation_copy), ("result", result.motion)):
        found = (f"{key} {result.metrics[name][key] or 0.0:.2f} %" for key in ("skin_frames", "skin_depth"))
        yield f"{name.replace('_', ' ')}: ", made, f" ({', '.join(found)})"


@click.command(help=__doc__)
@click.argument("character", type=click.Path(exists=True, path_type=Path))
@click.argument("clip", type=click.Path(exists=True, path_type=Path))
@click.option("--retarget", "retargeted", is_flag=True, help="Retarget the clip to the character first.")
@click.option("--step", default=1, show_default=True, help="Measure every so manieth frame.")
def main(character: Path, clip: Path, retargeted: bool, step: int) -> None:
    """Print the metrics."""
    target = load_target(character)
    assert isinstance(target, Target)
    sinking = Sinking(Skin.read(character, target.skeleton))
    for name, motion, metrics in motions(character, clip, retargeted):
        print(f"{name}{sinking.of(motion, np.arange(0, len(motion), step))}{metrics}")


if __name__ == "__main__":
    main()
