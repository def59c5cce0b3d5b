"""The thickness of bodies: capsules found from meshes whose capsules are known, and the segments of joints."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, posed, sample_target, taken
from capsule_bodies import capsule_surface, mesh_of
from input_files import file_of
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import BUILDS, Build, average_build, capsules_of, radii_of
from distretarget.body.segments import find_segments
from distretarget.errors import SkeletonFileError
from distretarget.io.reading import parse_target
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.fit import Part, distances, fit_capsules
from distretarget.skin.mesh import SkinnedMesh

BODY = Body.of(PERSON)
HEIGHT = BODY.height
HERO_BODY = Body.of(sample_target("hero").skeleton)


@pytest.fixture(scope="module")
def dressed():
    """A mesh of round limbs and a flat trunk around the person, and the radii of the limbs, by segment."""
    rest, roles = PERSON.rest_positions, BODY.anatomy.roles
    unit = HEIGHT / 1.7
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
    left = BODY.rest.axes[:, 0]
    for low, top in zip(trunk := [roles["hips"], *BODY.anatomy.spine, roles["head"]], trunk[1:], strict=False):
        for shift in (-0.07, 0.0, 0.07):
            ends = rest[[low, top]] + shift * unit * left
            surfaces.append((low, capsule_surface(ends, unit * np.array([0.11, 0.11]))))
    return mesh_of(surfaces), radii


@pytest.fixture
def mesh(dressed):
    return dressed[0]


def wearing(mesh, joint, surface):
    """A mesh with one more piece, which moves with a joint."""
    over = mesh_of([(joint, surface)])
    return SkinnedMesh(
        *(np.concatenate([getattr(mesh, name), getattr(over, name)]) for name in ("vertices", "joints", "weights")),
        np.concatenate([mesh.triangles, over.triangles + len(mesh.vertices)]),
    )


def in_world(capsules, skeleton):
    return capsules.ends + skeleton.rest_positions[capsules.joints][:, None]


def test_the_capsules_of_limbs_are_found_again(dressed):
    mesh, radii = dressed
    capsules = capsules_of(BODY, mesh)
    for name, known in radii.items():
        (found,) = np.flatnonzero(capsules.segments == SEGMENTS.index(name))
        np.testing.assert_allclose(capsules.radii[found], known, atol=0.006 * HEIGHT)
        np.testing.assert_allclose(capsules.ends[found, 0], 0.0, atol=0.002 * HEIGHT)


def test_a_skirt_does_not_make_thick_legs(dressed):
    mesh, radii = dressed
    hip, knee = (BODY.anatomy.roles[f"left{part}"] for part in ("UpperLeg", "LowerLeg"))
    skirt = capsule_surface(PERSON.rest_positions[[hip, knee]], [0.2, 0.25])
    capsules = capsules_of(BODY, wearing(mesh, hip, skirt))
    on = capsules.segments == SEGMENTS.index("left thigh")
    assert capsules.radii[on].max() < 1.3 * radii["left thigh"].max()


@pytest.mark.parametrize(
    ("role", "at", "sizes"),
    [
        ("head", (0.0, 0.18, 0.0), (0.35, 0.02, 0.35)),  # the brim of a hat
        ("hips", (0.25, -0.4, -0.1), (0.02, 0.5, 0.04)),  # a scabbard
        ("upperChest", (0.0, -0.4, -0.3), (0.3, 0.7, 0.02)),  # a cape
    ],
)
def test_what_stands_off_trunk_and_head_does_not_make_them_thick(mesh, role, at, sizes):
    rest, joint = PERSON.rest_positions, BODY.anatomy.roles[role]
    sphere = np.array([[0.0, -1e-6, 0.0], [0.0, 1e-6, 0.0]])
    skull = capsule_surface(rest[BODY.anatomy.roles["head"]] + [0.0, 0.1, 0.0] + sphere, [0.12, 0.12])
    head = wearing(mesh, BODY.anatomy.roles["head"], skull)
    points, triangles = capsule_surface(sphere, [1.0, 1.0])
    dressed = wearing(head, joint, (rest[joint] + at + points * sizes, triangles))
    both = [capsules_of(BODY, each) for each in (head, dressed)]
    away = [distances(head.vertices, in_world(each, PERSON), each.radii)[0] for each in both]
    np.testing.assert_allclose(away[1], away[0], atol=0.04)


def test_the_trunk_is_wider_than_deep(mesh):
    capsules = capsules_of(BODY, mesh)
    trunk = np.isin(capsules.segments, [SEGMENTS.index(name) for name in ("chest", "belly", "pelvis")])
    width = np.ptp(in_world(capsules, PERSON)[trunk, 0, 0]) + 2 * capsules.radii[trunk].mean()
    unit = HEIGHT / 1.7
    assert width == pytest.approx(0.36 * unit, rel=0.15)
    assert capsules.radii[trunk].mean() == pytest.approx(0.11 * unit, rel=0.15)


def test_the_union_covers_the_skin_and_hardly_more(mesh):
    capsules = capsules_of(BODY, mesh)
    away, _ = distances(mesh.vertices, in_world(capsules, PERSON), capsules.radii)
    assert np.percentile(away, 95) < 0.01 * HEIGHT
    assert abs(np.median(away)) < 0.02 * HEIGHT


def test_segments_are_covered_as_far_as_asked_next_to_others(mesh):
    capsules = capsules_of(BODY, mesh)
    outside = distances(mesh.vertices, in_world(capsules, PERSON), capsules.radii)[0] > 1e-3 * HEIGHT
    for part, role in (("thigh", "UpperLeg"), ("shin", "LowerLeg"), ("forearm", "LowerArm")):
        assert outside[mesh.joints[:, 0] == BODY.anatomy.roles[f"left{role}"]].mean() < 0.1, part


def test_flanks_that_move_with_the_thighs_are_the_pelvis(mesh):
    hips, thigh = (BODY.anatomy.roles[name] for name in ("hips", "leftUpperLeg"))
    outer = (mesh.joints[:, 0] == hips) & (mesh.vertices[:, 0] > PERSON.rest_positions[thigh, 0])
    assert outer.any()
    flanks = replace(mesh, joints=np.where(outer[:, None], thigh, mesh.joints))
    one, other = capsules_of(BODY, mesh), capsules_of(BODY, flanks)
    np.testing.assert_allclose(other.radii, one.radii, atol=2e-3 * HEIGHT)
    np.testing.assert_allclose(other.ends, one.ends, atol=2e-3 * HEIGHT)


def test_a_part_whose_skin_is_a_point_has_finite_capsules(mesh):
    foot = BODY.anatomy.roles["leftFoot"]
    point = replace(mesh, vertices=1e-32 * mesh.vertices, joints=np.full_like(mesh.joints, foot))
    part = Part(foot, [foot], SEGMENTS.index("left foot"), axis=np.array([0.0, 0.0, 1.0]), across=np.eye(3)[0])
    capsules = fit_capsules(point, PERSON.with_offsets(PERSON.offsets + 0.1), [part])
    assert len(capsules)
    assert np.isfinite(capsules.radii).all()
    assert np.isfinite(capsules.ends).all()


def test_capsules_scale_with_the_body(mesh):
    one = capsules_of(BODY, mesh)
    large = PERSON.with_offsets(8.0 * PERSON.offsets)
    eight = capsules_of(Body.of(large), replace(mesh, vertices=8.0 * mesh.vertices))
    np.testing.assert_allclose(eight.ends, 8.0 * one.ends, atol=1e-6 * HEIGHT)
    np.testing.assert_allclose(eight.radii, 8.0 * one.radii, rtol=1e-9)


def test_a_symmetric_body_has_symmetric_capsules(mesh):
    capsules = capsules_of(BODY, mesh)
    ends = in_world(capsules, PERSON)
    for name in SEGMENTS[::2][:6]:
        left, right = (capsules.segments == SEGMENTS.index(name.replace("left", side)) for side in ("left", "right"))
        np.testing.assert_allclose(ends[left] * [-1, 1, 1], ends[right], atol=2e-3 * HEIGHT)
        np.testing.assert_allclose(capsules.radii[left], capsules.radii[right], atol=2e-3 * HEIGHT)


def test_stated_radii_are_kept(mesh):
    elbow = BODY.anatomy.roles["leftLowerArm"]
    capsules = capsules_of(BODY, mesh, {elbow: 0.2 * HEIGHT})
    assert capsules.radii[capsules.joints == elbow].mean() == pytest.approx(0.2 * HEIGHT)


def test_every_joint_of_a_person_is_in_the_segment_of_its_role():
    segments = find_segments(BODY)
    roles = {"hips": "pelvis", "head": "head", "leftHand": "left hand", "rightUpperLeg": "right thigh"}
    for role, name in roles.items():
        assert SEGMENTS[segments.of_joint[BODY.anatomy.roles[role]]] == name
    spine = [SEGMENTS[segments.of_joint[joint]] for joint in BODY.anatomy.spine]
    assert spine == sorted(spine)
    assert spine[-1] == "chest"


def test_an_average_body_has_all_segments_of_the_sizes_of_people():
    assert {SEGMENTS[each] for each in capsules_of(BODY).segments} == {*SEGMENTS} - {"belly"}
    assert {SEGMENTS[each] for each in capsules_of(HERO_BODY).segments} == {*SEGMENTS}
    capsules = capsules_of(HERO_BODY)
    belly = capsules.radii[capsules.segments == SEGMENTS.index("belly")]
    assert 0.1 < 2 * belly.mean() / HERO_BODY.height < 0.16
    capsules, wrist = capsules_of(BODY), BODY.anatomy.roles["leftHand"]
    ends = in_world(capsules, PERSON) - PERSON.rest_positions[wrist]
    on = capsules.segments == SEGMENTS.index("left hand")
    reach = (np.linalg.norm(ends[on], axis=2) + capsules.radii[on]).max()
    assert 0.095 < reach / HEIGHT < 0.14


@pytest.mark.parametrize("name", BUILDS)
def test_average_toes_are_side_by_side_without_gaps_and_begin_at_the_foot(name):
    parts = average_build(name).parts
    toes, foot = parts["left toes"], parts["left foot"]
    order = toes[:, 0, 1].argsort()
    starts = toes[order, 0]
    assert (np.diff(starts[:, 1]) < starts[1:, 3] + starts[:-1, 3]).all()
    assert (starts[:, 0] - starts[:, 3]).max() < (foot[:, 1, 0] + foot[:, 1, 3]).max()


def test_an_average_body_scales_and_is_symmetric():
    one, many = capsules_of(BODY), capsules_of(Body.of(PERSON.with_offsets(8.0 * PERSON.offsets)))
    np.testing.assert_allclose(many.ends, 8.0 * one.ends, atol=1e-9 * HEIGHT)
    np.testing.assert_allclose(many.radii, 8.0 * one.radii, rtol=1e-9)
    ends = in_world(one, PERSON)
    for name in SEGMENTS[:12:2]:
        left, right = (one.segments == SEGMENTS.index(name.replace("left", side)) for side in ("left", "right"))
        np.testing.assert_allclose(ends[left] * [-1, 1, 1], ends[right], atol=1e-9 * HEIGHT)
    long = PERSON.with_offsets(np.where([["Elbow" in n or "Wrist" in n] for n in PERSON.names], 2, 1) * PERSON.offsets)
    one, other = capsules_of(BODY), capsules_of(Body.of(long))
    np.testing.assert_allclose(one.radii, other.radii, rtol=1e-9)
    capsules = capsules_of(Body.of(taken(PERSON, np.flatnonzero(~PERSON.end_sites))))
    assert {SEGMENTS[each] for each in capsules.segments} == {*SEGMENTS} - {"belly"}
    assert np.isfinite(capsules.ends).all()


def test_an_average_body_does_not_depend_on_the_rest_pose():
    """The capsules are where they were, whatever pose the file calls its rest pose."""
    bent = posed(
        PERSON, {"LeftShoulder": np.array([0.0, 0.0, -1.2]), "RightShoulder": np.array([0, 0, 1.2])}, np.zeros((1, 3))
    )
    lowered = PERSON.with_offsets(
        Rotation.from_quat(bent.world_rotations[0, PERSON.parents]).apply(np.array(PERSON.offsets))
    )
    one, other = capsules_of(BODY), capsules_of(Body.of(lowered))
    np.testing.assert_allclose(one.radii, other.radii, rtol=1e-3)
    ends = in_world(other, lowered)
    arm = other.segments == SEGMENTS.index("left forearm")
    elbow, wrist = (lowered.rest_positions[BODY.anatomy.roles[f"left{role}"]] for role in ("LowerArm", "Hand"))
    np.testing.assert_allclose(ends[arm, 1] - ends[arm, 0], [wrist - elbow], atol=0.01 * HEIGHT)


def test_radii_of_a_skeleton_file_are_read_and_written():
    joints = [
        {"name": "Hips", "parent": None, "offset": [0, 0, 0], "radius": 12},
        {"name": "Spine", "parent": "Hips", "offset": [0, 20, 0]},
    ]
    document = {"format": "distretarget-skeleton", "version": 1, "joints": joints}
    target = parse_target(file_of(json.dumps(document), "given.json"))
    assert target.radii == {0: 12.0}
    again = parse_target(file_of(skeleton_to_json(target.skeleton, "", radii=target.radii), "given.json"))
    assert again.radii == target.radii


@pytest.mark.parametrize(("joint", "says"), [({"radius": 0}, "above 0"), ({"radius": 1, "end": True}, "moves no part")])
def test_radii_without_a_meaning_are_errors(joint, says):
    joints = [
        {"name": "Hips", "parent": None, "offset": [0, 0, 0]},
        {"name": "B", "parent": "Hips", "offset": [0, 1, 0]},
    ]
    document = {"format": "distretarget-skeleton", "version": 1, "joints": [joints[0], joints[1] | joint]}
    with pytest.raises(SkeletonFileError, match=says):
        parse_target(file_of(json.dumps(document), "given.json"))


def test_an_exported_character_is_as_thick_as_its_mesh():
    target = sample_target("hero")
    radii = radii_of(capsules_of(HERO_BODY, target.mesh()))
    bare = capsules_of(HERO_BODY, radii=radii)
    for joint, radius in radii_of(bare).items():
        assert radius == pytest.approx(radii.get(joint, radius))


def test_a_body_has_its_own_build(mesh):
    capsules = capsules_of(BODY, mesh)
    again = Build.of(BODY, capsules).on(BODY)
    assert again.radii.sum() == pytest.approx(capsules.radii.sum())
    np.testing.assert_allclose(
        np.sort(in_world(again, PERSON).reshape(-1, 3), 0),
        np.sort(in_world(capsules, PERSON).reshape(-1, 3), 0),
        atol=1e-9,
    )


def test_a_build_fits_a_body_of_another_size(dressed):
    mesh, radii = dressed
    large = Body.of(PERSON.with_offsets(3.0 * PERSON.offsets))
    worn = Build.of(BODY, capsules_of(BODY, mesh)).on(large)
    (shin,) = np.flatnonzero(worn.segments == SEGMENTS.index("left shin"))
    np.testing.assert_allclose(worn.radii[shin], 3.0 * radii["left shin"], atol=0.02 * HEIGHT)
