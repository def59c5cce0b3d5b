"""The soles of a body: the pose of each foot while it stands flat on the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body, Pose
from distretarget.body.limbs import Leg, Legs, leg_length
from distretarget.body.reference_pose import FOOT_PITCH
from distretarget.body.resting import feet_at_rest
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.rotations import least_matrix
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers, cross, lengths, normalised
from distretarget.rig import rig_cached
from distretarget.skeleton import Skeleton
from distretarget.skin.mesh import SkinnedMesh

PITCH = np.radians(10)  # feet that rest with heel or toes lifted by up to this on average are flat [rad]
RAISED = np.radians(60)  # and so are feet that both rest with toes lifted by up to this: they hang at rest [rad]
ROLL = np.radians(30)  # feet that rest leaning to the side by up to this on average are flat [rad]
# Where a leg leans, or a foot points down, more at rest than another body's by this much, the rest pose tilts the foot,
# in full from twice this on [rad]; the tilt is at most `MOST` times as large.
TILTED, HANGS = np.radians(5), np.radians(10)
MOST = 2.0
BEHIND = 0.1  # a joint farther behind the ankle than this is at the heel [lengths of the foot]
LOWER = 0.75  # the foot has toes if a joint in front of the heel is lower than this [heights of the ankle]
LEVEL = 0.03  # a sole that rests nearer than this to a level floor is on it, and not from twice this on [leg lengths]
GROUND = 0.15  # soles that rest within this of the floor show whether it is level [leg lengths]:
LEVEL_SHARE = 0.65  # it is level if at least this share of them is nearer than `LEVEL`,
UNEVEN_SHARE = 0.4  # and it is not if at most this share is
GUESSED_LENGTH, GUESSED_DIRECTION = 0.01, np.cos(np.radians(10))  # tolerances of made-up tips [lengths; cosine]
UPRIGHT = np.sin(np.radians(15))  # a foot within this angle of straight up or down points nowhere else [sine]
HANGING = np.cos(np.radians(30))  # a foot within this angle of straight down hangs instead of standing [cosine]
MIRRORED = np.array([1.0, -1.0])  # factors that mirror the angles of a foot about its sideways axis and its length
UPRIGHT_SHIN = np.cos(np.radians(45))  # a shin within this angle of the vertical is upright [cosine]
SAME_FACE = np.cos(np.radians(10))  # faces of a hull within this angle form one side of the foot [cosine]
# A flat sole is at least this share of the hull's surface: soles of real characters are 0.15 to 0.26 of it, the largest
# face of a round foot is 0.05, that of a pointed toe less.
FLAT = 0.1
NEAR = np.cos(np.radians(45))  # a sole is within this angle of the one that rest pose or joints show [cosine]


Normals = tuple[Array, ...]
"""The normals of the soles of left and right foot, (3,) each, in the axes of the ankles."""


@dataclass(frozen=True, eq=False)
class Sole:
    """The sole of a foot, in the axes of its ankle: a plane through the lowest of the foot's joints and End Sites."""

    joints: Numbers  # (joints,), the ankle, and the joints and End Sites of the foot below it
    points: Array  # (joints, 3), their positions relative to the ankle [file units]
    normal: Array  # (3,), the unit vector up from the floor while the foot stands flat
    known: bool  # whether rest pose, motion or the other body show the flat foot; if not, it has the usual pitch

    @cached_property
    def heights(self) -> Array:
        """(joints,), the heights of the joints above the sole [file units]."""
        heights = self.points @ self.normal
        return np.asarray(heights - heights.min())

    @property
    def ankle(self) -> float:
        """The height of the ankle above the sole [file units]."""
        return float(self.heights[0])

    @property
    def at_ankle(self) -> Sole:
        """The sole of the ankle alone, for a leg without a foot."""
        return replace(self, joints=self.joints[:1], points=self.points[:1])

    @cached_property
    def heel(self) -> Flags:
        """(joints,), the joints behind the ankle; none if the foot has no toes to stand on without them."""
        away = self.points @ self.direction - (self.points @ self.normal) * (self.direction @ self.normal)
        behind = away < -BEHIND * lengths(self.points).max()
        return np.asarray(behind & (self.heights[~behind].min() < LOWER * self.ankle))

    @property
    def without_heel(self) -> Sole:
        """The sole without the joints behind the ankle."""
        return replace(self, joints=self.joints[~self.heel], points=self.points[~self.heel])

    @cached_property
    def direction(self) -> Array:
        """(3,), the unit vector to the point farthest from the ankle; zero for a foot without length."""
        return normalised(self.points[np.argmax(lengths(self.points))])

    @property
    def pitch(self) -> float:
        """The angle by which the foot points upwards [rad]."""
        return float(np.arcsin(np.clip(self.direction @ self.normal, -1.0, 1.0)))

    def pitched(self, pitch: float) -> Sole:
        """Return the sole of the foot turned about its sideways axis, so that it has another pitch [rad]."""
        across = normalised(self.normal - (self.normal @ self.direction) * self.direction)
        up = np.cos(pitch) * across + np.sin(pitch) * self.direction if across.any() else self.normal
        return replace(self, normal=np.asarray(up), known=True)


def find_soles(body: Body, legs: Legs, pose: Pose | None = None, normals: Normals | None = None) -> tuple[Sole, ...]:
    """Return the soles of both feet; toes are turned as in `pose`, the reference pose if not given.

    The rest pose shows how a foot stands if a person can stand in it and the foot does not hang. Otherwise both feet
    get the pitch of the flatter one while it rests in the motion. Without a motion feet stand as in the reference pose,
    hanging ones at the usual pitch. `normals` of the soles, if given, overrule all of this.
    """
    pose = pose or body.reference
    soles = [_reference_sole(body, leg, pose) for leg in legs]
    if not all(sole.known for sole in soles):
        length = leg_length(body.skeleton, legs)
        soles = [_resting_sole(body, leg, length, pose) or sole for leg, sole in zip(legs, soles, strict=True)]
        pitch = max((sole.pitch for sole in soles if sole.known), default=None)
        soles = soles if pitch is None else [sole.pitched(pitch) for sole in soles]
    if normals is not None:
        return with_normals(soles, normals)
    return tuple(soles)


def with_normals(soles: Sequence[Sole], normals: Normals) -> tuple[Sole, ...]:
    """Return the soles of both feet with these normals, marked as known."""
    return tuple(replace(sole, normal=normal, known=True) for sole, normal in zip(soles, normals, strict=True))


def with_resting_feet(pose: Pose, body: Body, legs: Legs) -> Pose:
    """Return a pose of a body with the joints below the ankles at their mean while the feet rest in the body's motion;
    they are unchanged if a foot never rests.
    """
    motion, length = body.motion, leg_length(body.skeleton, legs)
    if motion is None:
        return pose
    rotations, positions = pose.rotations.copy(), pose.positions.copy()
    for leg in legs:
        rests = feet_at_rest(motion, leg, body.up_vector, length).all(axis=1)
        if not rests.any():
            continue
        ankle = Rotation.from_quat(pose.rotations[leg.ankle])
        to_ankle = Rotation.from_quat(motion.world_rotations_of(leg.ankle)[rests]).inv()
        for joint in body.skeleton.subtree(leg.ankle):
            turned = to_ankle * Rotation.from_quat(motion.world_rotations_of(joint)[rests])
            away = to_ankle.apply(motion.positions[rests, joint] - motion.positions[rests, leg.ankle])
            rotations[joint] = (ankle * turned.mean()).as_quat()
            positions[joint] = pose.positions[leg.ankle] + ankle.apply(np.median(away, axis=0))
    return replace(pose, rotations=rotations, positions=positions)


def _reference_sole(body: Body, leg: Leg, pose: Pose) -> Sole:
    """The sole in the reference pose; a hanging foot gets the usual pitch."""
    stance = body.reference.directions
    up = body.up_vector if stance is None else stance.vertical
    ankle = Rotation.from_quat(body.reference.rotations[leg.ankle]).as_matrix()
    sole = _sole(body, leg, pose, up @ ankle, body.stands or body.anatomy is None or body.foot_pitch is not None)
    if sole.direction @ sole.normal >= -HANGING:
        return sole
    forward = np.zeros(3) if stance is None else stance.axes[:, 2]
    flat = np.cos(FOOT_PITCH) * forward - np.sin(FOOT_PITCH) * up
    hanging = least_matrix((ankle @ sole.direction)[None], flat[None])
    return replace(sole, normal=up @ hanging @ ankle, known=False)


def _resting_sole(body: Body, leg: Leg, length: float, pose: Pose) -> Sole | None:
    """The sole from the frames in which its foot rests, with legs of a `length` [file units]; None if it never does."""
    if body.motion is None or len(body.motion) < 2:
        return None
    at_rest = _at_rest(body.motion, leg, body.up_vector, length)
    return _sole(body, leg, pose, at_rest[0], True) if at_rest else None


def _sole(body: Body, leg: Leg, pose: Pose, normal: Array, known: bool) -> Sole:
    """The sole, with toes as in a pose."""
    below = body.skeleton.subtree(leg.ankle)
    joints = [joint for joint in below if joint == leg.ankle or body.regions.of_joint[joint] >= 0]
    joints = [joint for joint in joints if not _is_guessed(body.skeleton, joint, pose.axes[:, 1])]
    to_ankle = Rotation.from_quat(pose.rotations[leg.ankle]).inv()
    points = to_ankle.apply(pose.positions[joints] - pose.positions[leg.ankle])
    return Sole(np.array(joints, np.intp), points, normal, known)


def _is_guessed(skeleton: Skeleton, joint: int, up: Array) -> bool:
    """Whether an End Site continues its bone downwards with the same length: importers make such tips up."""
    end, bone = skeleton.offsets[[joint, skeleton.parents[joint]]]
    size, length = lengths(np.stack([end, bone]))
    is_as_long = abs(size - length) < GUESSED_LENGTH * length and end @ bone > GUESSED_DIRECTION * size * length
    return bool(skeleton.end_sites[joint] and is_as_long and end @ up < 0.0)


def _at_rest(motion: Motion, leg: Leg, up: Array, length: float) -> tuple[Array, Array] | None:
    """The medians of up and of the vector to the toe while a foot rests, in the ankle's axes; None if it never does.
    Where it mostly rests below a shin that is not upright, as that of a body that lies, only the other frames count.
    """
    rests = feet_at_rest(motion, leg, up, length).all(axis=1)
    shin = normalised(motion.positions[:, motion.skeleton.parents[leg.ankle]] - motion.positions[:, leg.ankle])
    stands = rests & (shin @ up > UPRIGHT_SHIN)
    resting = np.flatnonzero(rests if 2 * stands.sum() > rests.sum() else stands)
    if not len(resting):
        return None
    to_ankle = Rotation.from_quat(motion.world_rotations_of(leg.ankle)[resting]).inv()
    x = motion.positions[resting]
    toe = np.median(to_ankle.apply(x[:, leg.toe] - x[:, leg.ankle]), axis=0)
    return normalised(np.median(to_ankle.apply(up), axis=0)), toe


def resting_normals(motion: Motion, legs: Legs, soles: tuple[Sole, ...], up: Array) -> Normals:
    """Return the normals of the soles of both legs from resting feet of a motion.

    Rest poses do not always show flat feet: rigs with splayed legs stand on the edges of their feet, and feet may hang.
    The normal is the median of up while ankle and toe rest, if its angles to the given `soles` are at most `PITCH` and
    `ROLL`, or up to `RAISED` if the toes of both feet are higher than that. Larger angles are faded out, to 0 at twice
    these limits, as feet may rest on their toes.
    """
    axes, angles = _resting_turns(motion, legs, soles, up)
    pitch = RAISED if (angles[:, 0] > PITCH).all() else PITCH
    return _turned(soles, axes, angles * (1.0 - smoothstep(np.abs(angles) / [pitch, ROLL] - 1.0)))


def _resting_turns(motion: Motion, legs: Legs, soles: Sequence[Sole], up: Array) -> tuple[list[Array], Array]:
    """The axes of each foot to its side and along it, (2, 3), and the angles by which normals are turned about them to
    be up while feet rest, (feet, 2) [rad]; 0 if neither foot rests. A foot that never rests, or rests on its toes
    alone, gets the mirrored angles of the other foot if the other foot stands flat. The feet of a lying body do not.
    """
    length = leg_length(motion.skeleton, legs)
    rests, axes, angles = [_at_rest(motion, leg, up, length) for leg in legs], [], np.zeros((len(legs), 2))
    for foot, (sole, rest) in enumerate(zip(soles, rests, strict=True)):
        found, toe = rest or (sole.normal, sole.direction)
        aside, axis = normalised(cross(sole.normal, toe)), cross(sole.normal, found)
        axes.append(np.stack([aside, cross(aside, sole.normal)]))
        angles[foot] = axes[-1] @ normalised(axis) * np.arctan2(np.linalg.norm(axis), sole.normal @ found)
    if not any(rests):
        return axes, angles
    angles[[rest is None for rest in rests]] = -np.pi, 0.0
    other = angles[::-1] * MIRRORED
    stands = 1.0 - smoothstep(np.abs(other[:, 1:]) / ROLL - 1.0)
    return axes, angles + stands * smoothstep((other - angles)[:, :1] / PITCH - 1.0) * (other - angles)


def _turned(soles: Sequence[Sole], axes: Sequence[Array], angles: Array) -> Normals:
    """The normals of the soles of both feet, turned by angles about axes, as by `_resting_turns`."""
    turns = Rotation.from_rotvec([own @ about for own, about in zip(angles, axes, strict=True)])
    return tuple(turns.apply([sole.normal for sole in soles]))


def leg_angles(legs: Legs, pose: Pose) -> Array:
    """Return how far each foot points down in a pose, its leg leans to the left, and the foot points to the left,
    (2, 3) [rad]. A foot that points nearly straight up or down points ahead.
    """
    hips, ankles, toes = (pose.positions[[*joints]] for joints in zip(*(leg.joints for leg in legs), strict=True))
    leg, foot = (ankles - hips) @ pose.axes, (toes - ankles) @ pose.axes
    out = lengths(foot[:, [0, 2]])
    ahead = np.where(out > UPRIGHT * lengths(foot), np.arctan2(foot[:, 0], foot[:, 2]), 0.0)
    return np.stack([np.arctan2(-foot[:, 1], out), np.arctan2(leg[:, 0], -leg[:, 1]), ahead], axis=1)


def untilted_normals(body: Body, legs: Legs, soles: tuple[Sole, ...], tilts: Array) -> Normals | None:
    """Return the normals of the soles of both feet without the tilt of the rest pose; None without a tilt.

    A rest pose with splayed legs may stand on the edges of its feet, or its feet may hang, and so may those of another
    body in the same pose. `tilts`, (2, 2), are how much more the body's feet point down and its legs lean to the left
    than the other's [rad]. Feet that rest in the motion show how much they are tilted, at most `MOST` times as much,
    and that they hang if both do.
    """
    if body.motion is None or not body.stands_at_rest or body.standing is not None:
        return None
    tilts = MOST * tilts * smoothstep(np.abs(tilts) / [HANGS, TILTED] - 1.0)
    if not tilts.any():
        return None
    axes, shown = _resting_turns(body.motion, legs, soles, body.up_vector)
    angles = np.clip(shown, np.minimum(tilts, 0.0), np.maximum(tilts, 0.0))
    angles[:, 0] *= smoothstep(shown[:, 0].min() / HANGS - 1.0)
    return _turned(soles, axes, angles)


def sole_height(motion: Motion, sole: Sole, up: Array) -> Array:
    """Return the height of the lowest point of a sole in a motion, (frames,) [file units]. Each joint of the foot has a
    point below it, by its height in a flat foot; in a foot turned upside down the points are the joints.
    """
    upwards = Rotation.from_quat(motion.world_rotations_of(sole.joints.item(0))).apply(sole.normal) @ up
    points = heights_of(motion.positions, sole.joints, up) - np.outer(np.maximum(upwards, 0.0), sole.heights)
    return np.asarray(points.min(axis=1))


def points_down(motion: Motion, sole: Sole, up: Array) -> Flags:
    """Return whether a foot points down with its sole or toes, (frames,), more than with its heel, back or side, on
    which the feet of a body lie that lies or sits.
    """
    forward = normalised(sole.direction - (sole.direction @ sole.normal) * sole.normal)
    turns = Rotation.from_quat(motion.world_rotations_of(sole.joints.item(0)))
    upwards = turns.apply(up, inverse=True)
    return np.asarray(upwards @ (sole.normal - forward) > np.abs(upwards @ np.cross(sole.normal, forward)))


def floor_height(heights: Array, rests: Flags) -> float:
    """Return the floor's height from the heights of soles that rest, both (frames, legs); infinite if none rests."""
    medians = [np.median(sole[on]) for sole, on in zip(heights.T, rests.T, strict=True) if on.any()]
    return float(np.mean(medians)) if medians else np.inf


def level_on_floor(heights: Array, floor: float, rests: Flags, length: float) -> Array:
    """Return the heights of soles, (frames, legs), with soles near a level floor set to its height, `floor`:
    floor + f(height - floor), f(d) = d smoothstep(|d| / `LEVEL` - 1). On slopes and steps nothing changes.
    `rests`, (frames, legs), are the soles that rest; `length` is that of a leg.
    """
    off = np.abs(heights - floor) / length
    near = off[rests & (off <= GROUND)]
    if not len(near):
        return heights
    is_level = smoothstep((np.mean(near <= LEVEL, keepdims=True) - UNEVEN_SHARE) / (LEVEL_SHARE - UNEVEN_SHARE))
    return np.asarray(heights - is_level * (heights - floor) * (1.0 - smoothstep(off / LEVEL - 1.0)))


# ---- soles that a mesh shows: the flat underside of each foot or shoe


@rig_cached
def flat_normals(body: Body, legs: Legs, soles: tuple[Sole, ...], mesh: SkinnedMesh) -> Normals | None:
    """Return the normals of the soles of both feet as the body's mesh shows them; None where one of the feet has no
    flat sole. `soles` are the soles that rest pose and joints show.

    A foot rests on a face of its convex hull. Candidates are the faces near to those soles; the one whose direction is
    shared by most of the hull's surface is the sole. Up in a standing rest pose, or else the given normal, is preferred
    if half as much surface shares it.
    """
    normals = (_flat_normal(body, leg.ankle, sole, mesh) for leg, sole in zip(legs, soles, strict=True))
    found = tuple(normal for normal in normals if normal is not None)
    return found if len(found) == len(legs) else None


def _flat_normal(body: Body, ankle: int, sole: Sole, mesh: SkinnedMesh) -> Array | None:
    """The normal of the flat sole of one foot, (3,); None without one."""
    ups, shares = _faces(mesh, body.skeleton.subtree(ankle))
    known = [sole.normal, *([body.rest.axes[:, 1]] if body.stands_at_rest else [])]
    near = np.flatnonzero((ups @ np.stack(known, axis=1) > NEAR).any(axis=1))
    if not len(near):
        return None
    alike = ups @ np.vstack([ups[near], known]).T > SAME_FACE
    flat = shares @ alike
    best, at_known = flat[: len(near)].max(), flat[len(near) :]
    if best < FLAT:
        return None
    if 2.0 * at_known[-1] > best:
        return np.asarray(known[-1])
    return normalised((shares * alike[:, flat[: len(near)].argmax()]) @ ups)


def _faces(mesh: SkinnedMesh, joints: list[int]) -> tuple[Array, Array]:
    """The triangles of the convex hull of the vertices that some joints move most: the inward normal of each,
    (triangles, 3), and its share of the hull's surface, (triangles,).
    """
    points = mesh.vertices[np.isin(mesh.carriers, joints)]
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.zeros((0, 3)), np.zeros(0)
    a, b, c = points[hull.simplices].swapaxes(0, 1)
    areas = lengths(cross(b - a, c - a))
    return -hull.equations[:, :3], areas / areas.sum()
