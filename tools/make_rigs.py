"""Write the target skeletons of four conventions, each in T-pose and A-pose.

    python tools/make_rigs.py [FOLDER]

FOLDER is `sample_bvh/rigs` by default. Every run writes the same bytes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from rig_bodies import BODIES, Body, Chain
from scipy.spatial.transform import Rotation

from distretarget.io.target_file import skeleton_to_json
from distretarget.skeleton import Skeleton

Convention = Literal["mixamo", "xsens", "lafan1", "unreal"]
Pose = Literal["T", "A", "X"]
Row = tuple[str, str, NDArray[np.float64]]
"""Name, parent and offset of a joint."""

RIGS = Path(__file__).resolve().parents[1] / "sample_bvh" / "rigs"
CONVENTIONS: tuple[Convention, ...] = ("mixamo", "xsens", "lafan1", "unreal")
POSES: tuple[Pose, ...] = ("T", "A")
LOWERED = 45.0  # how far the arms of an A-pose hang below the horizontal [degrees]


def rig(convention: Convention, pose: Pose) -> Skeleton:
    """The skeleton of a convention with a rest pose [cm]; the root's OFFSET puts its feet on the floor.

    In "T" the arms point sideways, in "A" 45 degrees below the horizontal. "X" is the rest pose of LAFAN1's files, not
    a standing pose: every bone lies along +X of its parent. Only joints with siblings (thighs, lower spine, collar
    bones, neck) have their true offsets, in axes that point up, forward and left.

    Raises:
        ValueError: pose "X" for another convention than lafan1.
    """
    if pose == "X" and convention != "lafan1":
        raise ValueError(f"only lafan1 has pose X, not {convention}")
    body = BODIES[convention]
    rows = [row for group in body.groups for row in _sides(group, body)]
    if pose == "A":
        rows = list(_lowered(rows, body))
    if pose == "X":
        rows = list(_along_x(rows))
    return _skeleton([*rows, *_handles(rows, body)], body)


def _sides(group: tuple[Chain, ...], body: Body) -> Iterator[Row]:
    """The joints of a group; for a limb, those of one side and then those of the other."""
    rows = [row for chain in group for row in _joints(chain)]
    if not any("{side}" in name for name, _, _ in rows):
        yield from rows
        return
    for side, sign in body.sides.items():
        for name, parent, offset in rows:
            yield name.format(side=side), parent.format(side=side), offset * (sign, 1, 1)


def _joints(chain: Chain) -> Iterator[Row]:
    parent, offsets = chain
    for name, offset in offsets.items():
        yield name, parent, np.array(offset, float)
        parent = name


def _lowered(rows: list[Row], body: Body) -> Iterator[Row]:
    """The joints, with the arms turned down about the forward axis."""
    turns = {
        body.upper_arm.format(side=side): Rotation.from_euler("Z", -sign * LOWERED, degrees=True)
        for side, sign in body.sides.items()
    }
    for name, parent, offset in rows:
        if parent in turns:
            turns[name] = turns[parent]
        yield name, parent, turns[parent].apply(offset) if parent in turns else offset


def _along_x(rows: list[Row]) -> Iterator[Row]:
    """The joints, with only children along +X, and siblings in axes that point up, forward and left."""
    parents = [parent for _, parent, _ in rows]
    for name, parent, offset in rows:
        if not parent:
            yield name, parent, offset
        elif parents.count(parent) > 1:
            yield name, parent, offset[[1, 2, 0]]
        else:
            yield name, parent, np.array([np.linalg.norm(offset), 0, 0])


def _handles(rows: list[Row], body: Body) -> Iterator[Row]:
    """The handles: joints at the places of other joints."""
    places: dict[str, NDArray[np.float64]] = {"": np.zeros(3)}
    for name, parent, offset in rows:
        places[name] = places[parent] + offset
    for name, parent, place in body.handles:
        places[name] = places[place]
        yield name, parent, places[name] - places[parent]


def _skeleton(rows: list[Row], body: Body) -> Skeleton:
    """The skeleton of these joints in the convention's axes; a joint named `<parent>_End` is an End Site."""
    names = [name for name, _, _ in rows]
    ends = [name == f"{parent}_End" for name, parent, _ in rows]
    offsets = np.array([offset for _, _, offset in rows])
    if body.up == "Z":
        offsets = offsets[:, [0, 2, 1]] * (1, -1, 1)
    rotations = tuple(f"{axis}rotation" for axis in body.axes)
    positions = tuple(f"{axis}position" for axis in "XYZ")
    sliding = {names[0], *body.sliding, *(name for name, _, _ in body.handles)}
    return Skeleton(
        names=tuple(names),
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _ in rows]),
        offsets=offsets.round(6) + 0.0,
        channels=tuple(
            () if end else positions + rotations if name in sliding else rotations
            for name, end in zip(names, ends, strict=True)
        ),
        end_sites=np.array(ends),
        units="cm",
        up=body.up,
    )


def write_rigs(folder: Path) -> None:
    """Write all skeletons into a folder; replace files of the same names."""
    folder.mkdir(parents=True, exist_ok=True)
    for convention in CONVENTIONS:
        for pose in POSES:
            name = f"{convention}_{pose.lower()}"
            text = skeleton_to_json(rig(convention, pose), name)
            (folder / f"{name}.json").write_text(text, encoding="utf-8", newline="\n")


def main() -> None:
    """Write the skeletons into the folder on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=RIGS)
    write_rigs(parser.parse_args().folder)


if __name__ == "__main__":
    main()
