"""Rigs whose joints have axes of their own, so that nobody can stand in their rest pose, with known answers."""

import itertools

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget import Motion
from distretarget.body.anatomy import SIDES
from distretarget.numerics.kinematics import make_local
from distretarget.numerics.vectors import normalised


def with_axes(motion, axes):
    """The same motion by joints with other axes, which are `axes`, (joints,), in the rest pose; without rotations, they
    make a pose in which nobody can stand.
    """
    skeleton, parents = motion.skeleton, np.maximum(motion.skeleton.parents, 0)
    offsets = np.array(skeleton.offsets)
    offsets[1:] = axes[parents[1:]].inv().apply(offsets[1:])
    world = (Rotation.from_quat(motion.world_rotations) * axes).as_quat()
    make_local(skeleton.parents, world)
    return Motion(skeleton.with_offsets(offsets), motion.root_positions, world, motion.frame_time_text)


def frame(x, y):
    """The rotation of a joint whose X axis points along `x`, and whose Y axis is near `y`, both (3,)."""
    z = normalised(np.cross(x, y))
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=1))


def along_bones(body):
    """The axes of joints that are built as in LAFAN1's files, in the rest pose of a body that stands: X along the bone,
    Z the axis about which knees and ankles bend.
    """
    _, up, forward = np.eye(3)
    roles = {joint: role for role, joint in body.anatomy.roles.items()}
    limbs = [("UpperArm", "LowerArm", "Hand"), ("Shoulder", "UpperArm"), ("UpperLeg", "LowerLeg", "Foot", "Toes")]
    below = {side + a: side + b for side in SIDES for limb in limbs for a, b in itertools.pairwise(limb)}
    axes = []
    for joint, parent in enumerate(body.skeleton.parents):
        role = roles.get(joint, "")
        if role in below:
            bone = body.at_rest.bone(role, below[role])
            axes.append(frame(bone, up if role.endswith("Foot") else forward))
        elif role.endswith("Toes"):
            axes.append(frame(forward, up))
        else:
            axes.append(axes[parent] if role.endswith("Hand") or body.skeleton.end_sites[joint] else frame(up, forward))
    return Rotation.concatenate(axes)


def bones_along_y(body):
    """The same with Y along the bone, as iClone has it."""
    return along_bones(body) * frame(*np.eye(3)[[2, 0]])


def mirrored_axes(body):
    """The same with the right side mirrored, and hips turned about the spine, as Bandai-Namco have them."""
    axes = along_bones(body)
    turns = [Rotation.identity()] * len(body.skeleton)
    for role, joint in body.anatomy.roles.items():
        for below in body.skeleton.subtree(joint) if role in ("rightShoulder", "rightUpperLeg") else ():
            turns[below] = Rotation.from_euler("z", 180, degrees=True)
    turns[body.anatomy.roles["hips"]] = Rotation.from_euler("x", 90, degrees=True)
    return axes * Rotation.concatenate(turns)


BUILDS = along_bones, bones_along_y, mirrored_axes
