"""The mesh of a body without held props, such as swords and shields, that have no joint of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.body.body import Body
from distretarget.body.segments import find_segments, part_frames
from distretarget.numerics.vectors import Flags, Numbers, lengths
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.mesh import Looks, SkinnedMesh

REACH = 2.8  # a hand reaches no farther from the wrist; fingertips are at 1.8 on average [palms]


def bare_mesh(body: Body, mesh: SkinnedMesh) -> SkinnedMesh:
    """Return a mesh without held props: connected pieces that move with one hand and its forearm alone, and reach
    farther from the wrist than a hand can. Its `whole` mesh keeps them.
    """
    skeleton, of_vertex, pieces = body.skeleton, find_segments(body).of_joint[mesh.carriers], mesh.pieces
    prop = np.zeros(len(mesh.vertices), bool)
    for part, palm in part_frames(body):
        side, _, name = part.partition(" ")
        if name == "palm":
            arm = [SEGMENTS.index(f"{side} {each}") for each in ("hand", "forearm")]
            wrist = skeleton.rest_positions[palm.carriers[0][0]]
            far = lengths(mesh.vertices - wrist) > REACH * palm.length
            of_hand, of_arm = of_vertex == arm[0], np.isin(of_vertex, arm)
            prop |= _any_of_piece(pieces, of_hand & far) & ~_any_of_piece(pieces, ~of_arm)
    return _without(mesh, prop) if prop.any() else mesh


def _any_of_piece(pieces: Numbers, chosen: Flags) -> Flags:
    """(vertices,), whether the piece of each vertex has a chosen vertex."""
    return np.asarray(np.bincount(pieces, chosen, minlength=len(pieces))[pieces] > 0)


def _without(mesh: SkinnedMesh, removed: Flags) -> SkinnedMesh:
    """A mesh without some vertices, and without the triangles on them."""
    kept = ~removed
    index = np.cumsum(kept) - 1
    kept_triangles = kept[mesh.triangles].all(axis=1)
    looks = mesh.looks and Looks(mesh.looks.materials, mesh.looks.of_triangle[kept_triangles], mesh.looks.uv[kept])
    return replace(
        mesh,
        vertices=mesh.vertices[kept],
        joints=mesh.joints[kept],
        weights=mesh.weights[kept],
        triangles=index[mesh.triangles[kept_triangles]],
        looks=looks,
        whole=mesh.whole or mesh,
    )
