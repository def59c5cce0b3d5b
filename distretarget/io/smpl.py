"""SMPL, SMPL-H and SMPL-X: the joints of their bodies, and parameters of their poses as AMASS has them.

    poses  (frames, 3 joints)  how each joint is turned against its parent, as rotation vectors [rad]
    trans  (frames, 3)         where the model is [m]; its pelvis is at `trans` plus the pelvis of the rest pose
    betas  (n,)                the shape of the body, for which a model's file is needed

No joint is turned in the rest pose, a T-pose with Y up that faces Z. The world of AMASS has Z up. Loper et al., "SMPL",
doi:10.1145/2816795.2818013; Mahmood et al., "AMASS", doi:10.1109/ICCV.2019.00554.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.body.body import Body
from distretarget.body.conventions import convention_of
from distretarget.body.reference_pose import t_pose
from distretarget.errors import FileError, SkeletonError, in_file, quoted
from distretarget.io.arrays import ArraysFile
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array
from distretarget.skeleton import DEFAULT_ROOT, DEFAULT_ROTATIONS, METRES, Skeleton

# The joints whose turns are parameters, in their order.
BODY = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
FINGER_NAMES = {"index": "Index", "middle": "Middle", "pinky": "Little", "ring": "Ring", "thumb": "Thumb"}
HANDS = tuple(f"{side}_{finger}{bone}" for side in SIDES for finger in FINGER_NAMES for bone in (1, 2, 3))
STUBS = ("left_hand", "right_hand")  # of SMPL alone, in place of hands
FACE_JOINTS = ("jaw", "left_eye_smplhf", "right_eye_smplhf")
PELVIS = BODY[0]
ABOVE = (0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)  # the parents of BODY[1:], by number
PARENTS = {name: BODY[above] for name, above in zip(BODY[1:], ABOVE, strict=True)} | dict.fromkeys(FACE_JOINTS, "head")
PARENTS |= {name: f"{name.split('_')[0]}_wrist" for name in (*STUBS, *HANDS[::3])}
PARENTS |= {name: before for name, before in zip(HANDS[1:], HANDS, strict=False) if not name.endswith("1")}
ROLES = {"hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "foot": "Toes", "collar": "Shoulder"}
ROLES |= {"shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand"}
# The joints of the body alone, of SMPL, SMPL-H and SMPL-X, by their number.
MODELS = {len(names): names for names in (BODY, BODY + STUBS, BODY + HANDS, BODY + FACE_JOINTS + HANDS)}
CONVENTION = "SMPL"
SHAPE = ("v_template", "shapedirs", "J_regressor")  # the arrays of a model's file that give the joints of a shape
PARTS = ("root_orient", "pose_body", "pose_jaw", "pose_eye", "pose_hand")  # of `poses`, in files without it
SAME_RATE = 1e-4  # a frame rate this near to a whole number is one; frame times in files have few digits [relative]
LEVEL = 0.9  # an arm in T-pose has a larger cosine than this with the sideways axis [cosine]
SMALLEST_BODY, LARGEST_BODY = 0.3, 3.0  # bounds of a person's height [m]
UPRIGHT = 0.7  # a body with a larger mean cosine than this between its up and Y moves in a world with Y up [cosine]
TO_Y_UP = Rotation.from_rotvec([-0.5 * np.pi, 0.0, 0.0])  # from the world of AMASS


def array_skeleton(arrays: ArraysFile, betas: Array | None = None) -> Skeleton:
    """Return the skeleton in a file of arrays: `names`, `parents` and `offsets`, as `Motion.to_dict` gives them, or
    that of SMPL: `J`, (joints, 3) [m], or a model, whose joints depend on the shape `betas`, by default the mean one. A
    FileError if it has none of these, or other joints than the models; a SkeletonError if they are no skeleton.
    """
    if all(name in arrays for name in ("names", "parents", "offsets")):
        names = tuple(map(str, arrays.array("names").ravel()))
        ends = arrays.array("end_sites") if "end_sites" in arrays else np.zeros(len(names), bool)
        with in_file(arrays.path):
            return _free(names, arrays.array("parents"), arrays.array("offsets"), ends)
    betas = np.zeros(0) if betas is None else betas
    if "J" in arrays:
        places = arrays.numbers("J", "joints", 3)
    elif all(name in arrays for name in SHAPE):
        vertices = arrays.numbers("v_template", "vertices", 3)
        shapes = arrays.numbers("shapedirs", len(vertices), 3, "shapes")[..., : len(betas)]
        places = arrays.numbers("J_regressor", "joints", len(vertices)) @ (vertices + shapes @ betas[: shapes.shape[2]])
    else:
        raise FileError(arrays.path, f"has no joints; expected J, (joints, 3), or the {', '.join(SHAPE)} of a model")
    if len(places) not in MODELS:
        known = ", ".join(map(str, MODELS))
        raise FileError(arrays.path, f"has {len(places)} joints; expected one of {known}, as SMPL, SMPL-H and SMPL-X")
    names = MODELS[len(places)]
    parents = np.array([names.index(PARENTS[name]) if name in PARENTS else -1 for name in names])
    offsets = places - np.where(parents[:, None] < 0, 0.0, places[parents])
    return replace(_free(names, parents, offsets, np.zeros(len(names), bool)), units="m", up="Y")


def _free(names: tuple[str, ...], parents: NDArray[Any], offsets: NDArray[Any], ends: NDArray[Any]) -> Skeleton:
    """The skeleton whose root moves freely and whose other joints turn freely."""
    free = [() if end else DEFAULT_ROTATIONS if n else DEFAULT_ROOT for n, end in enumerate(ends.ravel().tolist())]
    return Skeleton(names=names, parents=parents, offsets=offsets, channels=tuple(free), end_sites=ends)


@dataclass(frozen=True, eq=False)
class SmplBody:
    """A skeleton that parameters pose."""

    skeleton: Skeleton
    joints: Mapping[str, int]  # those that parameters turn, by SMPL's names
    turns: Array  # (joints, 4), the world rotations that bring its rest pose into SMPL's
    exact: bool  # whether its rest pose is SMPL's, and its joints have SMPL's names

    @classmethod
    def of(cls, skeleton: Skeleton) -> SmplBody:
        """Return the body of a skeleton, under any names and in any rest pose; a SkeletonError if it lacks joints."""
        body = Body.of(skeleton)
        if body.anatomy is None or body.at_rest is None:
            raise SkeletonError("is not recognised as human, so parameters of SMPL cannot pose it")
        joints = _joints_of(skeleton, body.anatomy)
        if lacking := [name for name in BODY if name not in joints]:
            raise SkeletonError(f"lacks joints of SMPL: {quoted(lacking)}")
        left = [body.at_rest.bone(f"{side}UpperArm", f"{side}Hand") for side in SIDES]
        level = all(arm is not None and sign * arm[0] > LEVEL for arm, sign in zip(left, (1.0, -1.0), strict=True))
        exact = body.anatomy.convention == CONVENTION and level
        return cls(skeleton, joints, skeleton.rest_rotations if exact else t_pose(skeleton, body.at_rest, None), exact)

    @property
    def metre(self) -> float:
        """A metre [file units]; where the file states no unit, that in which the body is as tall as a person."""
        height = float(np.ptp(self.skeleton.rest_positions, axis=0).max())
        likely = (unit for unit in ("m", "cm", "mm") if SMALLEST_BODY < METRES[unit] * height < LARGEST_BODY)
        return 1.0 / METRES[self.skeleton.units or next(likely, "m")]

    @property
    def pelvis(self) -> Array:
        """(3,), where the pelvis is in SMPL's rest pose, from the root on [file units]."""
        return np.asarray(self.skeleton.posed(self.turns)[self.joints[PELVIS]])

    def motion(self, poses: Array, trans: Array, frame_time_text: str) -> Motion:
        """Return the motion of parameters, turned so that Y is up; those of joints that the body lacks are left out."""
        names, skeleton = MODELS[poses.shape[1] // 3], self.skeleton
        turns = dict(zip(names, poses.reshape(len(poses), -1, 3).swapaxes(0, 1), strict=True))
        cosines = Rotation.from_rotvec(turns[PELVIS]).apply([0.0, 1.0, 0.0])[:, 1] if len(poses) else np.zeros(1)
        to_y_up = Rotation.identity() if cosines.mean() > UPRIGHT else TO_Y_UP
        rest = Rotation.from_quat(self.turns)
        rotations = np.tile(skeleton.rest_rotations, (len(poses), 1, 1))
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
        """Return `poses`, `trans` and `mocap_frame_rate` of a motion in which Y is up, for a world with Z up."""
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
    """The joints that parameters turn, by SMPL's names."""
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
    """Return the motion of the parameters in a file; a FileError if they are none, or a SkeletonError."""
    whole = ["poses"] if "poses" in arrays else [name for name in PARTS if name in arrays]
    poses = np.concatenate([arrays.numbers(name, "frames", "3 joints") for name in whole], axis=1)
    if poses.shape[1] not in [3 * number for number in MODELS]:
        known = ", ".join(str(3 * number) for number in MODELS)
        raise FileError(arrays.path, f"has {poses.shape[1]} numbers in each frame of poses; expected one of {known}")
    return SmplBody.of(skeleton).motion(poses, arrays.numbers("trans", len(poses), 3), frame_time_text)


def smpl_parameters(motion: Motion) -> dict[str, Array | float]:
    """Return the parameters of a motion on a body of SMPL (`SmplBody.parameters`); none on any other body."""
    if convention_of(motion.skeleton) != CONVENTION:
        return {}
    try:
        body = SmplBody.of(motion.skeleton)
    except SkeletonError:
        return {}
    return body.parameters(motion) if body.exact else {}
