"""Hold the metrics of skin against winding numbers of the posed mesh, by libigl.

    python benchmarks/skin_inside.py CHARACTER.glb ...

The six samples are put on each character, and of rotation copies and results one frame in 24 is looked at: the share
of the vertices of hands and forearms inside trunk, head and legs, and the depth of the deepest. Vertices that are
inside in the bind pose do not count. Needs the package libigl.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import igl
import numpy as np

from distretarget import Motion, load_target, read_bvh, retarget
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.measure.skin import VISIBLE, SourceSkin, find_skin
from distretarget.measure.skin_depths import LIMBS
from distretarget.skin.capsules import SEGMENTS, no_capsules
from distretarget.skin.mesh import SkinnedMesh

SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"
CLIPS = ("hands_on_hips", "clap", "squat", "wave", "turn", "walk")
EVERY = 24  # frames
ARM = [number for number, name in enumerate(SEGMENTS) if name.endswith(("hand", "forearm", "upper arm"))]
Array = np.ndarray


@dataclass(frozen=True)
class Solid:
    """A mesh without its arms, and the vertices of hands and forearms that are not inside in the bind pose."""

    mesh: SkinnedMesh
    triangles: Array
    limbs: Array

    @classmethod
    def of(cls, mesh: SkinnedMesh, body: Body) -> Solid:
        strongest = np.take_along_axis(mesh.joints, mesh.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
        segments = find_segments(body).of_joint[strongest]
        middle = np.sort(segments[mesh.triangles], axis=1)[:, 1]
        triangles = mesh.triangles[~np.isin(middle, [-1, *ARM])]
        whole = cls(mesh, triangles, np.flatnonzero(np.isin(segments, [SEGMENTS.index(limb) for limb in LIMBS])))
        return replace(whole, limbs=whole.limbs[whole.depths(mesh.vertices) == 0])

    def depths(self, vertices: Array) -> Array:
        """(limb vertices,), how deep each is inside; 0 outside."""
        vertices = np.ascontiguousarray(vertices)
        points = np.ascontiguousarray(vertices[self.limbs])
        inside = igl.fast_winding_number(vertices, self.triangles, points) > 0.5
        depths = np.zeros(len(points))
        if inside.any():
            nearest = igl.point_mesh_squared_distance(np.ascontiguousarray(points[inside]), vertices, self.triangles)
            depths[inside] = np.sqrt(nearest[0])
        return depths

    def measure(self, motion: Motion, height: float) -> Iterator[tuple[float, float]]:
        """The share inside [%] and the largest depth [% of height] in each frame."""
        for vertices in self.mesh.posed(motion):
            depths = self.depths(vertices)
            yield 100 * (depths > 0).mean(), 100 * depths.max() / height


def rows_of(path: Path) -> Array:
    """(frames, 5), share and depth by winding numbers, the same by the metrics, and their time [microseconds]."""
    target = load_target(path)
    body, mesh = Body.of(target.skeleton), target.mesh()
    assert mesh is not None
    solid, skin = Solid.of(mesh, body), find_skin(body, no_capsules(), mesh)
    can_touch = skin.can_touch & ~np.isin(np.arange(len(SEGMENTS)), ARM)
    can_touch[len(LIMBS) :] = False
    of_target = replace(skin, can_touch=can_touch)
    rows = []
    for clip in CLIPS:
        run = retarget(read_bvh(SAMPLES / f"{clip}.bvh"), target)
        for motion in (run.rotation_copy, run.motion):
            reference = SourceSkin.without_touches(of_target, np.arange(len(motion)), motion.frame_time)
            start = perf_counter()
            found = reference.in_result(motion)
            time = 1e6 * (perf_counter() - start) / len(motion)
            frames = np.arange(0, len(motion), EVERY)
            known = np.array(list(solid.measure(motion[frames], body.height)))
            metrics = np.column_stack([found.inside[frames], found.deepest[frames].max(axis=1)])
            rows.append(np.column_stack([known, metrics, np.full(len(frames), time)]))
    return np.concatenate(rows)


def line(name: str, rows: Array) -> str:
    """A row of the table."""
    share, depth, found, deepest, time = rows.T
    seen, told = share > VISIBLE, found > VISIBLE
    counts = f"{(seen & told).sum()} | {(seen & ~told).sum()} | {(~seen & told).sum()}"
    means = f"{share.mean():.1f} | {found.mean():.1f} | {depth.mean():.2f} | {deepest.mean():.2f}"
    off = np.abs(depth - deepest)
    return f"| {name} | {len(rows)} | {counts} | {means} | {off.mean():.2f} / {off.max():.2f} | {time.mean():.0f} |"


def main() -> None:
    """Print a row for each character, and one for all."""
    depths = "depth | metric | off, mean / largest"
    print(f"| character | frames | found | missed | false | % inside | metric | {depths} | us/frame |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    every = []
    for path in map(Path, sys.argv[1:]):
        every.append(rows_of(path))
        print(line(path.name, every[-1]), flush=True)
    print(line("all", np.concatenate(every)))


if __name__ == "__main__":
    main()
