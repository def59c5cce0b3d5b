"""Anchors: points on the skin that correspond between bodies, by position along a part's axis and angle about it.

Axes are those of `body.segments.part_frames`, in the reference pose. They end with the bone, those of head, hands and
feet with the skin. An anchor is the outermost point in which the ray from the axis, at its angle, meets the skin; if it
meets none, as above a head, the point of the skin nearest to the ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import capsules_by_build
from distretarget.body.segments import find_segments, part_frames
from distretarget.contact_entries import Anchor
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Numbers, cross, lengths, normalised
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh

PART_OF = {"chest": "trunk", "belly": "trunk", "pelvis": "trunk", "left hand": "left palm", "right hand": "right palm"}
PARTS = [PART_OF.get(segment, segment) for segment in SEGMENTS]
TO_SKIN = ("palm", "foot", "head")  # parts whose axes end with the skin
BALLS = 33  # balls that stand for a capsule
LEAST = 1e-12  # a triangle with a smaller determinant is parallel to the ray


@dataclass(frozen=True, eq=False)
class SkinPoint:
    """A point on the skin that moves with joints."""

    joint: int  # the joint of its part that moves it most
    joints: Numbers  # (n,), the joints that move it
    weights: Array  # (n,), their skin weights, which sum to 1
    offsets: Array  # (n, 3), its offset from each of them in the rest pose [file units]
    normal: Array  # (3,), the direction out of the skin, in the axes of `joint`
    along: Array  # (3,), the direction along its part, in the axes of `joint`

    def places(self, motion: Motion) -> Array:
        """Return its positions, (frames, 3) [file units]."""
        each = zip(self.joints.tolist(), self.offsets, strict=True)
        moved = [motion.positions[:, joint] + _turns(motion, joint).apply(offset) for joint, offset in each]
        return np.asarray(np.einsum("n,nfi->fi", self.weights, np.array(moved)))

    def normals(self, motion: Motion) -> Array:
        """Return the directions out of the skin, (frames, 3)."""
        return np.asarray(_turns(motion, self.joint).apply(self.normal))

    def axis_directions(self, motion: Motion) -> Array:
        """Return the directions along its part, (frames, 3)."""
        return np.asarray(_turns(motion, self.joint).apply(self.along))


@dataclass(frozen=True, eq=False)
class PartAxes:
    """The axis of a part of a body in its reference pose."""

    part: str
    start: Array  # (3,) [file units]
    directions: Array  # (3, 3), along it, to the side and to the front, as rows
    length: float  # [file units]
    capsules: Numbers  # (capsules,), indices of the capsules of its skin


@dataclass(frozen=True, eq=False)
class AnchoredSkin:
    """The skin of a body on which anchors are found: its mesh or, without one, its capsules."""

    body: Body
    capsules: Capsules
    mesh: SkinnedMesh | None = None

    @classmethod
    def of(cls, body: Body, capsules: Capsules | None, mesh: SkinnedMesh | None = None) -> AnchoredSkin:
        """Return the skin of a body; without capsules that of an average body, without a mesh."""
        return cls(body, capsules_by_build(body), None) if capsules is None else cls(body, capsules, mesh)

    def part_of(self, joint: int) -> str:
        """Return the part that a joint belongs to; empty if it has no axis."""
        segment = int(find_segments(self.body).of_joint[joint])
        return PARTS[segment] if segment >= 0 and PARTS[segment] in self.axes else ""

    @cached_property
    def axes(self) -> dict[str, PartAxes]:
        """The axes of the parts that have skin, by name."""
        found, of_capsule = dict[str, PartAxes](), np.array(PARTS)[self.capsules.segments]
        for part, frame in part_frames(self.body) if self.body.anatomy else ():
            own = np.flatnonzero(of_capsule == part)
            if len(own):
                far = (self._ends[own] - frame.origin) @ frame.axes[:, 0] + self.capsules.radii[own]
                length = float(far.max()) if part.endswith(TO_SKIN) else frame.length
                found[part] = PartAxes(part, frame.origin, frame.axes.T, length, own)
        return found

    def axes_at(self, joint: int) -> tuple[Array, Array, float] | None:
        """Return the axis of the part that a joint belongs to, in the axes of the joint: its start, (3,), relative to
        the joint, its directions, (3, 3), as rows, and its length [file units]; None without an axis.
        """
        axes, pose = self.axes.get(self.part_of(joint)), self.body.reference
        if axes is None:
            return None
        back = Rotation.from_quat(pose.rotations[joint]).inv()
        return back.apply(axes.start - pose.positions[joint]), back.apply(axes.directions), axes.length

    def point(self, joint: int, anchor: Anchor) -> SkinPoint | None:
        """Return the point of an anchor on the part that a joint belongs to; None if the part has no axis."""
        axes = self.axes.get(self.part_of(joint))
        if axes is None:
            return None
        along, round_ = anchor[0] * axes.length, np.radians(anchor[1])
        start = axes.start + along * axes.directions[0]
        ray = np.sin(round_) * axes.directions[1] + np.cos(round_) * axes.directions[2]
        found = self._on_mesh(axes, start, ray) if self.mesh else None
        joints, weights, places = found or self._on_capsules(axes, start, ray)
        rest, pose = self.body.skeleton.rest_positions, self.body.reference
        most = int(joints[(weights * [self.part_of(each) == axes.part for each in joints.tolist()]).argmax()])
        turned = Rotation.from_quat(pose.rotations[joints])
        place = weights @ (turned.apply(places - rest[joints]) + pose.positions[joints])
        core = axes.length - self.capsules.radii[axes.capsules].mean() if axes.part.endswith(TO_SKIN) else axes.length
        least = 0.0 if axes.part.endswith("foot") else -np.inf  # skin ends behind a heel
        middle = axes.start + np.clip((place - axes.start) @ axes.directions[0], least, core) * axes.directions[0]
        out = normalised((place - middle)[None])[0]
        own, along = Rotation.from_quat(pose.rotations[most]).apply([out, axes.directions[0]], inverse=True)
        return SkinPoint(most, joints, weights, places - rest[joints], own, along)

    @cached_property
    def _ends(self) -> Array:
        """(capsules, 2, 3), the ends of the capsules in the reference pose."""
        return self.body.reference.places(self.capsules.joints, self.capsules.ends)

    @cached_property
    def _vertices(self) -> Array:
        """(vertices, 3), the vertices of the mesh in the reference pose."""
        assert self.mesh
        joints, pose = self.mesh.joints, self.body.reference
        off = self.mesh.vertices[:, None] - self.body.skeleton.rest_positions[joints]
        turned = np.einsum("vkij,vkj->vki", Rotation.from_quat(pose.rotations).as_matrix()[joints], off)
        return np.asarray(np.einsum("vk,vki->vi", self.mesh.weights, turned + pose.positions[joints]))

    def _on_capsules(self, axes: PartAxes, start: Array, ray: Array) -> tuple[Numbers, Array, Array]:
        """The joint that moves the capsule's skin on a ray, its weight 1, and the point in the rest pose, (1, 3)."""
        t = np.linspace(0.0, 1.0, BALLS)[:, None]
        ends, radii = self._ends[axes.capsules], self.capsules.radii[axes.capsules]
        centres = ((1.0 - t) * ends[:, None, 0] + t * ends[:, None, 1]).reshape(-1, 3)
        radii = ((1.0 - t) * radii[:, None, :1] + t * radii[:, None, 1:]).reshape(-1)
        off = centres - start
        along = off @ ray
        square = radii**2 - (off**2).sum(axis=1) + along**2
        far = along + np.sqrt(np.maximum(square, 0.0))
        meets = (square >= 0.0) & (far > 0.0)
        ball = int(np.where(meets, far, -np.inf).argmax() if meets.any() else square.argmax())
        place = start + max(far[ball], 0.0) * ray
        place = centres[ball] + radii[ball] * normalised((place - centres[ball])[None])[0]
        joint, pose = self.capsules.joints[axes.capsules[ball // BALLS]], self.body.reference
        own = Rotation.from_quat(pose.rotations[joint]).apply(place - pose.positions[joint], inverse=True)
        return np.array([joint]), np.ones(1), (self.body.skeleton.rest_positions[joint] + own)[None]

    def _on_mesh(self, axes: PartAxes, start: Array, ray: Array) -> tuple[Numbers, Array, Array] | None:
        """The joints that move the mesh on a ray, their weights and points in the rest pose; None without triangles."""
        assert self.mesh
        mesh, segments = self.mesh, find_segments(self.body).of_joint[self.mesh.carriers]
        on_part = np.array([*(part == axes.part for part in PARTS), False])[segments]
        own = mesh.triangles[on_part[mesh.triangles].sum(axis=1) >= 2]
        if not len(own):
            return None
        corner, b, c = np.moveaxis(self._vertices[own], 1, 0)
        one, other, off = b - corner, c - corner, start - corner
        across = cross(np.broadcast_to(ray, other.shape), other)
        determinant = (one * across).sum(axis=1)
        determinant = np.where(np.abs(determinant) > LEAST, determinant, np.inf)
        turned = cross(off, one)
        u, v = (off * across).sum(axis=1) / determinant, turned @ ray / determinant
        far = (turned * other).sum(axis=1) / determinant
        meets = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (far > 0.0)
        if meets.any():
            n = int(np.where(meets, far, -np.inf).argmax())
            vertices, shares = own[n], np.array([1.0 - u[n] - v[n], u[n], v[n]])
        else:
            off_ray = self._vertices[own] - start
            off_ray -= np.maximum(off_ray @ ray, 0.0)[..., None] * ray
            vertices, shares = own.reshape(-1)[[lengths(off_ray).argmin()]], np.ones(1)
        weights = shares[:, None] * mesh.weights[vertices]
        on = weights > 0.0
        return mesh.joints[vertices][on], weights[on], np.repeat(mesh.vertices[vertices], on.sum(axis=1), axis=0)


def _turns(motion: Motion, joint: int) -> Rotation:
    return Rotation.from_quat(motion.world_rotations_of(joint))
