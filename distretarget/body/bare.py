"""The mesh of a body without what it holds: swords, shields and other props that have no joint of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.body.body import Body
from distretarget.body.segments import find_segments, frames
from distretarget.numerics.vectors import Flags, Numbers, lengths
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.mesh import Looks, SkinnedMesh

REACH = 2.8  # how far from the wrist a hand reaches at most; fingertips are 1.8 from it on average [palms]


def bare_mesh(body: Body, mesh: SkinnedMesh) -> SkinnedMesh:
    """Return a mesh without the pieces that hands carry: those that are joined to nothing else, move with one hand and
    its forearm alone, and reach farther from its wrist than a hand can. `whole` keeps them.
    """
    skeleton, of_vertex, pieces = body.skeleton, find_segments(body).of_joint[mesh.carriers], mesh.pieces
    prop = np.zeros(len(mesh.vertices), bool)
    for part, palm in frames(body):
        side, _, name = part.partition(" ")
        if name == "palm":
            arm = [SEGMENTS.index(f"{side} {each}") for each in ("hand", "forearm")]
            wrist = skeleton.rest_positions[palm.carriers[0][0]]
            far = lengths(mesh.vertices - wrist) > REACH * palm.length
            of_hand, of_arm = of_vertex == arm[0], np.isin(of_vertex, arm)
            prop |= _any(pieces, of_hand & far) & ~_any(pieces, ~of_arm)
    return _without(mesh, prop) if prop.any() else mesh


def _any(pieces: Numbers, chosen: Flags) -> Flags:
    """(vertices,), whether any vertex of the piece of each is chosen."""
    return np.asarray(np.bincount(pieces, chosen, minlength=len(pieces))[pieces] > 0)


def _without(mesh: SkinnedMesh, gone: Flags) -> SkinnedMesh:
    """A mesh without some vertices, and without the triangles on them."""
    number = np.cumsum(~gone) - 1
    kept = ~gone[mesh.triangles].any(axis=1)
    looks = mesh.looks and Looks(mesh.looks.materials, mesh.looks.of_triangle[kept], mesh.looks.uv[~gone])
    return replace(
        mesh,
        vertices=mesh.vertices[~gone],
        joints=mesh.joints[~gone],
        weights=mesh.weights[~gone],
        triangles=number[mesh.triangles[kept]],
        looks=looks,
        whole=mesh.whole or mesh,
    )
