"""The bind pose of a character: where its nodes were when the mesh was bound to them, in the world of the file.

A skin states it as inverse bind matrices, from the mesh's space to each joint's. Where that space is in the world, no
file states: the transform of the mesh's node does not count (glTF 2.0 specification, section 3.7.3.3). It is found from
the joints that show their bind pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from distretarget.character.nodes import Nodes, Skin
from distretarget.numerics.vectors import Array

AGREE = 1e-3  # two transforms agree if they differ by less than this [of their scale, and of the body]
SHARE = 0.5  # a transform on which this share of the joints agrees is that of the mesh's space
REGULAR = 1e-9  # a matrix with a smaller determinant has no inverse [of its largest entry, cubed]


def bind_poses(nodes: Nodes, skins: Sequence[Skin]) -> dict[int, Array]:
    """Return the transform in the world, (4, 4), of each joint of the skins in the bind pose. Where several skins have
    a joint, the one that reaches highest decides, and the largest of these; the others are bound where it is.
    """
    found: dict[int, Array] = {}
    depth = np.argsort(nodes.top_down)
    for skin in sorted(skins, key=lambda skin: (depth[skin.joints].min(initial=len(nodes)), -len(skin.joints))):
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
    """The transform of the mesh's space to the world, (4, 4); from what the nodes with the mesh and the joints show,
    the topmost joint first, (nodes, 4, 4) and (joints, 4, 4), and the inverse bind matrices of these joints.

    A joint that shows its bind pose brings the space there: its transform times its inverse bind matrix. If this is
    the world's space or that of a mesh's node for the topmost joint, it decides: a bent spine takes all joints above it
    along. Else the joints that agree decide. Where most joints show another pose, the space is the world's or that of a
    mesh's node, whichever is nearer to what the topmost joint says, if its scale is right.
    """
    said = shown @ inverse_binds
    extent = float(np.ptp(shown[:, :3, 3], axis=0).max())
    scale = float(np.median(_scales(said)))
    spaces: tuple[Array, ...] = (np.eye(4), *_spread(meshes))
    known = [space for space in spaces if abs(_scales(space[None])[0] / scale - 1) < AGREE]
    for space in known:
        if _agree(said[:1], space, scale, extent)[0]:
            return space
    likely: list[Array] = [*known, *_spread(said)]
    counts = [int(_agree(said, space, scale, extent).sum()) for space in likely]
    most = max(counts)
    if most >= SHARE * len(shown):
        return likely[counts.index(most)]
    first: Array = said[0]
    return min(known or [first], key=lambda each: float(np.linalg.norm(each[:3, :3] - first[:3, :3])))


def _scales(spaces: Array) -> Array:
    return np.asarray(np.cbrt(np.abs(np.linalg.det(spaces[:, :3, :3]))))


def _agree(said: Array, space: Array, scale: float, extent: float) -> NDArray[np.bool_]:
    """(joints,), whether each joint says the same space."""
    turned = np.abs(said[:, :3, :3] - space[:3, :3]).max(axis=(1, 2)) < AGREE * scale
    moved = np.abs(said[:, :3, 3] - space[:3, 3]).max(axis=1) < AGREE * max(extent, 1e-300)
    return np.asarray(turned & moved)


def _spread(spaces: Array, most: int = 16) -> Array:
    """Some of the spaces, spread over all."""
    return spaces[np.unique(np.linspace(0, len(spaces) - 1, most).astype(int))] if len(spaces) > most else spaces
