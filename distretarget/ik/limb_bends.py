"""Bends limbs so that skins stay apart, or in contact where they touch: one solve over all frames of a clip.

The unknowns are the rotation vectors w of the upper and the lower part of each limb in each frame [rad], which displace
its middle and end, such as elbow and wrist. They minimise the terms of each frame (`limb_terms`) and

    1/2 sum over frames and parts of h (|w|^2 + 2 tau^2 |w'|^2 + tau^4 |w''|^2)

with the time derivatives w' and w'', and the stiffness h, the square of the part's length [body units], times `UPPER`
for upper parts. A limb that has to leave its path for a moment takes about three times tau to leave it, and as long to
return. Gauss-Newton steps with a banded Cholesky factor continue around frames in which limbs still move.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from distretarget.ik.limb_terms import Frames, LimbWorkspace, write_displacements, write_terms
from distretarget.numerics.moving import largest
from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.time_series import Shots, slices_of, spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers, extent, lengths
from distretarget.skin.balls import Balls
from distretarget.skin.tangents import Displaced

TAU = 0.12  # [s]
LONGEST = 60.0  # the largest tau, as its fourth power drowns the terms above 500 frames a second [frames]
UPPER = 6.0  # upper arms and thighs are this much stiffer: elbows bend before shoulders turn
FADES = 10.0  # the time after which a displacement has no effect any more [tau]
NEAR = 2.0  # the next step is taken within this time of frames in which a limb moved [tau]
STEPS = 16  # at most
SETTLED = 2e-3  # limbs whose parts turn by less than this in a step have converged [rad]
FARTHEST = 0.5  # the largest component of a step [rad]
ROUNDED = 1e-9  # smaller displacements are rounding errors [body units]
TRIES = 12  # of a step that raises the energy and is larger than `SETTLED` ...
DAMPING = 8.0  # ... each with the damping multiplied by this in the frames that raise it
STENCILS = ((1.0,), (1.0, -1.0), (1.0, -2.0, 1.0))  # of w, w' and w''


def bends(
    balls: Balls,
    displaced: Displaced,
    zones: Numbers,
    frames: Frames,
    are_arms: Flags,
    start: Array,
    shots: Shots,
    frame_time: float,
    reach: float,
    steps: int = STEPS,
) -> Array:
    """Return how far to displace middle and end of each limb in each frame, (frames, limbs, 2, 3) [body units].

    Args:
        balls: of the body, with its capsules.
        displaced: how capsules move with the displaced joints.
        zones: (pairs,), the contact zone of each segment pair, a column of `frames.target_gaps`.
        frames: the body in each frame, and the targets of its limbs.
        are_arms: (limbs,); legs are solved first, and arms with legs where they are then.
        start: (frames, limbs, 2, 3), displacements that bring each limb out of the body on its final side.
        shots: (frames,); limbs may jump at cuts.
        frame_time: between frames [s].
        reach: the largest gap at which contacts other than the user's pull [body units].
        steps: at most so many are taken.
    """
    count, tau = len(are_arms), min(TAU / frame_time, LONGEST)
    displaced = displaced._replace(limbs=displaced.limbs % (count + 1))  # the last stands for all that no limb carries
    frames = Frames(*map(np.ascontiguousarray, frames))
    room, w = LimbWorkspace.of(balls, zones, count), _rotation_vectors(frames.limbs, start)
    stiffness = lengths(np.diff(frames.limbs, axis=2)).mean(axis=0) ** 2 * [UPPER, 1.0]
    of_pair = limbs_of_pairs(balls, displaced)[:, 0]

    def write(own: Numbers, columns: Numbers, first: int, span: slice, x: Array, *terms: Array) -> None:
        """Turn limbs by x, (frames, n), in a span of frames counted from the `first`, and write the terms there."""
        on = slice(first + span.start, first + span.stop)
        w[on, own] = x.reshape(len(x), len(own), 2, 3)
        some = Frames(*(each[on] for each in frames))
        write_terms(balls, displaced, zones, columns, some, w[on], reach, room, *terms)

    for arms in np.unique(are_arms):  # legs first, while arms do not move
        own, columns = np.flatnonzero(are_arms == arms), np.full(count + 1, -1)
        columns[own] = np.arange(len(own))
        pulled = frames.firmness.any(axis=1) | frames.anchor_weights.any(axis=(1, 2))
        pushed = (frames.soft[:, np.isin(of_pair, own)] < 0.0).any(axis=1)
        active = np.asarray(start[:, own].any(axis=(1, 2, 3)) | (arms & pulled) | pushed)
        for shot in slices_of(shots):
            for span in _around(active[shot], FADES * tau):
                first, end = shot.start + span.start, shot.start + span.stop
                x, h = w[first:end, own].reshape(end - first, -1), np.repeat(stiffness[own].ravel(), 3)
                _Path(x, h, tau, partial(write, own, columns, first)).settle(steps)
    d = np.zeros_like(start)
    write_displacements(w, frames.limbs, room, d)
    d[(np.abs(d) < ROUNDED).all(axis=(2, 3))] = 0.0
    return d


def limbs_of_pairs(balls: Balls, displaced: Displaced) -> Numbers:
    """Return the limbs that carry the two segments of each pair, (pairs, 2), by `displaced.limbs`. The second is -1 for
    no limb, and for a segment that does not move with one.
    """
    one = displaced.limbs[balls.carriers[balls.of_ball[balls.pairs[:, 0]]]]
    other = displaced.limbs[balls.of_capsule[balls.pairs[:, 1]]]
    return np.stack([one, np.where(displaced.mutual, other, -1)], axis=1)


def _around(flags: Flags, frames: float) -> list[slice]:
    """The spans of frames that are at most so many `frames` from one with a flag."""
    near = largest(flags[:, None].astype(float), round(frames))[:, 0] > 0.0
    return [slice(*span) for span in spans_of(near).tolist()]


def _rotation_vectors(limbs: Array, d: Array) -> Array:
    """(frames, limbs, 2, 3), the least rotations of the parts of limbs that displace middles and ends by d."""
    bones, by = np.diff(limbs, axis=2), np.diff(d, axis=2, prepend=0.0)
    turns = least_rotation(bones.reshape(-1, 3), (bones + by).reshape(-1, 3))
    return np.asarray(Rotation.from_quat(turns).as_rotvec().reshape(d.shape))


class _Path:
    """A path x, (frames, n), whose energy is that of the terms of its frames, plus 1/2 h x^T M x.

    M = D_0^T D_0 + 2 tau^2 D_1^T D_1 + tau^4 D_2^T D_2, with the k-th differences D_k in time, has five bands, here
    those from the diagonal down, (frames, 3); h, (n,), is the stiffness. `write(span, x, energy, slope, bands)` writes
    the terms of some frames.
    """

    def __init__(self, x: Array, h: Array, tau: float, write: Callable[..., None]) -> None:
        count, n = x.shape
        self.x, self.h, self.near, self.write = x, h, NEAR * tau, write
        self.M = np.zeros((count, 3))
        for c, stencil in zip((1.0, 2.0 * tau**2, tau**4), STENCILS, strict=True):
            for i, a in enumerate(stencil):
                for j, b in enumerate(stencil[: i + 1]):
                    self.M[j : max(count - len(stencil) + 1, 0) + j, i - j] += c * a * b
        self.damping = np.zeros(count)
        self.terms = np.zeros(count), np.zeros((count, n)), np.zeros((count, n, 2 * n + 1))

    def settle(self, steps: int) -> None:
        """Take steps until no limb moves any more, at most so many."""
        self._evaluate(slice(0, len(self.x)), self.x)
        moves, near = np.ones(len(self.x), bool), 0.0
        for _ in range(steps):
            spans = _around(moves, near)
            moves[:], near = False, self.near
            for span in spans:
                moves[span] = np.abs(self._step(span)).max(axis=1) > SETTLED

    def _step(self, span: slice) -> Array:
        """Take a step in some frames, damped until it does not raise the energy; return it, (frames, n)."""
        around = slice(max(span.start - 2, 0), span.stop + 2)
        inner = slice(span.start - around.start, span.stop - around.start)
        smooth = self.h * _product(self.M[around], self.x[around])[inner]
        energy, slope, bands = (each[span].copy() for each in self.terms)
        now, damping, (count, n) = self.x[span].copy(), self.damping[span], slope.shape
        for k in range(3):
            bands[:, :, k * n] += self.M[span, k, None] * self.h
        for _ in range(TRIES):
            damped = bands.copy()
            damped[:, :, 0] += damping[:, None] * self.h
            columns = damped.reshape(-1, 2 * n + 1).T
            step = solveh_banded(columns, -(slope + smooth).ravel(), overwrite_ab=True, lower=True, check_finite=False)
            step = step.reshape(count, n) * min(1.0, FARTHEST / max(extent(step), FARTHEST))
            change = self._evaluate(span, now + step) - energy.sum()
            change += (step * (smooth + 0.5 * self.h * _product(self.M[span], step))).sum()
            if change <= 0.0:
                damping /= DAMPING
                return np.asarray(step)
            if extent(step) <= SETTLED:
                break
            damping[self.terms[0][span] > energy] += 1.0
            damping[self.terms[0][span] > energy] *= DAMPING
        self._evaluate(span, now)
        return np.zeros_like(now)

    def _evaluate(self, span: slice, x: Array) -> float:
        """Set some frames of the path to x, and return the energy of their terms."""
        self.x[span] = x
        self.write(span, x, *(each[span] for each in self.terms))
        return float(self.terms[0][span].sum())


def _product(M: Array, x: Array) -> Array:
    """(frames, n), M x for a symmetric M, given by its diagonal and the two bands below, (frames, 3)."""
    product = M[:, :1] * x
    for k in (1, 2):
        product[:-k] += M[:-k, k, None] * x[k:]
        product[k:] += M[:-k, k, None] * x[:-k]
    return np.asarray(product)
