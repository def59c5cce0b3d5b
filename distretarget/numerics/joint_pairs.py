"""Distances of pairs of points over the frames of a motion. Compiled."""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import B1, F1, F2, F3, I1, S2, Array, Flags, Numbers


def come_near(a: Array, b: Array, u: Numbers, v: Numbers, reach: Array) -> Flags:
    """(pairs,), whether points u of `a` and v of `b`, (frames, points, 3), come closer than `reach`, (pairs,), with
    straight paths from frame to frame.
    """
    near = np.zeros(len(u), np.bool_)
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    _mark_near(a, b, np.ascontiguousarray(u), np.ascontiguousarray(v), reach, near)
    return near


@compiled(fastmath=True)
def _mark_near(a: F3, b: F3, u: I1, v: I1, reach: F1, near: Out[B1]) -> None:
    for pair in range(len(u)):
        i, j, square = u[pair], v[pair], reach[pair] ** 2
        ox, oy, oz = 0.0, 0.0, 0.0
        for frame in range(len(a)):
            x = a[frame, i, 0] - b[frame, j, 0]
            y = a[frame, i, 1] - b[frame, j, 1]
            z = a[frame, i, 2] - b[frame, j, 2]
            least, mx, my, mz = x * x + y * y + z * z, x - ox, y - oy, z - oz
            along = x * mx + y * my + z * mz
            if frame > 0 and along > 0.0 and ox * mx + oy * my + oz * mz < 0.0:
                least -= along * along / (mx * mx + my * my + mz * mz)
            if least < square:
                near[pair] = True
                break
            ox, oy, oz = x, y, z


def least_distances(a: Array, b: Array, u: Numbers, v: Numbers, tau: Array, shots: Numbers) -> tuple[Array, Array]:
    """D, the distances between points u of `a` and v of `b`, (frames, points, 3), over path lengths `tau`, (pairs,),
    and the least D from half a frame before to half a frame after each frame; both (frames, pairs).

    Paths are straight from frame to frame, but not across the cuts between `shots`, (frames,). An approach or departure
    of a single frame may be a fault of the capture and is ignored: the least D is then the median of three frames, and
    the frames before and after do not interpolate to that frame.
    """
    D, least = np.empty((2, len(a), len(u)))
    _write_least(np.ascontiguousarray(a), np.ascontiguousarray(b), u, v, tau, shots, D, least)
    return D, least


@compiled()
def _write_least(a: F3, b: F3, u: I1, v: I1, tau: F1, shots: I1, D: Out[F2], least: Out[F2]) -> None:
    for frame in range(len(D)):
        for pair in range(len(u)):
            i, j = u[pair], v[pair]
            x, y, z = a[frame, i, 0] - b[frame, j, 0], a[frame, i, 1] - b[frame, j, 1], a[frame, i, 2] - b[frame, j, 2]
            D[frame, pair] = np.sqrt(x * x + y * y + z * z) / tau[pair]
    last = len(D) - 1
    for frame in range(len(D)):
        before, after = max(frame - 1, 0), min(frame + 1, last)
        before = before if shots[before] == shots[frame] else frame
        after = after if shots[after] == shots[frame] else frame
        for pair in range(len(u)):
            i, j, d = u[pair], v[pair], D[frame, pair]
            if _is_fault(a, b, i, j, D, shots, frame, pair):
                less, more = min(D[before, pair], D[after, pair]), max(D[before, pair], D[after, pair])
                least[frame, pair] = max(less, min(d, more))
                continue
            square = (d * tau[pair]) ** 2
            x, y, z = a[frame, i, 0] - b[frame, j, 0], a[frame, i, 1] - b[frame, j, 1], a[frame, i, 2] - b[frame, j, 2]
            for side in range(2):
                other = before if side == 0 else after
                if other == frame or _is_fault(a, b, i, j, D, shots, other, pair):
                    continue
                ox = a[other, i, 0] - b[other, j, 0] - x
                oy = a[other, i, 1] - b[other, j, 1] - y
                oz = a[other, i, 2] - b[other, j, 2] - z
                step, along = ox * ox + oy * oy + oz * oz, x * ox + y * oy + z * oz
                if along < 0.0:
                    s = min(-along / step, 0.5)
                    square = min(square, (d * tau[pair]) ** 2 + s * (2.0 * along + s * step))
            least[frame, pair] = min(np.sqrt(max(square, 0.0)) / tau[pair], d)


@inlined()
def _is_fault(a, b, i, j, D, shots, frame, pair):  # type: ignore[no-untyped-def]
    """Whether D has a peak or a dip of a single frame after which the points turn back."""
    if frame == 0 or frame == len(D) - 1 or shots[frame - 1] != shots[frame] or shots[frame + 1] != shots[frame]:
        return False
    one, other, back = D[frame, pair] - D[frame - 1, pair], D[frame, pair] - D[frame + 1, pair], 0.0
    if one * other <= 0.0:
        return False
    for k in range(3):
        x = a[frame, i, k] - b[frame, j, k]
        back += (x - a[frame - 1, i, k] + b[frame - 1, j, k]) * (x - a[frame + 1, i, k] + b[frame + 1, j, k])
    return back > 0.0


@compiled()
def write_nearest(positions: F3, u: I1, v: I1, limits: F1, ends: I1, nearest: Out[S2]) -> None:
    """Write the index of the nearest pair of joints u, v of each pair of regions: the one with the smallest ratio of
    squared distance to its limit, in `limits`; -1 if no ratio is below 1. A pair of regions has the pairs of joints
    from one of `ends` to the next.
    """
    for frame in range(len(nearest)):
        x = positions[frame]
        for k in range(nearest.shape[1]):
            least, nearest[frame, k] = 1.0, -1
            for n in range(ends[k], ends[k + 1]):
                i, j = u[n], v[n]
                square = (x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2 + (x[i, 2] - x[j, 2]) ** 2
                if square < least * limits[n]:
                    least, nearest[frame, k] = square / limits[n], n
