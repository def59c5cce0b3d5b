"""The character of a file: the nodes that are its joints, their bind pose, and the skeleton.

A skin states the bind pose as inverse bind matrices, from the mesh's space to each joint's. Files do not state where
the mesh's space is in the world: the transform of the mesh's node does not count (glTF 2.0 specification, section
3.7.3.3). It is found from joints that have their bind pose in the file.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from distretarget.body.conventions import NamedTree
from distretarget.body.named_anatomy import by_tree
from distretarget.body.recognition import by_names
from distretarget.body.tree_repairs import attached_limbs
from distretarget.character.character import Character, deform_bones
from distretarget.character.nodes import CharacterScene, Nodes, SkinBinding
from distretarget.errors import FileError, counted, cut, in_file, quoted
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import Array
from distretarget.skeleton import DEFAULT_ROOT, DEFAULT_ROTATIONS, LARGEST, SMALLEST, Skeleton

MOST_JOINTS = 4096  # of a character, with the nodes above: skeletons have matrices of joints x joints
AGREE = 1e-3  # two transforms agree if they differ by less than this [of their scale, and of the body]
SHARE = 0.5  # the mesh's space is one on which at least this share of the joints agrees
REGULAR = 1e-9  # a matrix with a smaller determinant has no inverse [of its largest entry, cubed]
LONGEST_NAME = 200  # of a joint [characters]
NEAR_SHOWN = 1e-4  # bind poses that differ by less from the file's pose are set to that [body sizes, rad]
FLAT = 1e-6  # axes that are shorter have the length 0 [of the longest axis of the node]
UNEVEN = 1e-3  # the axes of unevenly scaled nodes differ by more than this; an animated scale changes by more


def joint_nodes(scene: CharacterScene) -> tuple[list[int], list[int], tuple[str, ...]]:
    """Return the nodes above the root, from the top; the joints, parents first; and a warning of other skeletons.
    Joints are the nodes of skins and humanoid, or with the names of a body, or that turn, and all between. A FileError
    if there are none, too many, or no common root.
    """
    nodes = scene.nodes
    wanted, left_out = _wanted(scene)
    above, carried = [_common_ancestor(wanted, nodes)], _carried(wanted, nodes)
    while (parent := nodes.parents.item(above[-1])) >= 0:
        above.append(parent)
    are_above = set(above[1:])
    joints = [node for node in nodes.top_down if carried[node] and node not in are_above]
    if len(joints) + len(are_above) > MOST_JOINTS:
        counts = f"{counted(len(joints), 'joint')} and {counted(len(are_above), 'node')} above"
        raise FileError(scene.path, f"its skeleton has {counts}; expected at most {MOST_JOINTS}")
    return above[:0:-1], joints, left_out


def _carried(some: Iterable[int], nodes: Nodes) -> list[int]:
    """The number of some nodes in the subtree of each node of the forest, itself included."""
    parents, counts = nodes.parents.tolist(), [0] * len(nodes)
    for node in some:
        counts[node] = 1
    for node in reversed(nodes.top_down):
        if parents[node] >= 0:
            counts[parents[node]] += counts[node]
    return counts


def _common_ancestor(some: Collection[int], nodes: Nodes) -> int:
    """The lowest common ancestor of some different nodes, which may be one of them; -1 if there is none."""
    counts = _carried(some, nodes)
    return next((node for node in reversed(nodes.top_down) if counts[node] == len(some)), -1)


def _branches(above: int, nodes: Nodes) -> list[int]:
    """The branch of each node: the child of `above` that it is or hangs from, for all others the root of their tree."""
    parents, branches = nodes.parents.tolist(), list(range(len(nodes)))
    for node in nodes.top_down:
        if parents[node] not in (-1, above) and node != above:
            branches[node] = branches[parents[node]]
    return branches


def _wanted(scene: CharacterScene) -> tuple[list[int], tuple[str, ...]]:
    """The nodes that are joints in any case, and a warning of other skeletons, which share no branch with these."""
    groups = [list(scene.humanoid.values()), *(skin.joints.tolist() for skin in scene.skins)]
    if not any(groups):
        groups = [_named(scene.nodes) or [*(scene.animation.rotations if scene.animation else ())]]
    every = list(dict.fromkeys(node for group in groups for node in group))
    if not every:
        found = "has no skin, no VRM humanoid, and no nodes with the names of a body"
        raise FileError(scene.path, f"{found}; expected a character")
    skeletons = _skeletons(groups, _branches(_common_ancestor(every, scene.nodes), scene.nodes))
    chosen = next((each for each in skeletons if groups[0] and groups[0][0] in each), max(skeletons, key=len))
    others = [scene.nodes.names[next(iter(each))] for each in skeletons if each is not chosen]
    if _common_ancestor(chosen, scene.nodes) < 0:
        raise FileError(scene.path, "the joints of its skin hang from no common node; expected a single skeleton")
    notes = [f"{counted(len(others), 'other skeleton')} in the file stays as it is: {quoted(others)}"] if others else []
    return [node for node in every if node in chosen], tuple(notes)


def _skeletons(groups: Sequence[Sequence[int]], branches: Sequence[int]) -> list[dict[int, None]]:
    """Groups of nodes, merged where they have nodes on the same branch, as keys of dictionaries, in order."""
    groups = [group for group in groups if group]
    pairs = [(number, branches[node]) for number, group in enumerate(groups) for node in group]
    numbers, shared = np.array(pairs).T
    size = len(groups) + len(branches)
    graph = coo_array((np.ones(len(pairs), bool), (numbers, len(groups) + shared)), shape=(size, size))
    joined: dict[int, dict[int, None]] = {}
    for group, label in zip(groups, connected_components(graph, directed=False)[1].tolist(), strict=False):
        joined.setdefault(label, {}).update(dict.fromkeys(group))
    return list(joined.values())


def _named(nodes: Nodes) -> list[int]:
    """The nodes that have the names of the parts of a body."""
    if not 0 < len(nodes) <= MOST_JOINTS:
        return []
    tree = nodes.among(nodes.top_down)
    named = NamedTree(tree.names, tuple(tree.parents.tolist()), (False,) * len(tree))
    anatomy = by_tree(named) or by_tree(named, single=True)
    return [nodes.top_down[place] for place in anatomy.roles.values()] if anatomy else []


def bind_poses(nodes: Nodes, skins: Sequence[SkinBinding]) -> dict[int, Array]:
    """Return the bind pose of the skins' joints in the world, (4, 4). The skin with the topmost joint decides."""
    found: dict[int, Array] = {}
    depth = np.argsort(nodes.top_down)
    for skin in sorted(skins, key=lambda skin: (depth[skin.joints].min(initial=len(nodes)), -len(skin.joints))):
        if found.keys() >= set(skin.joints.tolist()):  # as with the many skins of one body
            continue
        if skin.inverse_binds is None:
            found = {joint: nodes.world[joint] for joint in skin.joints.tolist()} | found
            continue
        regular = np.flatnonzero(are_regular(skin.inverse_binds))
        chosen = regular[np.argsort(depth[skin.joints[regular]])]
        joints, inverse_binds = skin.joints[chosen], skin.inverse_binds[chosen]
        shared = next((place for place, joint in enumerate(joints.tolist()) if joint in found), None)
        if shared is not None:
            space = found[joints[shared].item()] @ inverse_binds[shared]
        elif len(joints):
            space = _mesh_space(nodes.world[list(skin.meshes)], nodes.world[joints], inverse_binds)
        else:
            continue
        found = dict(zip(joints.tolist(), space @ np.linalg.inv(inverse_binds), strict=True)) | found
    return found


def are_regular(matrices: Array) -> NDArray[np.bool_]:
    """(n,), whether the axes of transforms (n, 4, 4) span a space, so that they have an inverse."""
    axes = matrices[:, :3, :3]
    return np.asarray(np.abs(np.linalg.det(axes)) > REGULAR * np.abs(axes).max(axis=(1, 2)) ** 3)


def _mesh_space(meshes: Array, shown: Array, inverse_binds: Array) -> Array:
    """The transform of the mesh's space to the world, (4, 4), from world transforms of its nodes and of joints, topmost
    first. Each joint in its bind pose implies one, `shown` times inverse bind. That of the topmost joint counts if it
    is the world's or a mesh's node's, since a bent spine takes all joints above it along; else that which most joints
    imply; else the nearest known to the topmost joint's.
    """
    implied = shown @ inverse_binds
    extent = float(np.ptp(shown[:, :3, 3], axis=0).max())
    scale = float(np.median(_scales(implied)))
    spaces: tuple[Array, ...] = (np.eye(4), *_spread(meshes))
    known = [space for space in spaces if abs(_scales(space[None])[0] / scale - 1) < AGREE]
    for space in known:
        if _agree(implied[:1], space, scale, extent)[0]:
            return space
    likely: list[Array] = [*known, *_spread(implied)]
    counts = [int(_agree(implied, space, scale, extent).sum()) for space in likely]
    most = max(counts)
    if most >= SHARE * len(shown):
        return likely[counts.index(most)]
    first: Array = implied[0]
    return min(known or [first], key=lambda each: float(np.linalg.norm(each[:3, :3] - first[:3, :3])))


def _scales(spaces: Array) -> Array:
    return np.asarray(np.cbrt(np.abs(np.linalg.det(spaces[:, :3, :3]))))


def _agree(implied: Array, space: Array, scale: float, extent: float) -> NDArray[np.bool_]:
    """(joints,), whether the spaces that joints imply, (joints, 4, 4), equal `space`."""
    turned = np.abs(implied[:, :3, :3] - space[:3, :3]).max(axis=(1, 2)) < AGREE * scale
    moved = np.abs(implied[:, :3, 3] - space[:3, 3]).max(axis=1) < AGREE * max(extent, 1e-300)
    return np.asarray(turned & moved)


def _spread(spaces: Array, most: int = 16) -> Array:
    """At most `most` of the spaces, evenly spread."""
    return spaces[np.unique(np.linspace(0, len(spaces) - 1, most).astype(int))] if len(spaces) > most else spaces


def character_of(scene: CharacterScene) -> Character:
    """Return the character of a file, without controls if it has deform bones; a FileError or SkeletonError."""
    scene, flat = _without_flat_scales(scene)
    above, joints, left_out = joint_nodes(scene)
    line = [*above, *joints]
    _check_scales(scene, line)
    shown, size = scene.nodes.among(line), float(np.ptp(scene.nodes.world[line, :3, 3], axis=0).max())
    binds = bind_poses(scene.nodes, scene.skins)
    poses = [None] * len(above) + [binds.get(node) for node in joints]
    hidden = [scene.nodes.names[node] for node in line if flat[node]]
    warnings = (*scene.notes, *left_out, *_scale_warnings(scene, line, hidden))
    with in_file(scene.path):
        character = _character(scene, line, shown, _bind_transforms(shown, poses, size), len(above), warnings)
        for repaired in (deform_bones, attached_limbs):
            if tree := repaired(character.skeleton):
                character = replace(character, repairs=(*character.repairs, tree))
        return character


def _without_flat_scales(scene: CharacterScene) -> tuple[CharacterScene, NDArray[np.bool_]]:
    """The scene with scales of 0 set to the node's largest scale, or 1; and whether nodes had such, (nodes,)."""
    scales = scene.nodes.scales
    longest = np.abs(scales).max(axis=1, keepdims=True, initial=0.0)
    flat = ~(np.abs(scales) > np.maximum(FLAT * longest, SMALLEST))
    regular = np.where(flat, np.where(longest > SMALLEST, longest, 1.0), scales)
    return replace(scene, nodes=replace(scene.nodes, scales=regular)), flat.any(axis=1)


def _check_scales(scene: CharacterScene, line: Sequence[int]) -> None:
    """Raise a FileError if world transforms of some nodes are too extreme to compute with."""
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
    """A line each on hidden nodes, on unevenly scaled nodes, and on nodes whose scale is animated."""
    if hidden:
        yield f"{quoted(hidden)} have the scale 0, as hidden nodes have; they are taken at full size"
    nodes, sizes = scene.nodes, np.abs(scene.nodes.scales[line])
    spread = np.ptp(sizes, axis=1) / sizes.max(axis=1)
    if uneven := [nodes.names[node] for node, share in zip(line, spread, strict=True) if share > UNEVEN]:
        change = "bones below change their length as they turn, so that hands and feet miss their places"
        much = f"{100 * spread.max():.2g} %"
        yield f"the scale of {quoted(uneven)} is uneven, by {much}: {change}; apply the scale and export it again"
    moved = scene.animation.scales if scene.animation else {}
    scaled = [(node, moved[node], moved[node][:1]) for node in line if node in moved]
    changing = [node for node, own, first in scaled if (np.abs(own - first) > UNEVEN * np.abs(first)).any()]
    if changing:
        names = quoted(nodes.names[node] for node in changing)
        yield f"the scales of {names} change in the animation; they are left out"


def _bind_transforms(shown: Nodes, binds: Sequence[Array | None], size: float) -> Array:
    """(nodes, 4, 4), in the bind pose, with the file's scales; nodes without one, or near it, are posed as there."""
    world = np.empty((len(shown), 4, 4))
    for node, (parent, bind) in enumerate(zip(shown.parents.tolist(), binds, strict=True)):
        base = world[parent] if parent >= 0 else np.eye(4)
        local = shown.transforms[node]
        world[node] = base @ (local if bind is None else _local(base, bind, local, shown.scales[node], size))
    return world


def _local(base: Array, bind: Array, shown: Array, scale: Array, size: float) -> Array:
    """The bind pose of a node relative to its parent, `base`; set to the file's pose, `shown`, if nearly equal."""
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
        in_file=_skeleton(scene, line[above:], world[above:, :3, 3]),
        nodes=np.array(line),
        shown=shown,
        binds=binds.as_quat(),
        locals=(base.inv() * binds * flips.inv()).as_quat(),
        scales=signs * np.cbrt(np.abs(np.linalg.det(linear))),
        origin=world[above - 1, :3, 3] if above else np.zeros(3),
        warnings=warnings,
    )


def _skeleton(scene: CharacterScene, nodes: Sequence[int], places: Array) -> Skeleton:
    """The skeleton of nodes at these places, (nodes, 3); joints outside the body have position channels, too."""
    own = scene.nodes.among(nodes)
    joints = {node: joint for joint, node in enumerate(nodes)}
    skeleton = Skeleton(
        names=_names(own.names, nodes, own.parents.tolist()),
        parents=own.parents,
        offsets=places - np.where((own.parents >= 0)[:, None], places[own.parents], 0.0),
        channels=tuple(DEFAULT_ROTATIONS if joint else DEFAULT_ROOT for joint in range(len(nodes))),
        end_sites=np.zeros(len(nodes), bool),
        units=scene.units,
        up=scene.up,
        faces_negative_z=scene.faces_negative_z,
        floor_at_zero=True,
        humanoid=tuple((bone, joints[node]) for bone, node in scene.humanoid.items()),
    )
    if not (anatomy := by_names(skeleton)):
        return skeleton
    body = set(skeleton.subtree(anatomy.roles["hips"])[1:])
    channels = [DEFAULT_ROTATIONS if joint in body else DEFAULT_ROOT for joint in range(len(nodes))]
    return replace(skeleton, channels=tuple(channels))


def _names(names: Sequence[str], nodes: Sequence[int], parents: Sequence[int]) -> tuple[str, ...]:
    """The names of joints as BVH can hold them, with _ for what it cannot, and the node's number if empty or taken."""
    taken: set[tuple[int, str]] = set()
    result = []
    for name, node, parent in zip(names, nodes, parents, strict=True):
        plain = "".join("_" if each in "{}" or not each.isprintable() else each for each in name[:LONGEST_NAME])
        clean = plain.strip() or f"node {node}"
        clean = f"{clean} (node {node})" if (parent, clean) in taken else clean
        taken.add((parent, clean))
        result.append(clean)
    return tuple(result)
