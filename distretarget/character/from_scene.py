"""The character of a file: the skeleton that its nodes are in the bind pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.recognition import by_names
from distretarget.character.character import Character
from distretarget.character.deform import with_deform_bones, with_limbs_on_body
from distretarget.character.joints import are_regular, bind_poses, joint_nodes
from distretarget.character.nodes import CharacterScene, Nodes
from distretarget.errors import FileError, SkeletonError, cut, quoted
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST, SMALLEST, USUAL_ROOT, USUAL_ROTATIONS, Skeleton

LONGEST_NAME = 200  # of a joint [characters]
NEAR_SHOWN = 1e-4  # a node whose bind pose differs by less than this from what it shows shows it [body sizes, rad]
FLAT = 1e-6  # axes that are shorter have the length 0 [of the longest axis of the node]
UNEVEN = 1e-3  # axes whose scales differ by more than this are scaled unevenly; a scale that changes more is animated


def character_of(scene: CharacterScene) -> Character:
    """Return the character of a file, whose joints are those of `joint_nodes`; of bones that deform and controls it has
    the former.

    Raises:
        FileError: the file has no such nodes, or too many.
        SkeletonError: they are no skeleton.
    """
    scene, flat = _without_flat_scales(scene)
    above, joints, left_out = joint_nodes(scene)
    line = [*above, *joints]
    _check_scales(scene, line)
    shown, size = scene.nodes.among(line), float(np.ptp(scene.nodes.world[line, :3, 3], axis=0).max())
    binds = bind_poses(scene.nodes, scene.skins)
    poses = [None] * len(above) + [binds.get(node) for node in joints]
    hidden = [scene.nodes.names[node] for node in line if flat[node]]
    warnings = (*scene.notes, *left_out, *_scale_warnings(scene, line, hidden))
    try:
        character = _character(scene, line, shown, _settled(shown, poses, size), len(above), warnings)
        return with_limbs_on_body(with_deform_bones(character))
    except SkeletonError as error:
        raise error.in_file(scene.path) from None


def _without_flat_scales(scene: CharacterScene) -> tuple[CharacterScene, NDArray[np.bool_]]:
    """The scene with scales that can be inverted, and which nodes had others, (nodes,): axes of length 0 get the length
    of the longest, or 1.
    """
    scales = scene.nodes.scales
    longest = np.abs(scales).max(axis=1, keepdims=True, initial=0.0)
    flat = ~(np.abs(scales) > np.maximum(FLAT * longest, SMALLEST))
    regular = np.where(flat, np.where(longest > SMALLEST, longest, 1.0), scales)
    return replace(scene, nodes=replace(scene.nodes, scales=regular)), flat.any(axis=1)


def _check_scales(scene: CharacterScene, line: Sequence[int]) -> None:
    """Raise a FileError unless the transforms of some nodes in the world can be computed with."""
    world = scene.nodes.world[line]
    with np.errstate(all="ignore"):
        sizes = np.abs(world[:, :3, :3]).max(axis=(1, 2))
        fits = are_regular(world) & (sizes >= SMALLEST) & (sizes <= LARGEST)
        fits &= (np.abs(world[:, :3, 3]) <= LARGEST).all(axis=1)
    if not fits.all():
        name = scene.nodes.names[line[int(fits.argmin())]]
        limits = f"scales from {SMALLEST:g} to {LARGEST:g}, not too uneven, and places up to {LARGEST:g}"
        raise FileError(
            scene.path, f"the scale or place of {cut(name)!r} in the world is too extreme; expected {limits}"
        )


def _scale_warnings(scene: CharacterScene, line: Sequence[int], hidden: Sequence[str]) -> Iterator[str]:
    """A line each for hidden nodes, for nodes that are scaled unevenly, and for nodes whose scale changes."""
    if hidden:
        yield f"{quoted(hidden)} have the scale 0, as hidden nodes have; they are taken at full size"
    nodes, sizes = scene.nodes, np.abs(scene.nodes.scales[line])
    spread = np.ptp(sizes, axis=1) / sizes.max(axis=1)
    if uneven := [nodes.names[node] for node, share in zip(line, spread, strict=True) if share > UNEVEN]:
        change = "bones below change their length as they turn, so that hands and feet miss their places"
        much = f"{100 * spread.max():.2g} %"
        yield f"the scale of {quoted(uneven)} is uneven, by {much}: {change}; apply the scale and export it again"
    scales = scene.animation.scales if scene.animation else {}
    changing = [
        nodes.names[node]
        for node in line
        if node in scales and (np.abs(scales[node] - scales[node][:1]) > UNEVEN * np.abs(scales[node][:1])).any()
    ]
    if changing:
        yield f"the scales of {quoted(changing)} change in the animation; they are left out"


def _settled(shown: Nodes, binds: Sequence[Array | None], size: float) -> Array:
    """The transforms of nodes in the world in the bind pose, (nodes, 4, 4), with the scales that they show. Those
    without a bind pose, such as nodes above the joints, are as shown; so are, to the digit, those that show it.
    """
    world = np.empty((len(shown), 4, 4))
    for node, (parent, bind) in enumerate(zip(shown.parents.tolist(), binds, strict=True)):
        base = world[parent] if parent >= 0 else np.eye(4)
        local = shown.transforms[node]
        world[node] = base @ (local if bind is None else _local(base, bind, local, shown.scales[node], size))
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


def _character(
    scene: CharacterScene, line: Sequence[int], shown: Nodes, world: Array, above: int, warnings: tuple[str, ...]
) -> Character:
    """The character of nodes that are at `world` in the bind pose, (nodes, 4, 4), `above` of them above the root."""
    linear = world[:, :3, :3]
    signs = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
    binds = Rotation.from_matrix(nearest_rotations(signs[:, None, None] * linear))
    base = Rotation.from_quat(np.vstack([binds.as_quat(), [0.0, 0.0, 0.0, 1.0]])[shown.parents])
    mirrors = np.sign(shown.scales)
    flips = Rotation.from_matrix(np.prod(mirrors, axis=1)[:, None, None] * np.eye(3) * mirrors[:, None])
    return Character(
        skeleton=_skeleton(scene, line[above:], world[above:, :3, 3]),
        nodes=np.array(line),
        shown=shown,
        binds=binds.as_quat(),
        locals=(base.inv() * binds * flips.inv()).as_quat(),
        scales=signs * np.cbrt(np.abs(np.linalg.det(linear))),
        origin=world[above - 1, :3, 3] if above else np.zeros(3),
        warnings=warnings,
    )


def _skeleton(scene: CharacterScene, nodes: Sequence[int], places: Array) -> Skeleton:
    """The skeleton of nodes that are at these places, (nodes, 3), in the bind pose.

    Position channels have the root, and if the hips hang below it the hips and all joints that are not of the body,
    such as IK handles.
    """
    own = scene.nodes.among(nodes)
    joints = {node: joint for joint, node in enumerate(nodes)}
    skeleton = Skeleton(
        names=_names(own.names, nodes, own.parents.tolist()),
        parents=own.parents,
        offsets=places - np.where((own.parents >= 0)[:, None], places[own.parents], 0.0),
        channels=tuple(USUAL_ROTATIONS if joint else USUAL_ROOT for joint in range(len(nodes))),
        end_sites=np.zeros(len(nodes), bool),
        units=scene.units,
        up=scene.up,
        looks_back=scene.looks_back,
        floor_at_zero=True,
        humanoid=tuple((bone, joints[node]) for bone, node in scene.humanoid.items()),
    )
    if not (anatomy := by_names(skeleton)):
        return skeleton
    body = set(skeleton.subtree(anatomy.roles["hips"])[1:])
    channels = [USUAL_ROTATIONS if joint in body else USUAL_ROOT for joint in range(len(nodes))]
    return replace(skeleton, channels=tuple(channels))


def _names(names: Sequence[str], nodes: Sequence[int], parents: Sequence[int]) -> tuple[str, ...]:
    """The names of joints as BVH can hold them, with _ for what it cannot; the number of the node stands for an empty
    name, and follows a name that a sibling has as well.
    """
    taken: set[tuple[int, str]] = set()
    result = []
    for name, node, parent in zip(names, nodes, parents, strict=True):
        plain = "".join("_" if each in "{}" or not each.isprintable() else each for each in name[:LONGEST_NAME])
        clean = plain.strip() or f"node {node}"
        clean = f"{clean} (node {node})" if (parent, clean) in taken else clean
        taken.add((parent, clean))
        result.append(clean)
    return tuple(result)
