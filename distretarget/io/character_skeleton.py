"""Which nodes of a file are joints of its character, and the skeleton that they are in the bind pose."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from distretarget.body.named_anatomy import by_names
from distretarget.errors import FileError, counted, cut, quoted
from distretarget.io.bind_pose import REGULAR, bind_poses, in_world, matrices
from distretarget.io.bvh import clean_name
from distretarget.io.character import Character
from distretarget.io.deform_character import with_deform_bones
from distretarget.io.nodes import Nodes, Scene
from distretarget.numerics.rotations import nearest_rotations
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, SMALLEST, Skeleton

Array = NDArray[np.float64]

MOST_JOINTS = 4096  # of a character, with the nodes above: skeletons have matrices of joints x joints
LONGEST_NAME = 200  # of a joint [characters]
NEAR_SHOWN = 1e-4  # a node whose bind pose differs by less than this from what it shows shows it [body sizes, rad]
FLAT = 1e-6  # axes that are shorter have the length 0 [of the longest axis of the node]
UNEVEN = 1e-3  # axes whose scales differ by more than this are scaled unevenly; a scale that changes more is animated
TURN_CHANNELS = ("Zrotation", "Xrotation", "Yrotation")


def character_of(scene: Scene) -> Character:
    """Return the character of a file: the nodes that its skins use or, as in VRM animations, its humanoid bones, with
    those between them; in a file without both, the nodes that its animation turns. Of bones that deform and controls
    it has the former.

    Raises:
        FileError: the file has no such nodes, or too many.
    """
    scene, flat = _without_flat_scales(scene)
    nodes, order = scene.nodes, _top_down(scene.nodes.parents)
    lines = _Lines(nodes.parents, order)
    wanted, left_out = _wanted(scene, lines)
    root, carried = lines.meeting(wanted), lines.carried(wanted)
    above = lines.up(nodes.parents.item(root), -1)[::-1] if nodes.parents[root] >= 0 else []
    are_above = set(above)
    joints = [node for node in order if carried[node] and node not in are_above]
    line = [*above, *joints]
    if len(line) > MOST_JOINTS:
        counts = f"{counted(len(joints), 'joint')} and {counted(len(above), 'node')} above"
        raise FileError(scene.path, f"its skeleton has {counts}; expected at most {MOST_JOINTS}")
    with np.errstate(all="ignore"):
        shown = in_world(nodes, order)
    _check_scales(scene, line, shown)
    binds = _settled(nodes, line, len(above), shown, bind_poses(scene.skins, shown, order))
    warnings = (*left_out, *_flat_warnings(scene, flat, line), *_scale_warnings(scene, line))
    character = _character(scene, line, len(above), binds, warnings)
    return with_deform_bones(character)


class _Lines:
    """The lines of a forest from its nodes upwards."""

    def __init__(self, parents: NDArray[np.intp], order: Sequence[int]) -> None:
        self._parents, self._order = parents.tolist(), order

    def up(self, node: int, last: int) -> list[int]:
        """The nodes from `node` up to `last`, both included; up to the top if that is -1."""
        line = [node]
        while line[-1] != last and self._parents[line[-1]] >= 0:
            line.append(self._parents[line[-1]])
        return line

    def carried(self, nodes: Iterable[int]) -> list[int]:
        """How many of some nodes each node of the forest carries, itself included."""
        counts = [0] * len(self._parents)
        for node in nodes:
            counts[node] = 1
        for node in reversed(self._order):
            if (parent := self._parents[node]) >= 0:
                counts[parent] += counts[node]
        return counts

    def meeting(self, nodes: Collection[int]) -> int:
        """The lowest node from which all of some different nodes hang; -1 if there is none."""
        counts = self.carried(nodes)
        return next((node for node in reversed(self._order) if counts[node] == len(nodes)), -1)

    def branches(self, above: int) -> list[int]:
        """For each node, that just below `above` on its line; the node itself for `above`; else the top of its line."""
        branches = list(range(len(self._parents)))
        for node in self._order:
            if self._parents[node] not in (-1, above) and node != above:
                branches[node] = branches[self._parents[node]]
        return branches


def _top_down(parents: NDArray[np.intp]) -> list[int]:
    """All nodes, each followed by those below it, in the order of the file."""
    children: dict[int, list[int]] = defaultdict(list)
    for node, parent in enumerate(parents.tolist()):
        children[parent].append(node)
    order, stack = [], children[-1][::-1]
    while stack:
        order.append(stack.pop())
        stack.extend(reversed(children[order[-1]]))
    return order


def _wanted(scene: Scene, lines: _Lines) -> tuple[list[int], tuple[str, ...]]:
    """The nodes that are joints for certain, and a warning of those that are left out: other skeletons in the file,
    whose skins share no branch with the humanoid's or, without one, with the largest.
    """
    groups = [list(scene.humanoid.values()), *(skin.joints.tolist() for skin in scene.skins)]
    if not any(groups):
        groups = [list(scene.animation.rotations) if scene.animation else []]
    every = list(dict.fromkeys(node for group in groups for node in group))
    if not every:
        raise FileError(scene.path, "has no skin and no VRM humanoid, so no skeleton; expected a character")
    skeletons = _skeletons(groups, lines.branches(lines.meeting(every)))
    chosen = next((each for each in skeletons if groups[0] and groups[0][0] in each), max(skeletons, key=len))
    others = [scene.nodes.names[next(iter(each))] for each in skeletons if each is not chosen]
    if lines.meeting(chosen) < 0:
        raise FileError(scene.path, "the joints of its skin hang from no common node; expected a single skeleton")
    notes = [f"{counted(len(others), 'other skeleton')} in the file stays as it is: {quoted(others)}"] if others else []
    return [node for node in every if node in chosen], tuple(notes)


def _skeletons(groups: Sequence[Sequence[int]], branches: Sequence[int]) -> list[dict[int, None]]:
    """Groups of nodes, joined where they have nodes on the same branch; their nodes as the keys of dictionaries, in
    order.
    """
    groups = [group for group in groups if group]
    pairs = [(number, branches[node]) for number, group in enumerate(groups) for node in group]
    numbers, shared = np.array(pairs).T
    size = len(groups) + len(branches)
    graph = coo_array((np.ones(len(pairs), bool), (numbers, len(groups) + shared)), shape=(size, size))
    joined: dict[int, dict[int, None]] = {}
    for group, label in zip(groups, connected_components(graph, directed=False)[1].tolist(), strict=False):
        joined.setdefault(label, {}).update(dict.fromkeys(group))
    return list(joined.values())


def _without_flat_scales(scene: Scene) -> tuple[Scene, NDArray[np.bool_]]:
    """The scene with scales that can be inverted, and which nodes had others, (nodes,): axes of length 0 get the length
    of the longest, or 1.
    """
    scales = scene.nodes.scales
    longest = np.abs(scales).max(axis=1, keepdims=True, initial=0.0)
    flat = ~(np.abs(scales) > np.maximum(FLAT * longest, SMALLEST))
    regular = np.where(flat, np.where(longest > SMALLEST, longest, 1.0), scales)
    return replace(scene, nodes=replace(scene.nodes, scales=regular)), flat.any(axis=1)


def _flat_warnings(scene: Scene, flat: NDArray[np.bool_], line: Sequence[int]) -> Iterator[str]:
    """A line for nodes with axes of length 0."""
    if names := [scene.nodes.names[node] for node in line if flat[node]]:
        yield f"{quoted(names)} have the scale 0, as if they were hidden; they are taken as if they were not"


def _check_scales(scene: Scene, line: Sequence[int], shown: Array) -> None:
    """Check that the transforms of some nodes in the world, among all, (nodes, 4, 4), can be computed with."""
    world = shown[list(line)]
    sizes = np.abs(world[:, :3, :3]).max(axis=(1, 2))
    with np.errstate(all="ignore"):
        regular = (np.abs(np.linalg.det(world[:, :3, :3])) > REGULAR * sizes**3) & (sizes >= SMALLEST)
        fits = regular & (sizes <= LARGEST) & (np.abs(world[:, :3, 3]) <= LARGEST).all(axis=1)
    if not fits.all():
        name = scene.nodes.names[line[int(fits.argmin())]]
        limits = f"scales from {SMALLEST:g} to {LARGEST:g}, not too uneven, and places up to {LARGEST:g}"
        raise FileError(
            scene.path, f"the scale or place of {cut(name)!r} in the world is too extreme; expected {limits}"
        )


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
        channels=tuple(TURN_CHANNELS if joint else (*POSITION_CHANNELS, *TURN_CHANNELS) for joint in range(len(nodes))),
        end_sites=np.zeros(len(nodes), bool),
        units=scene.units,
        up=scene.up,
        humanoid=tuple((bone, joints[node]) for bone, node in scene.humanoid.items()),
    )
    return replace(skeleton, channels=_with_positions(skeleton))


def _with_positions(skeleton: Skeleton) -> tuple[tuple[str, ...], ...]:
    """The channels of the joints: positions for the root, and if the hips hang below it for the hips and all joints
    that are not of the body, such as IK handles.
    """
    anatomy = by_names(skeleton)
    body = set(skeleton.subtree(anatomy.roles["hips"])[1:]) if anatomy else set(range(1, len(skeleton)))
    free = (*POSITION_CHANNELS, *TURN_CHANNELS)
    return tuple(TURN_CHANNELS if joint in body else free for joint in range(len(skeleton)))


def _names(names: Sequence[str], nodes: Sequence[int], parents: Sequence[int]) -> tuple[str, ...]:
    """The names of joints as BVH can hold them; the number of the node stands for an empty name, and follows a name
    that a sibling has as well.
    """
    taken: set[tuple[int, str]] = set()
    result = []
    for name, node, parent in zip(names, nodes, parents, strict=True):
        clean = clean_name(name[:LONGEST_NAME]) or f"node {node}"
        clean = f"{clean} (node {node})" if (parent, clean) in taken else clean
        taken.add((parent, clean))
        result.append(clean)
    return tuple(result)


def _scale_warnings(scene: Scene, line: Sequence[int]) -> Iterator[str]:
    """A line for nodes that are scaled unevenly, and one for nodes whose scale changes."""
    nodes = scene.nodes
    spread = np.ptp(np.abs(nodes.scales[list(line)]), axis=1) > UNEVEN * np.abs(nodes.scales[list(line)]).max(axis=1)
    if uneven := [nodes.names[node] for node, is_uneven in zip(line, spread, strict=True) if is_uneven]:
        sheared = "what hangs on them is sheared where it turns, and a little off its place"
        yield f"{quoted(uneven)} are scaled unevenly: {sheared}"
    scales = scene.animation.scales if scene.animation else {}
    changing = [
        nodes.names[node]
        for node in line
        if node in scales and (np.abs(scales[node] - scales[node][:1]) > UNEVEN * np.abs(scales[node][:1])).any()
    ]
    if changing:
        yield f"the scales of {quoted(changing)} change in the animation; they are left out"
