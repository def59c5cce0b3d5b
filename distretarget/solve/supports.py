"""The joints that rest on the world: on the floor, or on anything else that stands still; and where they belong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.solve.floor import Floor, no_floor
from distretarget.solve.springs import Springs, no_springs

Array = NDArray[np.float64]

RESTS = 0.99  # weight from which a joint rests


@dataclass(frozen=True, eq=False, kw_only=True)
class Supports:
    """Joints that rest on the world in some frames, and where they belong. Foot joints come first.

    Attributes:
        joints: (supports,), joints of the target.
        regions: (supports,), the region of the body that each belongs to; the joints of a region share its stiffness.
        feet: how many of them are foot joints: ankle and toe of one leg, then those of the other.
        weights: (frames, supports), 1 while the source's joint rests, blended to 0.
        places: (frames, supports, 3), where the target's joint belongs [target file units].
        floor: how low other joints may be [body units].
        touching: springs that draw joints to where they touch other performers [body units].
    """

    joints: NDArray[np.intp]
    regions: NDArray[np.intp]
    feet: int
    weights: Array
    places: Array
    floor: Floor
    touching: Springs

    @property
    def standing(self) -> Array:
        """(frames,), 1 while a foot rests, blended to 0."""
        return np.asarray(self.weights[:, : self.feet].max(axis=1, initial=0.0))

    def __getitem__(self, frames: slice) -> Supports:
        floor, touching = self.floor.of_frames(frames), self.touching.of_frames(frames)
        return replace(self, weights=self.weights[frames], places=self.places[frames], floor=floor, touching=touching)

    def with_others(
        self, joints: NDArray[np.intp], regions: NDArray[np.intp], weights: Array, places: Array
    ) -> Supports:
        """The same supports, and others."""
        return replace(
            self,
            joints=np.append(self.joints, joints),
            regions=np.append(self.regions, regions),
            weights=np.concatenate([self.weights, weights], axis=1),
            places=np.concatenate([self.places, places], axis=1),
        )


def no_supports(frames: int) -> Supports:
    """Nothing rests."""
    none = np.zeros(0, np.intp)
    return Supports(
        joints=none,
        regions=none,
        feet=0,
        weights=np.zeros((frames, 0)),
        places=np.zeros((frames, 0, 3)),
        floor=no_floor(frames),
        touching=no_springs(frames),
    )
