"""Write VRM animations (.vrma): motions of a humanoid that any VRM model plays; VRMC_vrm_animation-1.0."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import ARM, FINGERS, SIDES
from distretarget.body.body import Body
from distretarget.body.recognition import FINGER, THUMB
from distretarget.character.nodes import Animation
from distretarget.errors import MotionError, quoted
from distretarget.io.gltf import parse_gltf
from distretarget.io.gltf_writer import Parts, animated
from distretarget.io.json_node import compact
from distretarget.motion import Motion
from distretarget.numerics.kinematics import make_local
from distretarget.numerics.rotations import least
from distretarget.numerics.vectors import Array, normalised
from distretarget.skeleton import METRES

STANDING_WITHIN = 0.1  # the lowest joint of a standing body is this near to height 0 [heights of the body]
USUAL_HEIGHT = 1.7  # assumed for a body in a file without units [m]
EYES = ("leftEye", "rightEye")  # VRM animations express their directions by another node
REQUIRED = (
    "hips",
    "spine",
    "head",
    *(side + part for side in SIDES for part in (*ARM[1:], "UpperLeg", "LowerLeg", "Foot")),
)


def vrma(motion: Motion, name: str, extras: Mapping[str, object]) -> Parts:
    """Return a VRM animation: rotations of the humanoid's bones, positions of the hips [m]; a T-pose to Z at rest."""
    body, bones = _humanoid(motion)
    upright = Rotation.from_matrix(body.reference.axes.T)
    rest = _t_pose(body, bones, upright)
    unit = METRES[motion.skeleton.units] if motion.skeleton.units else USUAL_HEIGHT / body.height
    joints = sorted(bones.values())
    node_of = {joint: node for node, joint in enumerate(joints)}
    ancestors = [[node_of[each] for each in motion.skeleton.to_root(joint)[1:] if each in node_of] for joint in joints]
    parents = np.array([above[0] if above else -1 for above in ancestors])
    positions = motion.skeleton.posed(rest.as_quat())
    # The height of the root, by which players scale the path: the stated one, or if the body would not stand at it, the
    # one that puts the lowest joint on the floor.
    height, lowest = float(upright.apply(np.array(motion.skeleton.offsets[0]))[1]), float(positions[:, 1].min())
    height = height if abs(height + lowest) < STANDING_WITHIN * float(np.ptp(positions[:, 1])) else -lowest
    above = np.where((parents >= 0)[:, None], positions[joints][parents], [0.0, -height, 0.0])
    offsets = unit * (positions[joints] - above)
    world = upright * Rotation.from_quat(motion.world_rotations[:, joints]) * rest[joints].inv()
    parent_world = Rotation.from_quat(
        np.concatenate([world.as_quat(), np.tile([0.0, 0, 0, 1], (len(motion), 1, 1))], axis=1)[:, parents]
    )
    local = (parent_world.inv() * world).as_quat()
    hips = unit * upright.apply(motion.positions[:, bones["hips"]])
    translations, rotations = {node_of[bones["hips"]]: hips}, {node: local[:, node] for node in node_of.values()}
    animation = Animation(name, len(motion), motion.frame_time_text, translations, rotations, extras=extras)
    document = compact(_document(bones, node_of, parents, offsets))
    return animated(parse_gltf(document.encode(), "animation.vrma"), [animation])


def as_humanoid(motion: Motion) -> Motion:
    """Return a motion as a VRM animation holds it: other joints follow their parents; the hips keep their positions."""
    skeleton, (_, bones) = motion.skeleton, _humanoid(motion)
    world, humanoid = motion.world_rotations, set(bones.values())
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if joint not in humanoid:
            world[:, joint] = world[:, parent] if joint else [0.0, 0.0, 0.0, 1.0]
    make_local(skeleton.parents, world)
    result = Motion(skeleton, motion.root_positions, world, motion.frame_time_text)
    hips = np.array([bones["hips"]])
    offset = motion.positions_of(hips) - result.positions_of(hips)
    return result.moved(offset[:, 0])


def _humanoid(motion: Motion) -> tuple[Body, dict[str, int]]:
    """The body in a motion, and the joint of each bone of the humanoid; a MotionError if it lacks one."""
    body = Body.of(motion.skeleton, motion if len(motion) else None)
    bones = humanoid_bones(body)
    if missing := [bone for bone in REQUIRED if bone not in bones]:
        raise MotionError(f"a VRM animation needs the bones {quoted(missing)}, which the target lacks")
    return body, bones


def humanoid_bones(body: Body) -> dict[str, int]:
    """Return the joints of the humanoid's bones by VRM 1.0's names, as the file states them, else by their roles."""
    if body.skeleton.humanoid:
        return {bone: joint for bone, joint in body.skeleton.humanoid if bone not in EYES}
    fingers = {
        f"{side}{finger}{number}": f"{side}{finger}{bone}"
        for side in SIDES
        for finger in FINGERS
        for number, bone in enumerate(THUMB if finger == "Thumb" else FINGER, start=1)
    }
    others = {f"{side}{finger}0" for side in SIDES for finger in FINGERS}
    bones = {fingers.get(role, role): joint for role, joint in body.roles.items() if role not in others}
    if "spine" not in bones and "chest" in bones:
        bones["spine"] = bones.pop("chest")  # VRM requires a spine, so a single joint becomes it
    return bones


def _t_pose(body: Body, bones: Mapping[str, int], upright: Rotation) -> Rotation:
    """The world rotations of the body in T-pose, (joints,): its reference pose with the arms straight to the sides."""
    skeleton = body.skeleton
    turns = (upright * Rotation.from_quat(body.reference.rotations)).as_quat()
    if skeleton.humanoid:
        return Rotation.from_quat(turns)  # VRM models rest in T-pose
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for upper, lower in pairwise([bones[side + part] for part in ARM[1:]]):
            positions = skeleton.posed(turns)
            bone = normalised(positions[lower] - positions[upper])
            turn, below = least(bone[None], np.array([[sign, 0.0, 0.0]])), skeleton.subtree(upper)
            turns[below] = (turn * Rotation.from_quat(turns[below])).as_quat()
    return Rotation.from_quat(turns)


def _document(
    bones: Mapping[str, int], node_of: Mapping[int, int], parents: NDArray[np.intp], offsets: Array
) -> dict[str, object]:
    """The glTF document of the humanoid at rest, without its animation."""
    names = {joint: bone for bone, joint in bones.items()}
    nodes: list[dict[str, object]] = []
    for joint, node in node_of.items():
        children = np.flatnonzero(parents == node).tolist()
        entry = {"name": names[joint], "translation": offsets[node].tolist()}
        nodes.append(entry | ({"children": children} if children else {}))
    humanoid = {"humanBones": {bone: {"node": node_of[joint]} for bone, joint in bones.items()}}
    return {
        "asset": {"version": "2.0", "generator": "distretarget"},
        "scene": 0,
        "scenes": [{"nodes": np.flatnonzero(parents < 0).tolist()}],
        "nodes": nodes,
        "extensionsUsed": ["VRMC_vrm_animation"],
        "extensions": {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": humanoid}},
    }
