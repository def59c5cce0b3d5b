"""How far the arms of a body overlap its trunk by the way it is built."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from distretarget.body.body import Body
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.skin.balls import Balls
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.fit import distances
from distretarget.skin.limbs import Limb

# A forearm may overlap the trunk by this at the elbow, falling to 0 at the wrist [radii]: the upper arm next to it is
# all soft. The meshes of stout bodies then sink in by at most 2 % of the height; with 0.5, by more.
ELBOW = 0.4
MOST = 0.012  # the most that this is on thick arms, about what it is on an average one [body units]
IS_FOREARM = np.array(["forearm" in name for name in SEGMENTS])


class ArmOverlap(NamedTuple):
    """How far arms overlap the trunk. A shoulder joint may be inside the chest, as in robots whose chest is a wide box:
    no pose takes such an arm out of it, and hanging beside the hips is no fault.
    """

    of_balls: Array  # (balls,), how far each may overlap the trunk; 0 at wrists and for legs [body units]
    by_build: Array  # (balls,), how much farther if the trunk is as thick as its mesh, and no guess [body units]
    # (segments,), for those of arms whether the shoulder joint is inside the trunk: 0 up to a depth of the arm's
    # radius, 1 from one and a half radii on
    sunk: Array

    @classmethod
    def of(
        cls,
        body: Body,
        balls: Balls,
        posed: Array,
        is_trunk: Flags,
        limbs: Sequence[Limb],
        owners: Numbers,
        moving: Array,
    ) -> ArmOverlap:
        """Return the overlap of a body.

        Args:
            body: the body.
            balls: its balls.
            posed: (capsules, 2, 3), the ends of its capsules in the reference pose [body units].
            is_trunk: (capsules,), whether each belongs to the trunk.
            limbs: its limbs.
            owners: (balls,), the index of the limb that each ball belongs to.
            moving: (balls, 2), the shares of the displacements of the limb's middle and end by which each moves.
        """
        segments, sunk = np.repeat(np.arange(len(SEGMENTS)), np.diff(balls.of_ball)), np.zeros(len(SEGMENTS))
        of_balls, by_build = np.minimum(ELBOW * balls.radii, MOST) * IS_FOREARM[segments], np.zeros(len(segments))
        t, ends, trunk = balls.fractions[:, None], posed[balls.carriers], (posed[is_trunk], balls.cap_radii[is_trunk])
        places, hanging = (1.0 - t) * ends[:, 0] + t * ends[:, 1], body.hanging - body.reference.positions
        for number, limb in enumerate(limbs if is_trunk.any() else ()):
            on = (owners == number) & limb.is_arm
            if on.any():
                shoulder = body.reference.positions[[limb.top]] / body.unit
                hung = places[on] + moving[on] @ hanging[[limb.middle, limb.end]] / body.unit
                depth, *depths = -distances(np.concatenate([shoulder, hung]), *trunk)[0]
                inside = np.clip(2.0 * depth / balls.radii[on].mean() - 2.0, 0.0, 1.0)
                by_build[on] = inside * np.maximum(depths + balls.radii[on], 0.0)
                sunk[segments[on]] = inside
        return cls(of_balls * (1.0 - moving[:, 1]), by_build * (1.0 - moving[:, 1]), sunk)
