"""VRM animations (.vrma): the motion of a humanoid, which any VRM model plays; specification VRMC_vrm_animation-1.0."""

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

STANDING_WITHIN = 0.1  # a body stands whose lowest joint is this near to height 0 [heights of the body]
USUAL_HEIGHT = 1.7  # of a body whose file does not state its units [m]
EYES = ("leftEye", "rightEye")  # the specification leaves their directions to other nodes
REQUIRED = (
    "hips",
    "spine",
    "head",
    *(side + part for side in SIDES for part in (*ARM[1:], "UpperLeg", "LowerLeg", "Foot")),
)


def vrma(motion: Motion, name: str, extras: Mapping[str, object]) -> Parts:
    """Return the content of a VRM animation of a motion: rotations of the humanoid's bones, and the path of the hips
    [m], with Y up and the body towards Z at rest in T-pose; a MotionError if it lacks bones that a humanoid must have.
    """
    body, bones = _humanoid(motion)
    upright = Rotation.from_matrix(body.reference.axes.T)
    rest = _t_pose(body, bones, upright)
    unit = METRES[motion.skeleton.units] if motion.skeleton.units else USUAL_HEIGHT / body.height
    joints = sorted(bones.values())
    number = {joint: place for place, joint in enumerate(joints)}
    lines = [[number[each] for each in motion.skeleton.to_root(joint)[1:] if each in number] for joint in joints]
    parents = np.array([line[0] if line else -1 for line in lines])
    places = motion.skeleton.posed(rest.as_quat())
    # The height of the root, on which players scale the path: as stated, or if nobody could stand so, with the lowest
    # joint on the floor.
    height, lowest = float(upright.apply(np.array(motion.skeleton.offsets[0]))[1]), float(places[:, 1].min())
    height = height if abs(height + lowest) < STANDING_WITHIN * float(np.ptp(places[:, 1])) else -lowest
    offsets = unit * (places[joints] - np.where((parents >= 0)[:, None], places[joints][parents], [0.0, -height, 0.0]))
    world = upright * Rotation.from_quat(motion.world_rotations[:, joints]) * rest[joints].inv()
    above = Rotation.from_quat(
        np.concatenate([world.as_quat(), np.tile([0.0, 0, 0, 1], (len(motion), 1, 1))], axis=1)[:, parents]
    )
    local = (above.inv() * world).as_quat()
    hips = unit * upright.apply(motion.positions[:, bones["hips"]])
    translations, rotations = {number[bones["hips"]]: hips}, {place: local[:, place] for place in number.values()}
    animation = Animation(name, len(motion), motion.frame_time_text, translations, rotations, extras=extras)
    document = compact(_document(bones, number, parents, offsets))
    return animated(parse_gltf(document.encode(), "animation.vrma"), [animation])


def as_humanoid(motion: Motion) -> Motion:
    """Return a motion as a VRM animation holds it: all joints but the bones of the humanoid follow their parents, bones
    keep their lengths, and the hips keep their place. Errors as in `vrma`.
    """
    skeleton, (_, bones) = motion.skeleton, _humanoid(motion)
    world, kept = motion.world_rotations, set(bones.values())
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if joint not in kept:
            world[:, joint] = world[:, parent] if joint else [0.0, 0.0, 0.0, 1.0]
    make_local(skeleton.parents, world)
    held = Motion(skeleton, motion.root_positions, world, motion.frame_time_text)
    hips = np.array([bones["hips"]])
    away = motion.positions_of(hips) - held.positions_of(hips)
    return held.moved(away[:, 0])


def _humanoid(motion: Motion) -> tuple[Body, dict[str, int]]:
    """The body in a motion, and the joint of each bone of the humanoid; a MotionError if it lacks one."""
    body = Body.of(motion.skeleton, motion if len(motion) else None)
    bones = humanoid_bones(body)
    if missing := [bone for bone in REQUIRED if bone not in bones]:
        raise MotionError(f"a VRM animation needs the bones {quoted(missing)}, which the target lacks")
    return body, bones


def humanoid_bones(body: Body) -> dict[str, int]:
    """Return the joint of each bone of the humanoid, by VRM 1.0's names: those that the file states, else the roles."""
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
        bones["spine"] = bones.pop("chest")  # a single joint is the spine
    return bones


def _t_pose(body: Body, bones: Mapping[str, int], upright: Rotation) -> Rotation:
    """(joints,), the world rotations of the body in T-pose: as it stands, with the arms straight out to the sides."""
    skeleton = body.skeleton
    turns = (upright * Rotation.from_quat(body.reference.rotations)).as_quat()
    if skeleton.humanoid:
        return Rotation.from_quat(turns)  # VRM models rest in T-pose
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for upper, lower in pairwise([bones[side + part] for part in ARM[1:]]):
            places = skeleton.posed(turns)
            bone = normalised(places[lower] - places[upper])
            turn, below = least(bone[None], np.array([[sign, 0.0, 0.0]])), skeleton.subtree(upper)
            turns[below] = (turn * Rotation.from_quat(turns[below])).as_quat()
    return Rotation.from_quat(turns)


def _document(
    bones: Mapping[str, int], number: Mapping[int, int], parents: NDArray[np.intp], offsets: Array
) -> dict[str, object]:
    """The glTF document of the humanoid at rest, without its animation."""
    names = {joint: bone for bone, joint in bones.items()}
    nodes: list[dict[str, object]] = []
    for joint, place in number.items():
        children = np.flatnonzero(parents == place).tolist()
        node = {"name": names[joint], "translation": offsets[place].tolist()}
        nodes.append(node | ({"children": children} if children else {}))
    humanoid = {"humanBones": {bone: {"node": number[joint]} for bone, joint in bones.items()}}
    return {
        "asset": {"version": "2.0", "generator": "distretarget"},
        "scene": 0,
        "scenes": [{"nodes": np.flatnonzero(parents < 0).tolist()}],
        "nodes": nodes,
        "extensionsUsed": ["VRMC_vrm_animation"],
        "extensions": {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": humanoid}},
    }
