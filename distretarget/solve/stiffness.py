"""How stiffly each part of a body keeps to the rotation copy, where contacts and feet draw at it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import pelvis_joint
from distretarget.solve.poses import PoseProblem
from distretarget.solve.rigid_parts import subtree_lengths
from distretarget.solve.settings import ContactSettings

Array = NDArray[np.float64]


def part_stiffness(problem: PoseProblem, settings: ContactSettings) -> Array:
    """h: (parts + 1,), the stiffness of each part's rotation; last, that of the root's path.

    It grows with the length of a part's bones and, far more, with the share of the body that the part carries, so that
    arms give way before the spine does. Bones that carry no point of the distance problem do not count as carried. Feet
    are stiffer by `foot_factor`, and parts that only the floor moves softer by `loose_factor`. Parts above the pelvis
    have the `fixed_stiffness`.
    """
    skeleton, legs, parts = problem.skeleton, problem.legs, problem.parts
    carried = subtree_lengths(skeleton, problem.distances.targets)
    longest = np.zeros(parts.max() + 1)
    bones = np.zeros_like(longest)
    np.add.at(bones, parts[skeleton.parents[1:]], skeleton.lengths[1:] / problem.unit)
    share = np.divide(carried, carried[0], out=np.zeros_like(carried), where=carried[0] > 0)
    np.maximum.at(longest, parts[skeleton.parents[1:]], share[skeleton.parents[1:]])
    stiffness = settings.base_stiffness * (bones + settings.added_length) * (1.0 + settings.trunk_factor * longest)
    feet = {joint for leg in legs or () for joint in (leg.ankle, leg.toe) if skeleton.children[joint]}
    stiffness[parts[sorted(feet)]] *= settings.foot_factor
    stiffness[problem.loose_parts] *= settings.loose_factor
    if legs:
        pelvis = pelvis_joint(skeleton, legs)
        above = [joint for joint in skeleton.line(pelvis) if parts[joint] != parts[pelvis]]
        stiffness[parts[above]] = settings.fixed_stiffness
    return np.append(stiffness, settings.root_stiffness)
