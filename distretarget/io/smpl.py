"""SMPL, SMPL-H and SMPL-X: the joints of their bodies, and pose parameters as in AMASS.

    poses  (frames, 3 joints)  rotation of each joint relative to its parent, as rotation vectors [rad]
    trans  (frames, 3)         translation of the model [m]; the pelvis is at `trans` plus its position at rest
    betas  (n,)                shape of the body; a model's file turns it into joints

All rotations are zero in the rest pose, a T-pose with Y up that faces Z. The world of AMASS has Z up. Loper et al.,
"SMPL", doi:10.1145/2816795.2818013; Mahmood et al., "AMASS", doi:10.1109/ICCV.2019.00554.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.body.axes import axis_vector
from distretarget.body.body import Body
from distretarget.body.conventions import convention_of
from distretarget.body.reference_pose import t_pose
from distretarget.errors import FileError, SkeletonError, in_file, quoted
from distretarget.io.arrays import ArraysFile
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import lowest_heights
from distretarget.numerics.vectors import Array
from distretarget.skeleton import DEFAULT_ROOT, DEFAULT_ROTATIONS, METRES, Skeleton

# The joints in the order of `poses`: first those of the body.
BODY = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
FINGER_NAMES = {"index": "Index", "middle": "Middle", "pinky": "Little", "ring": "Ring", "thumb": "Thumb"}
HANDS = tuple(f"{side}_{finger}{bone}" for side in SIDES for finger in FINGER_NAMES for bone in (1, 2, 3))
STUBS = ("left_hand", "right_hand")  # of SMPL, which has no fingers
FACE_JOINTS = ("jaw", "left_eye_smplhf", "right_eye_smplhf")
PELVIS = BODY[0]
BODY_PARENTS = (0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)  # indices for BODY[1:]
PARENTS = {BODY[k]: BODY[parent] for k, parent in enumerate(BODY_PARENTS, 1)} | dict.fromkeys(FACE_JOINTS, "head")
PARENTS |= {name: f"{name.split('_')[0]}_wrist" for name in (*STUBS, *HANDS[::3])}
PARENTS |= {name: before for name, before in zip(HANDS[1:], HANDS, strict=False) if not name.endswith("1")}
ROLES = {"hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "foot": "Toes", "collar": "Shoulder"}
ROLES |= {"shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand"}
# The joints of a bare body, of SMPL, SMPL-H and SMPL-X, by their count.
MODELS = {len(names): names for names in (BODY, BODY + STUBS, BODY + HANDS, BODY + FACE_JOINTS + HANDS)}
CONVENTION = "SMPL"
MODEL_ARRAYS = ("v_template", "shapedirs", "J_regressor")  # of a model's file, from which joints are computed
PARTS = ("root_orient", "pose_body", "pose_jaw", "pose_eye", "pose_hand")  # of `poses`, in files without it
SAME_RATE = 1e-4  # frame rates this near to a whole number are rounded: frame times have few digits [relative]
LEVEL = 0.9  # least cosine between the arms and the sideways axis in a T-pose
SMALLEST_BODY, LARGEST_BODY = 0.3, 3.0  # bounds of a person's height [m]
UPRIGHT = 0.7  # least mean cosine between the pelvis's up and the world's in a motion in which the body stands
ON_FLOOR, MOST_FRAMES = 0.1, 90.0  # a body is on a floor if its lowest joint is so near to height 0 [m] so often [%]
RISE = 0.8  # a body whose pelvis goes farther than this along its own axis, on no floor, lies [m]
TO_Y_UP = Rotation.from_rotvec([-0.5 * np.pi, 0.0, 0.0])  # from the world of AMASS


def array_skeleton(arrays: ArraysFile, betas: Array | None = None) -> Skeleton:
    """Return the skeleton in a file of arrays: of `names`, `parents` and `offsets`; of `J`, (joints, 3) [m], joints of
    SMPL; or of a model of SMPL in the shape `betas`. A FileError if it has none, a SkeletonError if they are invalid.
    """
    if all(name in arrays for name in ("names", "parents", "offsets")):
        names = tuple(map(str, arrays.array("names").ravel()))
        ends = arrays.array("end_sites") if "end_sites" in arrays else np.zeros(len(names), bool)
        with in_file(arrays.path):
            return _skeleton(names, arrays.array("parents"), arrays.array("offsets"), ends)
    betas = np.zeros(0) if betas is None else betas
    if "J" in arrays:
        places = arrays.numbers("J", "joints", 3)
    elif all(name in arrays for name in MODEL_ARRAYS):
        vertices = arrays.numbers("v_template", "vertices", 3)
        shapes = arrays.numbers("shapedirs", len(vertices), 3, "shapes")[..., : len(betas)]
        places = arrays.numbers("J_regressor", "joints", len(vertices)) @ (vertices + shapes @ betas[: shapes.shape[2]])
    else:
        expected = f"J, (joints, 3), or the {', '.join(MODEL_ARRAYS)} of a model"
        raise FileError(arrays.path, f"has no joints; expected {expected}")
    if len(places) not in MODELS:
        known = ", ".join(map(str, MODELS))
        raise FileError(arrays.path, f"has {len(places)} joints; expected one of {known}, as SMPL, SMPL-H and SMPL-X")
    names = MODELS[len(places)]
    parents = np.array([names.index(PARENTS[name]) if name in PARENTS else -1 for name in names])
    offsets = places - np.where(parents[:, None] < 0, 0.0, places[parents])
    return replace(_skeleton(names, parents, offsets, np.zeros(len(names), bool)), units="m", up="Y")


def _skeleton(names: tuple[str, ...], parents: NDArray[Any], offsets: NDArray[Any], ends: NDArray[Any]) -> Skeleton:
    """The skeleton with the usual channels."""
    usual = [() if end else DEFAULT_ROTATIONS if n else DEFAULT_ROOT for n, end in enumerate(ends.ravel().tolist())]
    return Skeleton(names=names, parents=parents, offsets=offsets, channels=tuple(usual), end_sites=ends)


@dataclass(frozen=True, eq=False)
class SmplBody:
    """A skeleton that parameters of SMPL can pose."""

    skeleton: Skeleton
    joints: Mapping[str, int]  # by SMPL's names
    turns: Array  # (joints, 4), the world rotations that turn its rest pose into SMPL's
    exact: bool  # whether its rest pose and joint names are SMPL's

    @classmethod
    def of(cls, skeleton: Skeleton) -> SmplBody:
        """Return the body of a skeleton with any names and rest pose; a SkeletonError if it lacks joints of SMPL."""
        body = Body.of(skeleton)
        if body.anatomy is None or body.at_rest is None:
            raise SkeletonError("is not recognised as human, so parameters of SMPL cannot pose it")
        joints = _joints_of(skeleton, body.anatomy)
        if lacking := [name for name in BODY if name not in joints]:
            raise SkeletonError(f"lacks joints of SMPL: {quoted(lacking)}")
        arms = [body.at_rest.bone(f"{side}UpperArm", f"{side}Hand") for side in SIDES]
        level = all(arm is not None and sign * arm[0] > LEVEL for arm, sign in zip(arms, (1.0, -1.0), strict=True))
        exact = body.anatomy.convention == CONVENTION and level
        return cls(skeleton, joints, skeleton.rest_rotations if exact else t_pose(skeleton, body.at_rest, None), exact)

    @property
    def metre(self) -> float:
        """A metre in file units; if the file states none, the unit in which the body has a person's height."""
        height = float(np.ptp(self.skeleton.rest_positions, axis=0).max())
        likely = (unit for unit in ("m", "cm", "mm") if SMALLEST_BODY < METRES[unit] * height < LARGEST_BODY)
        return 1.0 / METRES[self.skeleton.units or next(likely, "m")]

    @property
    def pelvis(self) -> Array:
        """The pelvis in SMPL's rest pose, relative to the root, (3,) [file units]."""
        return np.asarray(self.skeleton.posed(self.turns)[self.joints[PELVIS]])

    def motion(self, poses: Array, trans: Array, frame_time_text: str) -> Motion:
        """Return the motion of parameters, with Y up; parameters of joints that the body lacks are ignored."""
        names = MODELS[poses.shape[1] // 3]
        turns = dict(zip(names, poses.reshape(len(poses), -1, 3).swapaxes(0, 1), strict=True))
        if not len(poses):
            return self._motion(turns, trans, frame_time_text, TO_Y_UP)
        _, along_y, along_z = Rotation.from_rotvec(turns[PELVIS]).apply([0.0, 1.0, 0.0]).mean(axis=0)
        if along_z > UPRIGHT:
            return self._motion(turns, trans, frame_time_text, TO_Y_UP)
        motion = self._motion(turns, trans, frame_time_text, Rotation.identity())
        on_y, on_z = (self._has_floor(motion, axis) for axis in ("Y", "Z"))
        climbs = np.ptp(motion.positions[:, self.joints[PELVIS], 1]) > RISE * self.metre
        lies = on_z and not on_y and climbs
        stands = along_y > UPRIGHT or (on_y and not on_z)
        return motion if stands and not lies else self._motion(turns, trans, frame_time_text, TO_Y_UP)

    def _has_floor(self, motion: Motion, axis: str) -> bool:
        """Whether the lowest joint of a motion along an axis is near height 0 in most frames."""
        most = np.percentile(np.abs(lowest_heights(motion.positions, axis_vector(axis))), MOST_FRAMES)
        return bool(most < ON_FLOOR * self.metre)

    def _motion(self, turns: Mapping[str, Array], trans: Array, frame_time_text: str, to_y_up: Rotation) -> Motion:
        """The motion of parameters, by joint, in a world that `to_y_up` turns."""
        skeleton = self.skeleton
        rest = Rotation.from_quat(self.turns)
        rotations = np.tile(skeleton.rest_rotations, (len(trans), 1, 1))
        for joint, parent in enumerate(skeleton.parents.tolist()):
            rotations[:, joint] = (rest[parent].inv() * rest[joint] if joint else rest[0]).as_quat()
        for name, joint in self.joints.items():
            if name in turns:
                above = rest[skeleton.parents[joint]].inv() if joint else Rotation.identity()
                turn = Rotation.from_rotvec(turns[name])
                turn = to_y_up * turn if name == PELVIS else turn
                rotations[:, joint] = (above * turn * rest[joint]).as_quat()
        path = to_y_up.apply(self.metre * trans + (skeleton.offsets[0] + self.pelvis)) - self.pelvis
        return Motion(skeleton, path, rotations, frame_time_text)

    def parameters(self, motion: Motion) -> dict[str, Array | float]:
        """Return `poses`, `trans` and `mocap_frame_rate`, for a world with Z up, of a motion with Y up."""
        has = self.joints.keys()
        names = MODELS[len(BODY) + (2 if has.isdisjoint(HANDS) else 30 if has.isdisjoint(FACE_JOINTS) else 33)]
        world, rest = motion.world_rotations, Rotation.from_quat(self.turns)
        turned = {name: Rotation.from_quat(world[:, joint]) * rest[joint].inv() for name, joint in self.joints.items()}
        poses = np.zeros((len(names), len(motion), 3))
        for number, name in enumerate(names):
            if name in turned:
                above = turned[PARENTS[name]] if name in PARENTS else TO_Y_UP
                poses[number] = (above.inv() * turned[name]).as_rotvec()
        places = TO_Y_UP.inv().apply(motion.positions[:, self.joints[PELVIS]])
        rate = 1.0 / motion.frame_time
        return {
            "poses": poses.swapaxes(0, 1).reshape(len(motion), -1),
            "trans": (places - (self.skeleton.offsets[0] + self.pelvis)) / self.metre,
            "mocap_frame_rate": float(round(rate)) if abs(round(rate) - rate) < SAME_RATE * rate else rate,
        }


def _joints_of(skeleton: Skeleton, anatomy: Anatomy) -> dict[str, int]:
    """The joints of a skeleton by SMPL's names."""
    roles, spine = anatomy.roles, anatomy.spine
    wanted = {f"{side}_{part}": f"{side}{role}" for part, role in ROLES.items() for side in SIDES}
    wanted |= {"pelvis": "hips", "neck": "neck", "head": "head"}
    for side in SIDES:
        wanted |= {f"{side}_{name}{n}": f"{side}{role}{n}" for name, role in FINGER_NAMES.items() for n in (1, 2, 3)}
    joints = {name: roles[role] for name, role in wanted.items() if role in roles}
    if len(spine) > 2:
        joints |= zip(("spine1", "spine2", "spine3"), (spine[0], spine[(len(spine) - 1) // 2], spine[-1]), strict=True)
    return joints | {name: skeleton.index(name) for name in (*FACE_JOINTS, *STUBS) if name in skeleton.keys}


def smpl_motion(arrays: ArraysFile, skeleton: Skeleton, frame_time_text: str) -> Motion:
    """Return the motion of the parameters in a file; a FileError if they are invalid, or an error of `SmplBody.of`."""
    names = ["poses"] if "poses" in arrays else [name for name in PARTS if name in arrays]
    poses = np.concatenate([arrays.numbers(name, "frames", "3 joints") for name in names], axis=1)
    if poses.shape[1] not in [3 * number for number in MODELS]:
        known = ", ".join(str(3 * number) for number in MODELS)
        raise FileError(arrays.path, f"has {poses.shape[1]} numbers in each frame of poses; expected one of {known}")
    return SmplBody.of(skeleton).motion(poses, arrays.numbers("trans", len(poses), 3), frame_time_text)


def smpl_parameters(motion: Motion) -> dict[str, Array | float]:
    """Return the parameters of a motion on a body of SMPL (`SmplBody.parameters`); empty for any other body."""
    if convention_of(motion.skeleton) != CONVENTION:
        return {}
    try:
        body = SmplBody.of(motion.skeleton)
    except SkeletonError:
        return {}
    return body.parameters(motion) if body.exact else {}
