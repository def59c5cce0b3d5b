"""The capsules that stand for the surface of a body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.build import average_for
from distretarget.body.segments import find_segments
from distretarget.skin.capsules import SEGMENTS, Capsules, no_capsules
from distretarget.skin.fit import COVERED_HARD, Part, fit_capsules
from distretarget.skin.mesh import SkinnedMesh

Array = NDArray[np.float64]

ROUND_LIMB = 1.6  # one capsule is enough for a limb that is not more than this times as wide as high
LEGS = ("thigh", "shin")
TIPS = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}


def capsules_of(body: Body, mesh: SkinnedMesh | None = None, radii: Mapping[int, float] | None = None) -> Capsules:
    """Return the capsules of a body; none where it has no anatomy.

    Args:
        body: the body.
        mesh: its mesh; without one the body is as thick as an average one of its age.
        radii: of what single joints carry, by joint, as the file states them [file units].
    """
    if body.anatomy is None:
        return no_capsules()
    if mesh is None:
        return _as_thick(average_for(body).on(body), radii or {})
    bound = body.motion.skeleton if body.motion else body.skeleton
    return _as_thick(fit_capsules(mesh, bound, tuple(_parts(body))), radii or {})


def radii_of(capsules: Capsules) -> dict[int, float]:
    """Return the mean radius of what each joint carries, by joint [file units]."""
    return {
        joint: float(capsules.radii[capsules.joints == joint].mean()) for joint in np.unique(capsules.joints).tolist()
    }


def _as_thick(capsules: Capsules, radii: Mapping[int, float]) -> Capsules:
    """The capsules with these mean radii of what single joints carry."""
    thick = capsules.radii.copy()
    for joint, radius in radii.items():
        on = capsules.joints == joint
        if on.any():
            thick[on] *= radius / thick[on].mean()
    return replace(capsules, radii=thick)


def _parts(body: Body) -> Iterator[Part]:
    """The parts of a body with an anatomy whose capsules single joints carry."""
    assert body.anatomy is not None
    roles, segments = body.anatomy.roles, find_segments(body)
    left, up, _ = body.rest.axes.T
    trunk = [roles["hips"], *body.anatomy.spine]
    names = {joint: role for role, joint in roles.items()}
    for carrier in np.unique(segments.carriers[segments.carriers >= 0]).tolist():
        joints, segment = segments.joints(carrier), segments.of_joint.item(carrier)
        name = SEGMENTS[segment]
        side, _, limb = name.partition(" ")
        if carrier in trunk:
            closed = carrier == trunk[0], carrier == trunk[-1]
            yield Part(carrier, joints, segment, axis=up, across=left, closed=closed)
        elif name == "head":
            yield Part(carrier, joints, segment, axis=up, covered=COVERED_HARD)
        elif limb == "foot":
            is_toes = names.get(carrier, "").endswith("Toes")
            axis = _foot_axis(body, side)
            yield Part(
                carrier, joints, segment, axis=axis, level=up, closed=(not is_toes, True), most=4 if is_toes else 2
            )
        elif limb == "hand":
            is_palm = carrier == roles.get(f"{side}Hand")
            is_thumb = "Thumb" in names.get(carrier, "")
            most = 3 if is_palm else 1 if is_thumb else 2
            yield Part(carrier, joints, segment, closed=(False, True), most=most, covered=COVERED_HARD)
        else:
            role = names.get(carrier, "")
            below = next((side + tip for part, tip in TIPS.items() if role == side + part), "head")
            yield Part(
                carrier,
                joints,
                segment,
                tip=roles.get(below),
                parent=roles["hips"] if limb == "thigh" else None,
                closed=(False, False),
                most=2,
                round=ROUND_LIMB,
                is_leg=limb in LEGS,
            )


def _foot_axis(body: Body, side: str) -> Array | None:
    """(3,), the direction from ankle to toes in the rest pose; None for a foot without length."""
    leg = body.legs[SIDES.index(side)] if body.legs else None
    if leg is None or leg.toe == leg.ankle:
        return None
    rest = body.skeleton.rest_positions
    return np.asarray(rest[leg.toe] - rest[leg.ankle])
