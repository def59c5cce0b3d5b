"""Activation: from 0 to 1, whether two joints are in contact in a frame, from their normalised distance D, Eq. (1).

A contact is what a limb goes out of its way for. A hand that hangs is near hip and thigh and touches neither; so joints
of one body are in contact if they are clearly nearer than in a body with hanging arms, or if they stay near each other
on a raised or bent arm.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled
from distretarget.numerics.time_series import Shots, by_shot, largest, median_of_three, smoothstep, widened
from distretarget.objectives.settings import ContactSettings

Array = NDArray[np.float64]

FADE = 0.05  # [D] a contact fades out from `reach` to `reach` plus this
# A pair is in contact up to `NEARER` times its D in a body with hanging arms, and in none from `AS_FAR` times it on.
NEARER = 0.6
AS_FAR = 0.9
HELD = 0.15  # a hand is held where it is if it keeps its D for this time before and after a frame [s]
STEADY, UNSTEADY = 0.02, 0.04  # a D that varies by the first keeps, by the second does not [D]


def activation(D: Array, shots: Shots, lead: float, reach: float) -> Array:
    """f: (frames, pairs), the activation of pairs of two bodies, 0 to 1, from their normalised distances D.

    It is 1 up to `reach`, 0 from `reach + FADE` on, and smooth in between; it rises before a contact and falls after it
    over 2 `lead` frames. A median of three frames ignores a single faulty frame. Nothing spreads across a cut between
    `shots`, (frames,).
    """
    return by_shot(lambda each: widened(_sets_in(each, reach, reach + FADE), lead), shots, D)


def activation_window(lead: float) -> int:
    """The number of frames on each side that `activation` depends on: twice the lead, and one for the median."""
    return 2 * round(lead) + 1


@dataclass(frozen=True)
class SelfContact:
    """When pairs of joints of one body are in contact."""

    lead: float  # frames; an activation rises before a contact and falls after it over twice this
    held: int  # a hand is held if it keeps its distance for this many frames before and after a frame
    reach: float  # [D] as in `activation`

    @classmethod
    def of(cls, settings: ContactSettings, frame_time: float) -> SelfContact:
        """Return it for a frame time [s]."""
        return cls(settings.blend / frame_time, max(round(HELD / frame_time), 1), settings.reach)

    @property
    def window(self) -> int:
        """The number of frames on each side that an activation depends on."""
        return activation_window(self.lead) + self.held

    def apart(self, hanging: Array, raised: Array) -> Array:
        """Return the D from which pairs are in no contact, (pairs,); `hanging` and `raised` as in `activation`."""
        farthest = self.reach + FADE
        return np.where(raised.any(axis=0), farthest, np.minimum(farthest, AS_FAR * hanging))

    def activation(self, D: Array, hanging: Array, raised: Array, shots: Shots, kept: Array | None = None) -> Array:
        """f: (frames, pairs), as `activation` for two bodies.

        `hanging`, (pairs,), is the D of the pairs in the same body with hanging arms, infinite where that is not known;
        `raised`, (frames, pairs), how far the arm of either joint is raised or bent, 0 to 1; `kept`, (frames, pairs), 0
        where a contact is dropped, else 1; None to drop none.
        """
        given = (D, raised) if kept is None else (D, raised, kept)
        return by_shot(partial(self._activation, hanging), shots, *given)

    def _activation(self, hanging: Array, D: Array, raised: Array, kept: Array | None = None) -> Array:
        reach, farthest = self.reach, self.reach + FADE
        f = _sets_in(D, np.minimum(reach, NEARER * hanging), np.minimum(farthest, AS_FAR * hanging))
        hangs = np.flatnonzero((AS_FAR * hanging < farthest) & raised.any(axis=0))
        if len(hangs):
            D, raised = (median_of_three(np.take(each, hangs, axis=1)) for each in (D, raised))
            varies = largest(D, self.held) + largest(-D, self.held)
            held = smoothstep((UNSTEADY - varies) / (UNSTEADY - STEADY)) * raised
            f[:, hangs] = np.maximum(f[:, hangs], held * _sets_in(D, reach, farthest))
        return widened(f if kept is None else f * kept, self.lead)


def _sets_in(D: Array, near: Array | float, apart: Array | float) -> Array:
    """(frames, pairs), the activation before it is widened."""
    f, pairs = np.empty_like(D), np.ones(D.shape[1])
    _write_sets_in(D, near * pairs, apart * pairs, f)
    return f


@compiled()
def _write_sets_in(D, near, apart, f):  # type: ignore[no-untyped-def]
    """Write the activation by the median of three frames of the distances D, (frames, pairs)."""
    for frame in range(len(D)):
        before, after = max(frame - 1, 0), min(frame + 1, len(D) - 1)
        for pair in range(D.shape[1]):
            a, b, c = D[before, pair], D[frame, pair], D[after, pair]
            median = max(min(a, c), min(b, max(a, c)))
            t = min(max((apart[pair] - median) / (apart[pair] - near[pair]), 0.0), 1.0)
            f[frame, pair] = t * t * t * (t * (6.0 * t - 15.0) + 10.0)
