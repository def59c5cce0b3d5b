"""How far hands and forearms sink in, and the gaps of contacts: known answers on bodies whose skin is made of balls."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, sample, sample_target
from capsule_bodies import capsule_surface, mesh_of
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from distretarget import Motion, retarget
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.measure import skin_touches
from distretarget.measure.skin import SkinPoints, find_skin, one_by_one, points_of_mesh
from distretarget.measure.skin_depths import PARTS, find_depths
from distretarget.measure.skin_touches import FARTHEST, TOUCHING, VISIBLE, find_source_skin
from distretarget.measure.solids import solids_of_mesh
from distretarget.numerics.vectors import normalised
from distretarget.skin.capsules import SEGMENTS, Capsules, no_capsules
from distretarget.skin.mesh import SkinnedMesh

BODY = Body.of(PERSON)
BELLY, HAND = 0.22, 0.05  # radii [m]
ROLES = BODY.anatomy.roles
HANDS = [ROLES["leftHand"], ROLES["rightHand"]]
BENDS = np.arange(0, 105, 5.0)  # of the elbow [degrees]
UPRIGHT = Rotation.identity()
REST = Motion(PERSON, PERSON.rest_positions[:1], PERSON.rest_rotations[None], "0.0333333")


def bending(body=PERSON, world=UPRIGHT, forwards=0.0):
    """The left elbow bends until the hand is at the hips, or in them; `world` turns all, and an angle [degrees] the arm
    forwards, about the line from shoulder to hips.
    """
    rotations = np.tile(body.rest_rotations, (len(BENDS), 1, 1))
    line = normalised(body.rest_positions[ROLES["leftUpperArm"]] - body.rest_positions[ROLES["hips"]])
    turn = Rotation.from_rotvec(np.radians(-forwards) * line)
    upper = turn * Rotation.from_euler("Z", -60, degrees=True)
    rotations[:, ROLES["leftUpperArm"]] = upper.as_quat()
    rotations[:, ROLES["leftLowerArm"]] = Rotation.from_euler("Z", -BENDS[:, None], degrees=True).as_quat()
    rotations[:, 0] = world.as_quat()
    return Motion(body, np.tile(body.rest_positions[0], (len(rotations), 1)), rotations, "0.0333333")


def round_body(scale=1.0, rings=24):
    """The mesh of a ball around the hips and a ball around each hand, and the same as capsules."""
    joints, radii = [ROLES["hips"], *HANDS], [BELLY, HAND, HAND]
    rest, tiny = scale * PERSON.rest_positions, scale * np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0]])
    surfaces = [
        (joint, capsule_surface(rest[joint] + tiny, np.array([radius, radius]) * scale, rings, rings))
        for joint, radius in zip(joints, radii, strict=True)
    ]
    segments = [SEGMENTS.index(name) for name in ("pelvis", "left hand", "right hand")]
    radii = scale * np.array([radii, radii]).T
    return mesh_of(surfaces), Capsules(np.array(joints), np.zeros((3, 2, 3)), radii, np.array(segments))


def known_depths(motion):
    """(frames,), how deep the left hand's ball is inside the one of the hips; negative off it."""
    places = motion.positions
    return BELLY + HAND - np.linalg.norm(places[:, HANDS[0]] - places[:, ROLES["hips"]], axis=1)


def measured(skin, result, source_skin=None, source=None):
    reference = find_source_skin(source or result, BODY, source_skin or skin, skin)
    return reference.in_result(result)


@pytest.mark.parametrize("meshed", [False, True])
def test_a_hand_in_the_belly_is_as_deep_as_known(meshed):
    mesh, capsules = round_body()
    motion = bending()
    found = measured(find_skin(BODY, capsules, mesh if meshed else None), motion)
    known = 100 / BODY.height * np.maximum(known_depths(motion), 0.0)
    assert known.max() > 3
    np.testing.assert_allclose(found["skin_depth"].values[:, 0], known, atol=0.3)
    np.testing.assert_array_equal(found["skin_depth"].values[:, 1:], 0)
    np.testing.assert_array_equal(found["skin_frames"].values[known == 0], 0)
    assert (found["skin_frames"].values[known > 0.5] > 0).all()


@pytest.mark.parametrize("visible", [1.0, 5.0, 10.0, 20.0])
def test_frames_with_skin_inside_are_those_with_more_than_a_share_of_the_vertices_inside(visible, monkeypatch):
    monkeypatch.setattr(skin_touches, "VISIBLE", visible)
    mesh, _ = round_body()
    skin, motion = find_skin(BODY, no_capsules(), mesh), bending()
    left = mesh.joints[:, 0] == HANDS[0]
    away = mesh.posed(motion, np.flatnonzero(left)) - motion.positions[:, None, ROLES["hips"]]
    share = 50 * (np.linalg.norm(away, axis=2) < BELLY).mean(axis=1)  # the other half is the right hand's
    assert share.max() > visible + 2.5
    found = measured(skin, motion)["skin_frames"].values
    np.testing.assert_array_equal(found[share > visible + 2.5], 100)
    np.testing.assert_array_equal(found[share < visible - 2.5], 0)
    np.testing.assert_array_equal(found[share == 0], 0)


@pytest.mark.parametrize(("depth", "inside"), [(0.06, False), (1.0, True)])
def test_a_hand_that_lies_on_the_skin_is_not_inside(depth, inside):
    motion, (_, capsules) = bending(), round_body()
    depths = 100 / BODY.height * known_depths(motion)
    at = int(np.flatnonzero(depths > 1)[0])
    capsules.radii[0] -= (depths[at] - depth) * BODY.height / 100  # the belly, so that the hand is as deep as wanted
    found = measured(find_skin(BODY, capsules), motion[at : at + 1])
    assert (found["skin_frames"].values[0] > 0) == inside


def test_nothing_is_inside_in_the_bind_pose_and_what_is_does_not_count():
    mesh, capsules = round_body()
    thick = replace(capsules, radii=np.array([[1.0, 1.0], [HAND, HAND], [HAND, HAND]]))
    for skin in (find_skin(BODY, capsules), find_skin(BODY, no_capsules(), mesh), find_skin(BODY, thick)):
        found = measured(skin, REST)
        assert found["skin_frames"].values.sum() == found["skin_depth"].values.sum() == 0


@pytest.mark.parametrize("turn", [UPRIGHT, Rotation.from_euler("XYZ", [20, 50, 170], degrees=True)])
def test_size_and_place_in_the_world_do_not_matter(turn):
    mesh, _ = round_body()
    large, _ = round_body(scale=64.0)
    skeleton = PERSON.with_offsets(64.0 * PERSON.offsets)
    one = measured(find_skin(BODY, no_capsules(), mesh), bending())
    other = measured(find_skin(Body.of(skeleton), no_capsules(), large), bending(skeleton, turn))
    np.testing.assert_allclose(other["skin_depth"].values, one["skin_depth"].values, atol=1e-6)
    np.testing.assert_allclose(other["skin_frames"].values, one["skin_frames"].values, atol=1e-6)


def test_another_mesh_of_the_same_body_measures_the_same():
    fine, coarse = (
        measured(find_skin(BODY, no_capsules(), round_body(rings=rings)[0]), bending()) for rings in (40, 16)
    )
    np.testing.assert_allclose(fine["skin_depth"].values, coarse["skin_depth"].values, atol=0.4)
    np.testing.assert_allclose(fine["skin_frames"].values, coarse["skin_frames"].values, atol=5)


def depths_in(mesh, places, motion):
    """(places, segments), how deep places are inside each segment of a mesh in the first frame of a motion."""
    offsets = (places - motion.positions[0, 0])[:, None]  # of the root, which is not turned
    ones, zeros = np.ones((len(places), 1)), np.zeros((len(places), 1), int)
    points = one_by_one(SkinPoints(zeros[:, 0], zeros, ones, offsets, np.zeros((0, 2), int)))
    solids = solids_of_mesh(mesh, PERSON, find_segments(BODY).of_joint)
    posed = motion.positions[:1], motion.world_rotations[:1]
    return find_depths(points, solids, posed, np.full((1, 1, 1), np.inf))[0][0]


def test_the_deepest_of_all_vertices_is_found_although_few_are_looked_at_first():
    mesh, motion = round_body(rings=60)[0], bending()
    skin, of_joint = find_skin(BODY, no_capsules(), mesh), find_segments(BODY).of_joint
    points = points_of_mesh(mesh, PERSON, of_joint)
    hand, pelvis = SEGMENTS.index("left hand"), SEGMENTS.index("pelvis")
    every = one_by_one(points[points.parts == hand])
    assert 5 * skin.patches.counts.size < len(points)
    posed = motion.positions, motion.world_rotations
    reach = np.where(np.arange(len(SEGMENTS)) == pelvis, 0.1, -np.inf)[None, None]
    found = find_depths(skin.patches, skin.solids, posed, np.tile(reach, (1, len(PARTS), 1)))[0][:, hand, pelvis]
    each = find_depths(every, skin.solids, posed, np.tile(reach, (1, len(every.counts), 1)))[0][:, :, pelvis]
    known = each.max(axis=1)
    assert known.max() > 0.05
    np.testing.assert_allclose(found[known > 0.0], known[known > 0.0], atol=1e-9)


@pytest.mark.parametrize("inside_out", [False, True])
def test_depths_in_a_mesh_are_known_whichever_way_triangles_face(inside_out):
    mesh, _ = round_body(rings=48)
    if inside_out:
        mesh = replace(mesh, triangles=mesh.triangles[:, ::-1])
    away = normalised(np.random.default_rng(0).normal(size=(200, 3))) * np.linspace(0.02, 0.3, 200)[:, None]
    found = depths_in(mesh, PERSON.rest_positions[ROLES["hips"]] + away, REST)[:, SEGMENTS.index("pelvis")]
    np.testing.assert_allclose(found, BELLY - np.linalg.norm(away, axis=1), atol=0.003)


def test_skin_that_two_joints_move_is_as_deep_as_its_posed_surface_says():
    low, high = ROLES["hips"], ROLES["chest"]
    rest = PERSON.rest_positions
    rings, around = 60, 48
    turns = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    heights = np.linspace(rest[low, 1] - 0.2, rest[high, 1] + 0.3, rings)
    circle = 0.12 * np.stack([np.cos(turns), 0.0 * turns, np.sin(turns)], axis=1)
    vertices = (circle + heights[:, None, None] * [0.0, 1.0, 0.0]).reshape(-1, 3)  # a tube that is open at both ends
    a = np.arange((rings - 1) * around).reshape(-1, around)
    b = np.roll(a, -1, axis=1)
    triangles = np.stack([a, a + around, b, b, a + around, b + around], axis=-1).reshape(-1, 3)
    share = np.clip((vertices[:, 1] - rest[low, 1]) / (rest[high, 1] - rest[low, 1]), 0.0, 1.0)
    joints = np.tile([low, high], (len(vertices), 1))
    mesh = SkinnedMesh(vertices, joints, np.column_stack([1.0 - share, share]), triangles)
    rotations = PERSON.rest_rotations[None].copy()
    rotations[0, high] = Rotation.from_euler("X", 40, degrees=True).as_quat()
    bent = Motion(PERSON, rest[:1], rotations, "0.0333333")
    posed = mesh.posed(bent)[0]
    inner = replace(mesh, vertices=vertices * [0.6, 1.0, 0.6])
    places = inner.posed(bent)[0][15 * around : -15 * around : 7]
    corners = posed[mesh.triangles]
    known = KDTree(np.concatenate([corners.mean(axis=1), *corners.transpose(1, 0, 2)])).query(places)[0]
    np.testing.assert_allclose(depths_in(mesh, places, bent).max(axis=1), known, atol=0.008)


def test_loose_points_and_open_sheets_have_no_inside():
    mesh, _ = round_body()
    corners = np.array([[0.0, 1.6, 0.0], [0.3, 1.6, 0.0], [0.0, 1.6, 0.3], [9.0, 9.0, 9.0]])
    more = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, corners]),
        joints=np.concatenate([mesh.joints, np.full((4, 1), ROLES["hips"])]),
        weights=np.concatenate([mesh.weights, np.ones((4, 1))]),
        triangles=np.concatenate([mesh.triangles, len(mesh.vertices) + np.array([[0, 1, 2]])]),
    )
    places = np.array([[0.05, 1.6 + off, 0.05] for off in (-0.02, -0.001, 0.001, 0.02)])
    assert (depths_in(more, places, REST) <= 0.0).all()


def test_a_body_without_skin_has_no_metrics():
    found = measured(find_skin(BODY, no_capsules()), bending())
    assert found["skin_frames"].values.size == found["skin_depth"].values.size == found["skin_gap"].values.size == 0


# ---- contacts


def still(motion, frame, frames):
    return motion[np.full(frames, frame)]


def test_the_gap_of_a_contact_is_kept_or_not():
    skin, motion = find_skin(BODY, round_body()[1]), bending()
    gaps = -100 / BODY.height * known_depths(motion)
    touch = int(np.flatnonzero(gaps < 0)[0])
    found = measured(skin, motion, source=still(motion, touch, len(motion)))
    np.testing.assert_array_equal(found["touch_missed"].counts, np.tile([1, 0, 0, 0], (len(motion), 1)))
    np.testing.assert_allclose(
        found["skin_gap"].values[:, 0], np.maximum(np.minimum(gaps, FARTHEST), gaps[touch] - gaps), atol=0.4
    )
    assert found["skin_gap"].values[touch, 0] == 0


def test_gaps_are_in_proportion_to_the_bodies():
    skin, motion = find_skin(BODY, round_body()[1]), bending()
    skeleton = PERSON.with_offsets(3.0 * PERSON.offsets)
    large = find_skin(Body.of(skeleton), round_body(scale=3.0)[1])
    found = find_source_skin(motion, BODY, skin, large).in_result(bending(skeleton))
    assert found["touch_missed"].counts.any()
    np.testing.assert_allclose(found["skin_gap"].values, 0, atol=1e-9)


def test_a_hanging_arm_touches_nothing():
    _, capsules = round_body()
    wide = replace(capsules, radii=np.array([[0.25, 0.25], [HAND, HAND], [HAND, HAND]]))
    skin = find_skin(BODY, wide)
    rotations = np.tile(PERSON.rest_rotations, (1, 1, 1))
    rotations[0, ROLES["leftUpperArm"]] = Rotation.from_euler("Z", -90, degrees=True).as_quat()
    hanging = Motion(PERSON, PERSON.rest_positions[:1], rotations, "0.0333333")
    assert measured(skin, hanging)["skin_depth"].values[0, 0] > 0
    assert not measured(skin, hanging)["touch_missed"].counts.any()


def arms_in_front(*bends):
    """Both arms reach forwards, a frame for each angle off the T-pose [degrees]; at 110 the hands are in each other."""
    rotations = np.tile(PERSON.rest_rotations, (len(bends), 1, 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turns = Rotation.from_euler("Y", -sign * np.array(bends)[:, None], degrees=True)
        rotations[:, ROLES[f"{side}UpperArm"]] = turns.as_quat()
    return Motion(PERSON, np.tile(PERSON.rest_positions[0], (len(bends), 1)), rotations, "0.0333333")


def test_two_hands_touch_each_other_once_each():
    _, capsules = round_body()
    clap = arms_in_front(110)
    found = measured(find_skin(BODY, capsules), clap)
    np.testing.assert_array_equal(found["touch_missed"].counts, [[1, 1, 0, 0]])
    apart = np.linalg.norm(clap.positions[0, HANDS[0]] - clap.positions[0, HANDS[1]])
    np.testing.assert_allclose(
        found["skin_depth"].values, 100 / BODY.height * np.array([[2 * HAND - apart] * 2 + [0, 0]]), atol=0.3
    )


def with_forearms(share):
    """The body of balls with one more on each forearm, at a share of the way from the elbow to the wrist."""
    _, capsules = round_body()
    elbows, wrists = [ROLES["leftLowerArm"], ROLES["rightLowerArm"]], PERSON.offsets[HANDS]
    return Capsules(
        np.append(capsules.joints, elbows),
        np.concatenate([capsules.ends, np.repeat(share * wrists[:, None], 2, axis=1)]),
        np.concatenate([capsules.radii, np.full((2, 2), HAND)]),
        np.append(capsules.segments, [SEGMENTS.index("left forearm"), SEGMENTS.index("right forearm")]),
    )


def test_hands_that_are_apart_are_off_by_their_gap_whatever_else_the_arms_have():
    clap, apart = arms_in_front(110), arms_in_front(100)
    found = measured(find_skin(BODY, with_forearms(0.2)), apart, source=clap)
    np.testing.assert_array_equal(found["touch_missed"].counts, [[1, 1, 0, 0]])
    gap = np.linalg.norm(apart.positions[0, HANDS[0]] - apart.positions[0, HANDS[1]]) - 2 * HAND
    assert gap > 0.1
    np.testing.assert_allclose(
        found["skin_gap"].values[0, :2], np.minimum(100 / BODY.height * gap, FARTHEST), rtol=0.05
    )
    clap = arms_in_front(110)
    source_skin, skin = find_skin(BODY, with_forearms(1.0)), find_skin(BODY, with_forearms(0.2))
    found = measured(skin, clap, source_skin, clap)
    np.testing.assert_array_equal(found["touch_missed"].counts, [[1, 1, 1, 1]])
    np.testing.assert_allclose(found["skin_gap"].values, 0, atol=0.3)


def swinging(*bends):
    """The left elbow bends by each of these angles [degrees]; at about 80 the hand is in the belly."""
    motion = bending()
    rotations = np.repeat(motion.rotations[:1], len(bends), axis=0)
    rotations[:, ROLES["leftLowerArm"]] = Rotation.from_euler("Z", -np.array(bends)[:, None], degrees=True).as_quat()
    return Motion(PERSON, np.repeat(motion.root_positions[:1], len(bends), axis=0), rotations, motion.frame_time_text)


def thinner(capsules, by):
    """The body of balls with a smaller belly [% of height]."""
    radii = capsules.radii.copy()
    radii[0] -= by * BODY.height / 100
    return replace(capsules, radii=radii)


def test_a_touch_holds_while_its_gap_is_as_far_off_as_a_touch_may_be():
    """The source's hand comes within 0.8 % of the belly; that of the result is farther off by 0.7 %, which is still a
    touch, in the same frames.
    """
    _, capsules = round_body()
    motion = swinging(*np.arange(0, 60, 2.0), *np.arange(60, 0, -2.0))
    nearest = -100 / BODY.height * known_depths(motion).max()
    source_skin = find_skin(BODY, thinner(capsules, 0.8 - nearest))
    skin = find_skin(BODY, thinner(capsules, 1.5 - nearest))
    found = measured(skin, motion, source_skin, motion)
    assert 0 < found["touch_missed"].counts[:, 0].sum() < len(motion)
    np.testing.assert_allclose(found["skin_gap"].values[found["touch_missed"].counts > 0], 0.7, atol=0.05)


# ---- in a run


def without(run, what):
    """A run that is measured without its mesh, or without skins."""
    return replace(run, baseline=replace(run.baseline, match=replace(run.baseline.match, **{what: None})))


def test_a_run_onto_a_character_has_the_metrics_of_skin():
    target = sample_target("hero")
    run = retarget(sample("hands_on_hips")[60:200], target)
    copied, result = run.metrics["rotation_copy"], run.metrics["result"]
    assert copied["skin_depth"] > 1
    assert copied["skin_frames"] > 50
    assert result["skin_depth"] < 1.5
    assert result["skin_gap"] < 2
    assert "stays outside" in run.verdict or "sinks up to" in run.verdict
    assert without(run, "mesh").metrics["result"]["skin_depth"] < 1.5  # by the capsules
    assert without(run, "skins").metrics["result"]["skin_depth"] is None


# ---- against winding numbers


def test_winding_numbers_of_the_mesh_agree():
    igl = pytest.importorskip("igl")
    mesh, _ = round_body()
    skin, motion = find_skin(BODY, no_capsules(), mesh), bending()
    of_hips = mesh.triangles[(mesh.joints[mesh.triangles[:, 0], 0] == ROLES["hips"])]
    hands = np.flatnonzero(mesh.joints[:, 0] != ROLES["hips"])
    posed = mesh.posed(motion)
    share = np.array([100 * (igl.winding_number(each, of_hips, each[hands]) > 0.5).mean() for each in posed])
    found = measured(skin, motion)["skin_frames"].values
    np.testing.assert_array_equal(found[share > VISIBLE + 2.5], 100)
    np.testing.assert_array_equal(found[share == 0], 0)


def test_frames_between_those_that_are_measured_hold_the_last():
    """At 240 frames a second one in eight is measured, and all between two in which not the same parts touch."""
    skin, slow = find_skin(BODY, round_body()[1]), bending()
    frames = np.repeat(np.arange(len(slow)), 12)
    fast = Motion(PERSON, slow.root_positions[frames], slow.rotations[frames], "0.00416667")
    reference = find_source_skin(fast, BODY, skin, skin)
    every = replace(
        reference,
        sampled=np.arange(len(fast)),
        touches=np.vstack([reference.sampled[reference.touches[0]], reference.touches[1:]]),
    )
    some, all_of_them = reference.in_result(fast), every.in_result(fast)
    assert len(reference.sampled) < 0.5 * len(fast)
    np.testing.assert_array_equal(
        some["skin_depth"].values[reference.sampled], all_of_them["skin_depth"].values[reference.sampled]
    )
    last = np.searchsorted(reference.sampled, np.arange(len(fast)), side="right") - 1
    np.testing.assert_array_equal(some["skin_depth"].values, all_of_them["skin_depth"].values[reference.sampled[last]])
    touching = known_depths(fast) > -TOUCHING / 100.0 * BODY.height
    edges = np.flatnonzero(np.diff(touching)) + 1
    assert len(edges)
    assert np.isin(edges, reference.sampled).all()


# ---- other parts


def test_an_upper_arm_in_the_trunk_is_as_deep_as_known_and_its_top_does_not_count():
    """A ball near the elbow, and one at the shoulder, which folds, against a ball around the chest."""
    chest, arm, elbow = ROLES["chest"], ROLES["leftUpperArm"], PERSON.offsets[ROLES["leftLowerArm"]]
    rest = PERSON.rest_positions
    radius = float(np.linalg.norm(rest[arm] - rest[chest])) - 0.02
    capsules = Capsules(
        np.array([chest, arm, arm]),
        np.array([np.zeros((2, 3)), np.tile(0.9 * elbow, (2, 1)), np.zeros((2, 3))]),
        np.array([[radius] * 2, [0.05] * 2, [0.01] * 2]),
        np.array([SEGMENTS.index(name) for name in ("chest", "left upper arm", "left upper arm")]),
    )
    rotations = np.tile(PERSON.rest_rotations, (20, 1, 1))
    rotations[:, arm] = Rotation.from_euler("Z", -np.linspace(0, 120, 20)[:, None], degrees=True).as_quat()
    motion = Motion(PERSON, np.tile(rest[0], (20, 1)), rotations, "0.0333333")
    places = rest[arm] + Rotation.from_quat(rotations[:, arm]).apply(0.9 * elbow)
    known = 100 / BODY.height * np.maximum(radius + 0.05 - np.linalg.norm(places - rest[chest], axis=1), 0.0)
    found = measured(find_skin(BODY, capsules), motion)
    assert known.max() > 3
    np.testing.assert_allclose(found["part_depth"].values[:, 0], known, atol=0.4)
    np.testing.assert_array_equal(found["skin_depth"].values, 0)


# ---- what need not be looked at


def two_balls(second, offset, radius):
    """A ball around the hips, another on a joint, and a ball around each hand: as capsules, and as a mesh."""
    mesh, capsules = round_body(rings=60)
    joint, centre = ROLES[second], PERSON.rest_positions[ROLES[second]] + offset
    tiny = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0]])
    more = mesh_of([(joint, capsule_surface(centre + tiny, np.array([radius, radius]), 60, 60))])
    both = SkinnedMesh(
        np.concatenate([mesh.vertices, more.vertices]),
        np.concatenate([mesh.joints, more.joints]),
        np.concatenate([mesh.weights, more.weights]),
        np.concatenate([mesh.triangles, more.triangles + len(mesh.vertices)]),
    )
    segment = SEGMENTS.index("left thigh" if second == "leftUpperLeg" else second)
    return both, Capsules(
        np.append(capsules.joints, joint),
        np.concatenate([capsules.ends, np.tile(offset, (1, 2, 1))]),
        np.concatenate([capsules.radii, np.full((1, 2), radius)]),
        np.append(capsules.segments, segment),
    )


def test_of_the_parts_of_a_place_the_nearest_is_found():
    skin, motion = find_skin(BODY, two_balls("leftUpperLeg", np.array([0.0, -0.3, 0.0]), 0.08)[1]), bending()
    posed = motion.positions, motion.world_rotations
    hand, pelvis, thigh = (SEGMENTS.index(name) for name in ("left hand", "pelvis", "left thigh"))
    shape = len(motion), len(PARTS), len(SEGMENTS)
    reach = np.full(shape, -np.inf)
    reach[:, hand, [pelvis, thigh]] = 1.0
    of_thigh = motion.positions[:, ROLES["leftUpperLeg"]] + [0.0, -0.3, 0.0]
    known = 0.08 + HAND - np.linalg.norm(motion.positions[:, HANDS[0]] - of_thigh, axis=1)
    together = find_depths(skin.patches, skin.solids, posed, reach)[0][:, hand]
    nearest = np.maximum(known, known_depths(motion))
    np.testing.assert_allclose(together[:, [pelvis, thigh]].max(axis=1), nearest, atol=0.005)


@pytest.mark.parametrize("meshed", [False, True])
def test_what_is_off_the_box_of_a_group_changes_nothing(meshed):
    mesh, capsules = two_balls("chest", np.zeros(3), 0.15)
    skin, motion = find_skin(BODY, capsules, mesh if meshed else None), bending()
    endless = skin.solids._replace(boxes=np.tile([-9.0, -9.0, -9.0, 9.0, 9.0, 9.0], (len(skin.solids.balls), 1)))
    without = measured(replace(skin, solids=endless), motion)
    found = measured(skin, motion)
    assert found["skin_depth"].values.max() > 3
    np.testing.assert_allclose(found["skin_depth"].values, without["skin_depth"].values, atol=1e-9)
    np.testing.assert_allclose(found["skin_gap"].values, without["skin_gap"].values, atol=1e-9)
    np.testing.assert_array_equal(found["skin_frames"].values, without["skin_frames"].values)


def test_a_point_inside_is_as_deep_as_the_nearest_skin_whichever_joint_moves_that():
    """The ball of a thigh swings into that of the hips: points in it are as deep as the skin of either is near."""
    mesh, _ = two_balls("leftUpperLeg", np.array([0.0, -0.3, 0.0]), 0.1)
    hips, thigh, turn = ROLES["hips"], ROLES["leftUpperLeg"], Rotation.from_euler("Z", -30, degrees=True)
    rotations = PERSON.rest_rotations[None].copy()
    rotations[0, thigh] = turn.as_quat()
    swung = Motion(PERSON, PERSON.rest_positions[:1], rotations, "0.0333333")
    centre, ball = PERSON.rest_positions[hips], PERSON.rest_positions[thigh] + turn.apply([0.0, -0.3, 0.0])
    places = ball + np.linspace(0.0, 0.09, 10)[:, None] * normalised(centre - ball)
    off_skin = [radius - np.linalg.norm(places - at, axis=1) for at, radius in ((ball, 0.1), (centre, BELLY))]
    np.testing.assert_allclose(depths_in(mesh, places, swung).max(axis=1), np.abs(off_skin).min(axis=0), atol=0.003)
