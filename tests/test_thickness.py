"""The thickness of bodies: capsules found from meshes whose capsules are known, and the segments of joints."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import person
from capsule_bodies import capsule_surface, mesh_of

from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.body.thickness import capsules_of
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.fit import distances

PERSON = person()
BODY = Body.of(PERSON)
HEIGHT = BODY.height


def dressed(body=BODY, thick=1.0):
    """A mesh of round limbs and a flat trunk around a body, and the radii of the limbs, by segment."""
    rest, roles = body.skeleton.rest_positions, body.anatomy.roles
    unit = thick * body.height / 1.7
    radii, surfaces = {}, []
    for side in ("left", "right"):
        for part, upper, lower, ends in (
            ("upper arm", "UpperArm", "LowerArm", (0.06, 0.045)),
            ("forearm", "LowerArm", "Hand", (0.045, 0.03)),
            ("thigh", "UpperLeg", "LowerLeg", (0.09, 0.06)),
            ("shin", "LowerLeg", "Foot", (0.055, 0.04)),
        ):
            a, b = roles[side + upper], roles[side + lower]
            radii[f"{side} {part}"] = unit * np.array(ends)
            surfaces.append((a, capsule_surface(rest[[a, b]], radii[f"{side} {part}"])))
    left = body.rest.axes[:, 0]
    for low, top in zip(trunk := [roles["hips"], *body.anatomy.spine, roles["head"]], trunk[1:], strict=False):
        for shift in (-0.07, 0.0, 0.07):
            ends = rest[[low, top]] + shift * body.height / 1.7 * left
            surfaces.append((low, capsule_surface(ends, unit * np.array([0.11, 0.11]))))
    return mesh_of(surfaces), radii


def in_world(capsules, skeleton):
    return capsules.ends + skeleton.rest_positions[capsules.joints][:, None]


def test_the_capsules_of_limbs_are_found_again():
    mesh, radii = dressed()
    capsules = capsules_of(BODY, mesh)
    for name, known in radii.items():
        (found,) = np.flatnonzero(capsules.segments == SEGMENTS.index(name))
        np.testing.assert_allclose(capsules.radii[found], known, atol=0.006 * HEIGHT)
        np.testing.assert_allclose(capsules.ends[found, 0], 0.0, atol=0.002 * HEIGHT)


def test_the_trunk_is_wider_than_deep():
    mesh, _ = dressed()
    capsules = capsules_of(BODY, mesh)
    trunk = np.isin(capsules.segments, [SEGMENTS.index(name) for name in ("chest", "belly", "pelvis")])
    width = np.ptp(in_world(capsules, PERSON)[trunk, 0, 0]) + 2 * capsules.radii[trunk].mean()
    unit = HEIGHT / 1.7
    assert width == pytest.approx(0.36 * unit, rel=0.15)
    assert capsules.radii[trunk].mean() == pytest.approx(0.11 * unit, rel=0.15)


def test_the_union_covers_the_skin_and_hardly_more():
    mesh, _ = dressed()
    capsules = capsules_of(BODY, mesh)
    away, _ = distances(mesh.vertices, in_world(capsules, PERSON), capsules.radii)
    assert np.percentile(away, 95) < 0.01 * HEIGHT
    assert abs(np.median(away)) < 0.02 * HEIGHT


def test_capsules_scale_with_the_body():
    mesh, _ = dressed()
    one = capsules_of(BODY, mesh)
    large = PERSON.with_offsets(8.0 * PERSON.offsets)
    eight = capsules_of(Body.of(large), replace(mesh, vertices=8.0 * mesh.vertices))
    np.testing.assert_allclose(eight.ends, 8.0 * one.ends, atol=1e-6 * HEIGHT)
    np.testing.assert_allclose(eight.radii, 8.0 * one.radii, rtol=1e-9)


def test_a_symmetric_body_has_symmetric_capsules():
    mesh, _ = dressed()
    capsules = capsules_of(BODY, mesh)
    ends = in_world(capsules, PERSON)
    for name in SEGMENTS[::2][:6]:
        left, right = (capsules.segments == SEGMENTS.index(name.replace("left", side)) for side in ("left", "right"))
        np.testing.assert_allclose(ends[left] * [-1, 1, 1], ends[right], atol=2e-3 * HEIGHT)
        np.testing.assert_allclose(capsules.radii[left], capsules.radii[right], atol=2e-3 * HEIGHT)


def test_stated_radii_are_kept():
    mesh, _ = dressed()
    elbow = BODY.anatomy.roles["leftLowerArm"]
    capsules = capsules_of(BODY, mesh, {elbow: 0.2 * HEIGHT})
    assert capsules.radii[capsules.joints == elbow].mean() == pytest.approx(0.2 * HEIGHT)


def test_a_body_without_anatomy_has_no_capsules():
    mesh, _ = dressed()
    assert not len(capsules_of(replace(BODY, anatomy=None), mesh))


def test_every_joint_of_a_person_is_in_the_segment_of_its_role():
    segments = find_segments(BODY)
    roles = {"hips": "pelvis", "head": "head", "leftHand": "left hand", "rightUpperLeg": "right thigh"}
    for role, name in roles.items():
        assert SEGMENTS[segments.of_joint[BODY.anatomy.roles[role]]] == name
    spine = [SEGMENTS[segments.of_joint[joint]] for joint in BODY.anatomy.spine]
    assert spine == sorted(spine)
    assert spine[-1] == "chest"
