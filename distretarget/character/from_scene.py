"""The character of a file: the skeleton that its nodes are in the bind pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.recognition import by_names
from distretarget.character.bind_pose import bind_poses, in_world, matrices
from distretarget.character.character import Character
from distretarget.character.deform import with_deform_bones
from distretarget.character.joint_nodes import joint_nodes, top_down
from distretarget.character.nodes import Nodes, Scene
from distretarget.character.scales import check_scales, flat_warnings, scale_warnings, without_flat_scales
from distretarget.numerics.rotations import nearest_rotations
from distretarget.skeleton import SMALLEST, USUAL_ROOT, USUAL_ROTATIONS, Skeleton

Array = NDArray[np.float64]

LONGEST_NAME = 200  # of a joint [characters]
NEAR_SHOWN = 1e-4  # a node whose bind pose differs by less than this from what it shows shows it [body sizes, rad]


def character_of(scene: Scene) -> Character:
    """Return the character of a file, whose joints are those of `joint_nodes`; of bones that deform and controls it has
    the former.

    Raises:
        FileError: the file has no such nodes, or too many.
    """
    scene, flat = without_flat_scales(scene)
    nodes, order = scene.nodes, top_down(scene.nodes.parents)
    above, joints, left_out = joint_nodes(scene, order)
    line = [*above, *joints]
    with np.errstate(all="ignore"):
        shown = in_world(nodes, order)
    check_scales(scene, line, shown)
    binds = _settled(nodes, line, len(above), shown, bind_poses(scene.skins, shown, order))
    warnings = (*scene.notes, *left_out, *flat_warnings(scene, flat, line), *scale_warnings(scene, line))
    character = _character(scene, line, len(above), binds, warnings)
    return with_deform_bones(character)


def _settled(nodes: Nodes, line: Sequence[int], above: int, shown: Array, binds: Mapping[int, Array]) -> Array:
    """The transforms of the nodes of a line of nodes in the world in the bind pose, (nodes, 4, 4), with the scales that
    they show. Nodes above the joints, and those between that no skin uses, are as shown; so are, to the digit, those
    that show their bind pose.
    """
    world, places = np.empty((len(line), 4, 4)), {-1: -1}
    size = float(np.ptp(shown[list(line), :3, 3], axis=0).max())
    for place, node in enumerate(line):
        parent = places.get(nodes.parents.item(node), -1)
        base = world[parent] if parent >= 0 else np.eye(4)
        local = matrices(nodes.translations[[node]], nodes.rotations[[node]], nodes.scales[[node]])[0]
        if place >= above and node in binds:
            local = _local(base, binds[node], local, nodes.scales[node], size)
        world[place], places[node] = base @ local, place
    return world


def _local(base: Array, bind: Array, shown: Array, scale: Array, size: float) -> Array:
    """The bind pose of a node relative to its parent, `base`; parts that differ from what it shows by rounding are as
    it shows them.
    """
    local = np.linalg.inv(base) @ bind
    mirrored = np.sign(np.linalg.det(local[:3, :3])) * np.sign(scale.prod())
    turn = nearest_rotations((local[:3, :3] * mirrored / scale)[None])[0]
    shown_turn = nearest_rotations((shown[:3, :3] / scale)[None])[0]
    turn = shown_turn if np.abs(turn - shown_turn).max() < NEAR_SHOWN else turn
    unit = max(float(np.cbrt(abs(np.linalg.det(base[:3, :3])))), SMALLEST)
    near = np.linalg.norm(local[:3, 3] - shown[:3, 3]) * unit < NEAR_SHOWN * size
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = turn * scale, shown[:3, 3] if near else local[:3, 3]
    return result


def _character(scene: Scene, line: Sequence[int], above: int, world: Array, warnings: tuple[str, ...]) -> Character:
    nodes, chosen = scene.nodes, np.array(line)
    places = {node: place for place, node in enumerate(line)}
    parents = np.array([places.get(parent, -1) for parent in nodes.parents[chosen].tolist()])
    linear = world[:, :3, :3]
    signs = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
    binds = Rotation.from_matrix(nearest_rotations(signs[:, None, None] * linear))
    base = Rotation.from_quat(np.vstack([binds.as_quat(), [0.0, 0.0, 0.0, 1.0]])[parents])
    mirrors = np.sign(nodes.scales[chosen])
    flips = Rotation.from_matrix(np.prod(mirrors, axis=1)[:, None, None] * np.eye(3) * mirrors[:, None])
    skeleton = _skeleton(scene, chosen[above:], parents[above:] - above, world[above:, :3, 3])
    return Character(
        skeleton=skeleton,
        nodes=chosen,
        parents=parents,
        shown=Nodes(
            names=tuple(nodes.names[node] for node in line),
            parents=parents,
            translations=nodes.translations[chosen],
            rotations=nodes.rotations[chosen],
            scales=nodes.scales[chosen],
        ),
        binds=binds.as_quat(),
        locals=(base.inv() * binds * flips.inv()).as_quat(),
        scales=signs * np.cbrt(np.abs(np.linalg.det(linear))),
        origin=world[above - 1, :3, 3] if above else np.zeros(3),
        warnings=warnings,
    )


def _skeleton(scene: Scene, nodes: NDArray[np.intp], parents: NDArray[np.intp], places: Array) -> Skeleton:
    """The skeleton of nodes that are at these places, (nodes, 3), in the bind pose."""
    parents = np.maximum(parents, -1)
    offsets = places - np.where((parents >= 0)[:, None], places[parents], 0.0)
    joints = {node: joint for joint, node in enumerate(nodes.tolist())}
    skeleton = Skeleton(
        names=_names([scene.nodes.names[node] for node in nodes], nodes.tolist(), parents.tolist()),
        parents=parents,
        offsets=offsets,
        channels=tuple(USUAL_ROTATIONS if joint else USUAL_ROOT for joint in range(len(nodes))),
        end_sites=np.zeros(len(nodes), bool),
        units=scene.units,
        up=scene.up,
        looks_back=scene.looks_back,
        floor_at_zero=True,
        humanoid=tuple((bone, joints[node]) for bone, node in scene.humanoid.items()),
    )
    return replace(skeleton, channels=_with_positions(skeleton))


def _with_positions(skeleton: Skeleton) -> tuple[tuple[str, ...], ...]:
    """The channels of the joints: positions for the root, and if the hips hang below it for the hips and all joints
    that are not of the body, such as IK handles.
    """
    anatomy = by_names(skeleton)
    body = set(skeleton.subtree(anatomy.roles["hips"])[1:]) if anatomy else set(range(1, len(skeleton)))
    return tuple(USUAL_ROTATIONS if joint in body else USUAL_ROOT for joint in range(len(skeleton)))


def _names(names: Sequence[str], nodes: Sequence[int], parents: Sequence[int]) -> tuple[str, ...]:
    """The names of joints as BVH can hold them; the number of the node stands for an empty name, and follows a name
    that a sibling has as well.
    """
    taken: set[tuple[int, str]] = set()
    result = []
    for name, node, parent in zip(names, nodes, parents, strict=True):
        clean = _clean(name[:LONGEST_NAME]) or f"node {node}"
        clean = f"{clean} (node {node})" if (parent, clean) in taken else clean
        taken.add((parent, clean))
        result.append(clean)
    return tuple(result)


def _clean(name: str) -> str:
    """A name with _ for what BVH cannot hold in a name; empty where nothing is left."""
    plain = "".join("_" if each in "{}" or not each.isprintable() else each for each in name)
    return plain.strip()
