"""Blend from a motion into another that holds in some frames, and back: what differs is kept, eases in, and eases out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.time_series import slices_of, spans_of
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

GOES_ON = 0.1  # beyond the frames in which it holds, the difference goes on changing as there for about this time [s]
LEAST = 1e-12  # angles are no smaller [rad]
SLOPE = 0.05  # how fast it changes there is measured over this time [s]


def blended(without: Motion, held: Motion, on: Flags, share: Array, lead: NDArray[np.intp], shots: Array) -> Motion:
    """Return the motion `held` in the frames `on`, (frames,), by a share, and that `without` it far from them.

    Around these frames the rotations against those without, and the way of the root, are as in the nearest of them, and
    fade within `lead` frames, (frames,). What is farther away does not change at all, nor what is across a cut.
    """
    roots, rotations = np.array(without.root_positions), np.array(without.rotations)
    for shot in slices_of(shots):
        if on[shot].any():
            turns, ways, moved = _differences(without[shot], held[shot], on[shot], share[shot], lead[shot])
            inside = np.arange(len(roots))[shot][moved]
            shape = rotations[inside].shape
            turned = Rotation.from_quat(rotations[inside].reshape(-1, 4)) * Rotation.from_rotvec(turns.reshape(-1, 3))
            rotations[inside] = turned.as_quat().reshape(shape)
            roots[inside] += ways
            whole = np.arange(len(roots))[shot][on[shot] & (share[shot] == 1.0)]
            roots[whole], rotations[whole] = held.root_positions[whole], held.rotations[whole]
    return replace(without, root_positions=roots, rotations=rotations)


def _differences(
    without: Motion, held: Motion, on: Flags, share: Array, lead: NDArray[np.intp]
) -> tuple[Array, Array, NDArray[np.intp]]:
    """The turns of joints, (moved, joints, 3) [rad], and the ways of the root, (moved, 3), in frames of one shot; and
    the frames that they move.
    """
    frames, joints = without.rotations.shape[:2]
    turn = Rotation.from_quat(without.rotations.reshape(-1, 4)).inv() * Rotation.from_quat(held.rotations.reshape(-1, 4))
    turns, ways = turn.as_quat().reshape(frames, joints, 4), held.root_positions - without.root_positions
    result = np.zeros((frames, joints, 3)), np.zeros((frames, 3))
    numbers, near = np.flatnonzero(on), round(SLOPE / without.frame_time)

    def at_edge(edge: int, inner: int, t: NDArray[np.intp]) -> tuple[Array, Array]:
        """The differences in frames t beyond an edge, as those there go on."""
        apart = max(abs(edge - inner), 1)
        goes_on = GOES_ON / without.frame_time
        far = goes_on * (1.0 - np.exp(-np.abs(t - edge) / goes_on)) / apart
        here = Rotation.from_quat(turns[edge])
        rate = (here.inv() * Rotation.from_quat(turns[inner])).inv().as_rotvec()
        on_way = [here * Rotation.from_rotvec(each * rate) for each in far]
        ease = (_ease(np.abs(t - edge) / (lead[edge] + 1.0)) * share[edge])[:, None]
        turned = _near([each.as_rotvec() for each in on_way], here.as_rotvec())
        return ease[..., None] * turned, ease * (ways[edge] + far[:, None] * (ways[edge] - ways[inner]))

    result[0][on] = share[on, None, None] * turn.as_rotvec().reshape(frames, joints, 3)[on]
    result[1][on] = share[on, None] * ways[on]
    edges = spans_of(on)
    bounds = [(None, edges[0]), *zip(edges[:-1], edges[1:], strict=True), (edges[-1], None)]
    for before, after in bounds:
        first = 0 if before is None else int(before[1])
        end = frames if after is None else int(after[0])
        t = np.arange(first, end)
        across = _ease(1.0 - (t - first + 1.0) / (end - first + 1.0))
        for span, inside, weight in ((before, -1, 1.0 - across), (after, 1, across)):
            if span is None or not len(t):
                continue
            edge = int(span[0]) if inside == 1 else int(span[1]) - 1
            inner = min(max(edge + inside * near, int(span[0])), int(span[1]) - 1)
            weight = weight if before is not None and after is not None else np.ones(len(t))
            for each, part in zip(result, at_edge(edge, inner, t), strict=True):
                each[first:end] += weight.reshape(-1, *[1] * (part.ndim - 1)) * part
    moved = np.flatnonzero(result[0].any(axis=(1, 2)) | result[1].any(axis=1))
    return result[0][moved], result[1][moved], moved


def _near(turns: list[Array], to: Array) -> Array:
    """(frames, joints, 3), rotation vectors, the other way round where that is nearer to those of one frame."""
    vectors = np.array(turns).reshape(-1, *to.shape)
    angles = np.maximum(lengths(vectors), LEAST)[..., None]
    others = vectors * (1.0 - 2.0 * np.pi / angles)
    return np.where((lengths(others - to) < lengths(vectors - to))[..., None], others, vectors)


def _ease(t: Array) -> Array:
    """1 at 0, and 0 from 1 on, with the least jerk in between."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t))
