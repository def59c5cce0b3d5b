"""Activations of the pairs of one body over the frames of one shot. Compiled."""

from __future__ import annotations

from typing import NamedTuple

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.moving import write_averaged, write_largest, write_median
from distretarget.numerics.vectors import F1, F2, F3, I1


class Pairs(NamedTuple):
    """Pairs of joints in the frames of a shot."""

    D: F2  # (frames, pairs), the least normalised distance about each frame
    enabled: F2  # (frames, pairs), 0 where the user drops a contact, else 1
    near: F1  # (pairs,), the D up to which each is in contact
    apart: F1  # (pairs,), the D from which it is not
    hangs: I1  # (hanging pairs,), pairs that hanging arms bring near; a constant D is a contact, too
    D_of_hangs: F2  # (frames, hanging pairs)
    raised: F2  # (frames, hanging pairs), how far the arm of each is raised or bent, 0 to 1


@compiled()
def write_activation(
    pairs: Pairs,
    reach: float,
    farthest: float,
    steady: float,
    unsteady: float,
    held: int,
    weights: F1,
    of_all: Out[F3],
    of_hangs: Out[F3],
    f: Out[F2],
) -> None:
    """Write f, see `SelfContact.activation`. A hand whose D varies by up to `steady` within `held` frames before and
    after a frame is in contact up to `reach`; from `unsteady` on it is not. `weights` are those of the moving average
    in time. `of_all`, (3, frames, pairs), and `of_hangs`, (5, frames, hanging pairs), are scratch.
    """
    largest, before, after = of_all[0], of_all[1], of_all[2]
    for frame in range(len(f)):
        for n in range(f.shape[1]):
            f[frame, n] = _sets_in(pairs.D[frame, n], pairs.near[n], pairs.apart[n])
    if len(pairs.hangs) > 0:
        _add_held(pairs, reach, farthest, steady, unsteady, held, of_hangs, f)
    for frame in range(len(f)):
        for n in range(f.shape[1]):
            f[frame, n] *= pairs.enabled[frame, n]
    if len(weights) > 1:
        write_largest(f, len(weights) - 1, before, after, largest)
        write_averaged(largest, weights, f)


@inlined()
def _add_held(pairs, reach, farthest, steady, unsteady, held, scratch, f):  # type: ignore[no-untyped-def]
    """Raise f where the D of a hand is constant."""
    D, raised, most, least, before, after = pairs.D_of_hangs, scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    write_largest(D, held, before, after, most)
    for frame in range(len(f)):
        for n in range(D.shape[1]):
            raised[frame, n] = -D[frame, n]
    write_largest(raised, held, before, after, least)
    write_median(pairs.raised, raised)
    for frame in range(len(f)):
        for n in range(D.shape[1]):
            varies = most[frame, n] + least[frame, n]
            t = _within((unsteady - varies) / (unsteady - steady))
            value = t * t * (3.0 - 2.0 * t) * raised[frame, n] * _sets_in(D[frame, n], reach, farthest)
            f[frame, pairs.hangs[n]] = max(f[frame, pairs.hangs[n]], value)


@inlined()
def _sets_in(D: float, near: float, apart: float) -> float:
    """1 up to D = near, 0 from D = apart on, and smooth in between."""
    t = _within((apart - D) / (apart - near))
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


@inlined()
def _within(t: float) -> float:
    """The nearest number from 0 to 1."""
    return min(max(t, 0.0), 1.0)
