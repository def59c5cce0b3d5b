"""The feet at rest on the floor, and where they belong on the target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import Leg
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.smoothing import widened
from distretarget.solve.settings import ContactSettings

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stance:
    """Feet at rest, and where they belong.

    Attributes:
        joints: (feet,), ankles and toes of the target.
        weights: (frames, feet), 1 while the source's foot rests, blended to 0.
        places: (frames, feet, 3), where the target's foot belongs [target file units].
    """

    joints: NDArray[np.intp]
    weights: Array
    places: Array

    def __getitem__(self, frames: slice) -> Stance:
        return Stance(self.joints, self.weights[frames], self.places[frames])


def no_stance(frames: int) -> Stance:
    """No foot rests."""
    return Stance(np.zeros(0, np.intp), np.zeros((frames, 0)), np.zeros((frames, 0, 3)))


def find_stance(matching: Matching, scale: float, settings: ContactSettings) -> Stance:
    """The feet at rest in the source, and their places on the target: the scaled places of the source's.

    A foot rests while it is slow and low. Only the frames around a frame decide, so that a clip may be cut anywhere.
    Feet whose bones are not in proportion to the legs keep the toe's place; the ankle follows it (`_places`).
    """
    source, legs = matching.source_motion, matching.legs
    if legs is None:
        return no_stance(len(source))
    up, length = matching.source.up_vector, matching.leg_lengths[0]
    joints, weights, places = [], [], []
    for driver, leg in zip(*legs, strict=True):
        rest = _at_rest(source, driver, up, length, settings)
        joints += [leg.ankle, leg.toe]
        weights += list(widened(rest.astype(np.float64), settings.stance_blend / source.frame_time).T)
        foot = matching.target.skeleton.path_lengths[leg.ankle, leg.toe]
        places += _places(source, driver, up, scale, foot, settings)
    return Stance(np.array(joints), np.stack(weights, axis=1), np.stack(places, axis=1))


def _at_rest(source: Motion, leg: Leg, up: Array, length: float, settings: ContactSettings) -> NDArray[np.bool_]:
    """(frames, 2), whether ankle and toe rest."""
    feet = source.positions[:, [leg.ankle, leg.toe]]
    if len(feet) < 2:
        return np.ones((len(feet), 2), bool)
    speed = np.linalg.norm(np.gradient(feet, source.frame_time, axis=0), axis=-1)
    below = [leg.ankle, leg.toe, *source.skeleton.children[leg.toe]]
    heights = source.positions @ up
    low = heights[:, below].min(axis=1) - heights.min(axis=1) < settings.rest_height * length
    return np.asarray((speed < settings.rest_speed * length) & low[:, None])


def _places(source: Motion, leg: Leg, up: Array, scale: float, bone: float, settings: ContactSettings) -> list[Array]:
    """Where ankle and toe belong, (frames, 3) each, a foot's bone of the given length apart.

    The sine of the foot's pitch is scaled so that a flat foot's ankle comes to the scaled height, less and less so the
    steeper the foot: s' = s (q + (1 - q) |s|^3), q being the scaled length of the source's foot over the target's.
    """
    toe = scale * source.positions[:, leg.toe]
    foot = source.positions[:, leg.ankle] - source.positions[:, leg.toe]
    length = np.linalg.norm(foot, axis=1)
    if not length.all() or bone == 0.0:
        return [toe, toe]
    q = np.clip(scale * length / bone, settings.least_pitch, settings.most_pitch)
    sine = np.clip(foot @ up / length, -1.0, 1.0)
    pitched = sine * (q + (1.0 - q) * np.abs(sine) ** 3)
    level = foot - (foot @ up)[:, None] * up
    reach = np.sqrt(1.0 - pitched**2) / np.maximum(np.linalg.norm(level, axis=1), 1e-9 * length)
    return [toe + bone * (reach[:, None] * level + pitched[:, None] * up), toe]
