"""Activation: from 0 to 1, whether two joints are in contact in a frame, from their normalised distance D, Eq. (1).

A hand that hangs is near hip and thigh and touches neither. So two joints of one body are in contact if they are
clearly nearer than with hanging arms, or if they stay near each other while the arm is raised or bent.
`ContactSettings` holds what an animator may want to change; all else are constants.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np

from distretarget.checks import brief_repr
from distretarget.errors import SettingsError
from distretarget.numerics.moving import raised_cosine
from distretarget.numerics.time_series import Shots, by_shot
from distretarget.numerics.vectors import Array, Flags
from distretarget.objectives.activation_terms import Pairs, write_activation

FADE = 0.05  # [D] a contact fades out from `reach` to `reach` plus this
# A pair is in contact up to `NEARER` times its D in a body with hanging arms, and in none from `AS_FAR` times it on.
NEARER = 0.6
AS_FAR = 0.9
HELD = 0.15  # a hand is held in place if its D is constant for this time before and after a frame [s]
STEADY, UNSTEADY = 0.02, 0.04  # a D that varies by up to the first is constant, from the second on it is not [D]


@dataclass(frozen=True, kw_only=True, repr=False)
class ContactSettings:
    """How strongly self-contacts and foot lock act; the defaults suit every clip and body.

    Attributes:
        strength: [-] stiffness of contacts against the source's rotations; 2 is twice as stiff.
        reach: [-] two joints may be in contact up to this normalised distance D, Eq. (1), and fade out over the next
            0.05. A larger reach keeps more contacts and changes the motion more.
        blend: [s] a contact blends in over twice this time, and out over twice this time; longer is smoother.
        foot_lock: [-] how strongly feet and other resting joints are held in place; 1 is usual, 0 leaves them free.

    Raises:
        SettingsError: a value is no finite number, or less than 0.
    """

    strength: float = 1.0
    reach: float = 0.13
    blend: float = 0.36
    foot_lock: float = 1.0

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not isinstance(value, int | float) or not 0 <= value < math.inf:
                raise SettingsError(f"{name} is {value!r}; it has to be a finite number, not less than 0")


DEFAULT_SETTINGS = ContactSettings()


def activation(D: Array, shots: Shots, lead: float, reach: float) -> Array:
    """f: (frames, pairs), the activation of pairs of two bodies, 0 to 1, from their normalised distances D.

    It is 1 up to `reach`, 0 from `reach + FADE` on, and smooth in between. It rises over 2 `lead` frames before a
    contact and falls over as many after it, but never across a cut between `shots`, (frames,). With the least D about
    each frame (`numerics.joint_pairs.least_distances`) it does not depend on the frame rate.
    """
    hanging, raised, enabled = np.full(D.shape[1], np.inf), np.zeros_like(D), np.ones_like(D)
    return SelfContact(lead, 0, reach).activation(D, hanging, raised, shots, enabled)


def activation_window(lead: float) -> int:
    """The number of frames on each side that `activation` depends on: twice the lead, one for the least D about a
    frame, and one for the median of three.
    """
    return 2 * round(lead) + 2


@dataclass(frozen=True)
class SelfContact:
    """When pairs of joints of one body are in contact."""

    lead: float  # frames; an activation rises before a contact and falls after it over twice this
    held: int  # a hand is held in place if its D is constant for this many frames before and after a frame
    reach: float  # [D] as in `activation`

    @classmethod
    def of(cls, settings: ContactSettings, frame_time: float) -> SelfContact:
        """Return the conditions of contact at a frame time [s]."""
        return cls(settings.blend / frame_time, max(round(HELD / frame_time), 1), settings.reach)

    @property
    def window(self) -> int:
        """The number of frames on each side that an activation depends on."""
        return activation_window(self.lead) + self.held

    def apart(self, hanging: Array, raised: Flags) -> Array:
        """Return the D from which each pair is in no contact, (pairs,). `hanging` as in `activation`; `raised`,
        (pairs,), says whether the arm of either joint is ever raised or bent.
        """
        farthest = self.reach + FADE
        return np.where(raised, farthest, np.minimum(farthest, AS_FAR * hanging))

    def activation(self, D: Array, hanging: Array, raised: Array, shots: Shots, enabled: Array) -> Array:
        """f: (frames, pairs), as the function `activation`, for pairs of one body.

        `hanging`, (pairs,), is the D of each pair in the same body with hanging arms, infinite where that is unknown;
        `raised`, (frames, pairs), how far the arm of either joint is raised or bent, 0 to 1; `enabled`, (frames,
        pairs), 0 where the user drops a contact, else 1.
        """
        return by_shot(partial(self._activation, hanging), shots, D, raised, enabled)

    def _activation(self, hanging: Array, D: Array, raised: Array, enabled: Array) -> Array:
        reach, farthest, frames = self.reach, self.reach + FADE, len(D)
        near, apart = np.minimum(reach, NEARER * hanging), np.minimum(farthest, AS_FAR * hanging)
        hangs = np.flatnonzero((AS_FAR * hanging < farthest) & raised.any(axis=0))
        D, enabled = np.ascontiguousarray(D), np.ascontiguousarray(enabled)
        pairs = Pairs(D, enabled, near, apart, hangs, np.take(D, hangs, axis=1), np.take(raised, hangs, axis=1))
        weights, f = raised_cosine(round(self.lead)), np.empty_like(D)
        of_all, of_hangs = np.empty((3, *D.shape)), np.empty((5, frames, len(hangs)))
        write_activation(pairs, reach, farthest, STEADY, UNSTEADY, self.held, weights, of_all, of_hangs, f)
        return f
