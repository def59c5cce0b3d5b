"""The bind pose of a character: where its nodes were when the mesh was bound to them, in the world of the file.

A skin states it as inverse bind matrices, from the mesh's space to each joint's. Where that space is in the world, no
file states: the transform of the mesh's node does not count (glTF 2.0 specification, section 3.7.3.3). It is found from
the joints that show their bind pose.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.character.nodes import Nodes, Skin

Array = NDArray[np.float64]

AGREE = 1e-3  # two transforms agree if they differ by less than this [of their scale, and of the body]
SHARE = 0.5  # a transform on which this share of the joints agrees is that of the mesh's space
REGULAR = 1e-9  # a matrix with a smaller determinant has no inverse [of its largest entry, cubed]


def matrices(translations: Array, rotations: Array, scales: Array) -> Array:
    """Return transforms, (n, 4, 4), from translations, (n, 3), rotations, (n, 4), and scales, (n, 3)."""
    result = np.tile(np.eye(4), (len(translations), 1, 1))
    result[:, :3, :3] = Rotation.from_quat(rotations).as_matrix() * scales[:, None]
    result[:, :3, 3] = translations
    return result


def in_world(nodes: Nodes, order: Iterable[int]) -> Array:
    """Return the transforms of the nodes in the world as the file shows them, (nodes, 4, 4); `order` has the nodes,
    parents before children.
    """
    world = matrices(nodes.translations, nodes.rotations, nodes.scales)
    for node in order:
        if (parent := nodes.parents[node]) >= 0:
            world[node] = world[parent] @ world[node]
    return world


def bind_poses(skins: Sequence[Skin], shown: Array, order: Sequence[int]) -> dict[int, Array]:
    """Return the transform in the world, (4, 4), of each joint of the skins in the bind pose; `shown`, (nodes, 4, 4),
    are those of all nodes as the file shows them. `order` has the nodes, parents before children. Where several skins
    have a joint, the one that reaches highest decides, and the largest of these; the others are bound where it is.
    """
    found: dict[int, Array] = {}
    depth = np.argsort(order)
    for skin in sorted(skins, key=lambda skin: (depth[skin.joints].min(initial=len(order)), -len(skin.joints))):
        if found.keys() >= set(skin.joints.tolist()):
            continue
        if skin.inverse_binds is None:
            found |= {joint: shown[joint] for joint in skin.joints.tolist() if joint not in found}
            continue
        regular = np.array([_is_regular(matrix) for matrix in skin.inverse_binds])
        chosen = np.flatnonzero(regular)[np.argsort(depth[skin.joints[regular]])]
        joints, inverse_binds = skin.joints[chosen], skin.inverse_binds[chosen]
        if len(joints):
            shared = next((place for place, joint in enumerate(joints.tolist()) if joint in found), None)
            if shared is None:
                space = _mesh_space(skin, joints, inverse_binds, shown)
            else:
                space = found[joints[shared].item()] @ inverse_binds[shared]
            binds = space @ np.linalg.inv(inverse_binds)
            found |= {joint: bind for joint, bind in zip(joints.tolist(), binds, strict=True) if joint not in found}
    return found


def _is_regular(matrix: Array) -> bool:
    largest = float(np.abs(matrix[:3, :3]).max())
    return abs(float(np.linalg.det(matrix[:3, :3]))) > REGULAR * largest**3


def _mesh_space(skin: Skin, joints: NDArray[np.intp], inverse_binds: Array, shown: Array) -> Array:
    """The transform of the mesh's space to the world, (4, 4).

    A joint that shows its bind pose brings the space there: its transform times its inverse bind matrix. If this is
    the world's space or that of a mesh's node for the topmost joint, it decides: a bent spine takes all joints above it
    along. Else the joints that agree decide. Where most joints show another pose, the space is the world's or that of a
    mesh's node, whichever is nearer to what the topmost joint says, if its scale is right.
    """
    said = shown[joints] @ inverse_binds
    extent = float(np.ptp(shown[joints, :3, 3], axis=0).max())
    scale = float(np.median(_scales(said)))
    known = [
        space
        for space in (np.eye(4), *_spread(shown[list(skin.meshes)]))
        if abs(_scales(space[None])[0] / scale - 1) < AGREE
    ]
    for space in known:
        if _agree(said[:1], space, scale, extent)[0]:
            return np.asarray(space)
    agreeing = [(int(_agree(said, space, scale, extent).sum()), space) for space in (*known, *_spread(said))]
    most, space = max(agreeing, key=lambda pair: pair[0])
    if most < SHARE * len(joints):
        first = said[0]
        space = min(known or [first], key=lambda each: float(np.linalg.norm(each[:3, :3] - first[:3, :3])))
    return np.asarray(space)


def _scales(spaces: Array) -> Array:
    return np.asarray(np.cbrt(np.abs(np.linalg.det(spaces[:, :3, :3]))))


def _agree(said: Array, space: Array, scale: float, extent: float) -> NDArray[np.bool_]:
    """(joints,), whether each joint says the same space."""
    turned = np.abs(said[:, :3, :3] - space[:3, :3]).max(axis=(1, 2)) < AGREE * scale
    moved = np.abs(said[:, :3, 3] - space[:3, 3]).max(axis=1) < AGREE * max(extent, 1e-300)
    return np.asarray(turned & moved)


def _spread(said: Array, most: int = 16) -> Iterator[Array]:
    """Some of the spaces, spread over all."""
    yield from said if len(said) <= most else said[np.unique(np.linspace(0, len(said) - 1, most).astype(int))]
