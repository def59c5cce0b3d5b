"""Supports: what rests in the source stays at rest, at its height and on its skin, on bodies of any proportions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import HERO, PERSON, SAMPLES, UP, lengthened, posed
from capsule_bodies import capsule_surface, mesh_of
from sample_supports import FLOOR, SUPPORTED, WORLD
from scipy.spatial.transform import Rotation

from distretarget import Motion, Options, load_target, read_bvh, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.body import Body
from distretarget.matching.undersides import Underside, Undersides
from distretarget.objectives.clip import Clip
from distretarget.objectives.resting_joints import within_reach
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.target import Target

H = {"Chest": 0.8, "Chest2": 0.8, "Chest3": 0.8, "Elbow": 0.75, "Wrist": 0.75, "Knee": 1.15, "Ankle": 1.15}
FEET = ("Ankle", "Toe", "Toe_End")
ELSEWHERE = (*FEET, "Hips")  # feet have tests of their own, and a seat rests on the hip joints
ENDS_LATER = 0.35  # a joint that sets off slowly may rest so much longer than it stands still [s]
BODY_MOVES = 5.0  # a body that moves less than this shows no hold [cm]
STANDING = sorted(path.stem for path in SAMPLES.glob("*.bvh") if path.stem not in SUPPORTED)

samples = pytest.mark.parametrize("name", SUPPORTED)
targets = pytest.mark.parametrize("body", ["child", "H"])


@cache
def source(name):
    return read_bvh(SAMPLES / "supports" / f"{name}.bvh" if name in SUPPORTED else SAMPLES / f"{name}.bvh")


def target(body):
    if body == "H":
        return lengthened(source("walk").rigid_skeleton, H)
    return load_target(SAMPLES / f"{body}.json").for_source(source("walk").rigid_skeleton).skeleton


@cache
def on(name, body, supports="hold"):
    return retarget(source(name), target(body), Options(supports=supports))


def known(name, kinds):
    """Frames and joints of the known supports of these kinds, but for the feet's."""
    return [each for each in SUPPORTED[name]().supports if each.kind in kinds and not each.joint.endswith(ELSEWHERE)]


def test_hands_without_arms_that_rest_at_their_shoulders_stay_there():
    result = retarget(source("sit"), lengthened(source("sit").rigid_skeleton, {"Elbow": 0.0, "Wrist": 0.0}))
    clip, supports = Clip.of(result.matching, RootScale.even(1.0)), result.supports
    hands, places = supports.joints[supports.feet :], supports.places.copy()
    places[:, supports.feet :] = clip.copy_on_path(hands)
    seated = replace(supports, places=places, weights=np.ones_like(supports.weights))
    np.testing.assert_allclose(within_reach(clip, seated).places, places, atol=1e-6)


@samples
def test_the_known_supports_are_found_and_no_others(name):
    held, keys = on(name, "child").supports, source(name).skeleton.keys
    rests = dict(zip([keys[joint] for joint in held.joints], (held.weights > 0.99).T, strict=True))
    later = round(ENDS_LATER / source(name).frame_time)
    before = np.arange(len(source(name))) < later  # a joint may have rested before the clip begins
    near = {key: before.copy() for key in rests}
    for support in known(name, ("floor", "world")):
        if support.joint in near:
            near[support.joint][max(support.first - later, 0) : support.last + 1 + later] = True
        shoulders = source(name).positions[support.first : support.last + 1, keys.index("Neck")]
        if support.kind == WORLD and np.ptp(shoulders, axis=0).max() < BODY_MOVES:
            continue  # nothing shows that the hand holds on to something
        assert rests[support.joint][support.first : support.last + 1].all(), support
    for key, frames in rests.items():
        if not key.endswith(FEET):
            assert not (frames & ~near[key]).any(), key


@samples
@targets
def test_what_rests_does_not_slide(name, body):
    motion = on(name, body).motion
    leg = on(name, body).matching.leg_lengths[1]
    for support in known(name, ("floor", "world")):
        places = motion.positions[support.first : support.last + 1, motion.skeleton.index(support.joint)]
        assert np.ptp(places, axis=0).max() < 0.01 * leg, support


@samples
@targets
def test_what_rests_on_the_floor_is_as_high_as_in_the_source(name, body):
    result = on(name, body)
    for support in known(name, (FLOOR,)):
        frames, joint = slice(support.first, support.last + 1), result.motion.skeleton.index(support.joint)
        heights, expected = (motion.positions[frames, joint, 1] for motion in (result.motion, result.source))
        assert np.abs(heights - result.root_scale * expected).max() < 0.015 * result.matching.leg_lengths[1], support


@samples
@targets
def test_nothing_goes_under_the_floor(name, body):
    result = on(name, body)
    heights = result.motion.positions[..., 1] - result.root_scale * result.source.positions[..., 1].min()
    assert heights.min() > -0.015 * result.matching.leg_lengths[1]


@samples
@pytest.mark.parametrize("rig", ["mixamo_t", "unreal_t"])
def test_fingers_that_nothing_drives_do_not_go_under_the_floor(name, rig):
    result = retarget(source(name), load_target(SAMPLES / "rigs" / f"{rig}.json"))
    matching, regions = result.matching, result.matching.regions
    hands = [regions.names.index(f"{side} hand") for side in ("left", "right")]
    fingers = np.flatnonzero(np.isin(regions.of_joint, hands) & (matching.drivers < 0))
    up = matching.source.up_vector
    floor = result.root_scale * (result.source.positions @ up).min()
    assert len(fingers) > 30
    assert (result.motion.positions[:, fingers] @ up).min() - floor > -0.02 * matching.leg_lengths[1]


@pytest.mark.parametrize("name", STANDING)
@targets
def test_where_nothing_rests_but_feet_the_result_is_that_of_feet_alone(name, body):
    both = (on(name, body, supports).motion for supports in ("hold", "feet"))
    one, other = (motion.rotations.tobytes() + motion.translations.tobytes() for motion in both)
    assert one == other


@samples
def test_on_the_same_body_the_clip_stays_as_it_is(name):
    result = retarget(source(name), source(name))
    size = result.matching.target.height
    np.testing.assert_allclose(result.motion.positions, source(name).positions, atol=1e-3 * size)


def test_in_a_scaled_environment_a_hand_on_a_wall_has_the_scaled_place_of_the_sources():
    """The wall is there on the target's side too, in its scale; else the hand rests where the body has it."""
    for environment in ("scaled", "body"):
        result = retarget(source("hand_on_wall"), target("H"), Options(environment=environment))
        held, joint = result.supports, result.motion.skeleton.index("RightWrist")
        column = held.joints.tolist().index(joint)
        rests = held.weights[:, column] > 0.99
        expected = result.root_scale * result.source.positions[rests][:, result.matching.drivers[joint]]
        off = np.linalg.norm(held.places[rests, column] - expected, axis=1).max()
        assert rests.sum() > 100
        assert off < 1e-9 if environment == "scaled" else off > 5.0


def test_free_supports_and_those_of_feet_alone_hold_less():
    joints = {supports: len(on("push_up", "child", supports).supports.joints) for supports in ("hold", "feet", "free")}
    assert joints["hold"] > joints["feet"] == 4
    assert joints["free"] == 0


@pytest.mark.parametrize("arms", [0.2, 0.5])
def test_a_body_whose_arms_are_too_short_for_the_floor_sits_upright(arms):
    found = retarget(source("sit"), lengthened(source("walk").rigid_skeleton, {"Elbow": arms, "Wrist": arms}))
    sits = found.supports.weights[:, found.supports.feet :].min(axis=1) > 0.99
    chest = found.motion.skeleton.names.index("Chest")
    copied, result = (
        Rotation.from_quat(motion.world_rotations_of(chest)[sits]) for motion in (found.rotation_copy, found.motion)
    )
    assert sits.sum() > 50
    assert np.degrees((result * copied.inv()).magnitude()).max() < 25


BODY = Body.of(PERSON)
KNEES = np.array([BODY.anatomy.roles[f"{side}LowerLeg"] for side in ("left", "right")])
SHINS = np.array([SEGMENTS.index(f"{side} shin") for side in ("left", "right")])
RADII = np.array([0.05, 0.08])
"""Of the left and the right knee [m]."""


def knees():
    """Balls about the knees: as a mesh, and as capsules."""
    tiny = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0]])
    surfaces = [
        (joint, capsule_surface(PERSON.rest_positions[joint] + tiny, [radius] * 2, 41, 40))
        for joint, radius in zip(KNEES, RADII, strict=True)
    ]
    return mesh_of(surfaces), Capsules(KNEES, np.zeros((2, 2, 3)), np.array([RADII, RADII]).T, SHINS)


@pytest.mark.parametrize("meshed", [True, False])
def test_a_ball_about_a_knee_reaches_its_radius_below_it_however_the_knee_is_turned(meshed):
    mesh, capsules = knees()
    underside = Underside(BODY, capsules, mesh if meshed else None)
    turns = {"Hips": np.outer(np.linspace(0, 3, 7), [1.0, 0.5, 0.2]), "LeftKnee": np.array([1.2, 0.3, 0.0])}
    below = underside.below(posed(PERSON, turns, np.zeros((7, 3))), KNEES, UP)
    np.testing.assert_allclose(below, np.broadcast_to(RADII, (7, 2)), rtol=0.06 if meshed else 1e-9)


def test_skin_that_several_joints_move_is_where_linear_blend_skinning_puts_it():
    mesh, capsules = knees()
    joints = np.column_stack([mesh.joints, PERSON.parents[mesh.joints]])
    mesh = type(mesh)(mesh.vertices, joints, np.full(joints.shape, 0.5), mesh.triangles)
    motion = posed(PERSON, {"LeftKnee": np.array([1.2, 0.3, 0.0])}, np.zeros((1, 3)))
    own = np.flatnonzero(mesh.joints[:, 0] == KNEES[0])
    found = motion.positions[0, KNEES[0]] @ UP - (mesh.posed(motion, own) @ UP).min()
    below = Underside(BODY, capsules, mesh).below(motion, KNEES[:1], UP)
    np.testing.assert_allclose(below, found, rtol=0.06)


def test_the_lowest_vertex_of_a_foot_is_the_lowest_of_all_however_foot_and_toes_are_turned():
    rng = np.random.default_rng(0)
    ankle = BODY.anatomy.roles["leftFoot"]
    joints = PERSON.subtree(ankle)
    mesh = mesh_of(
        [
            (joint, capsule_surface(PERSON.rest_positions[joint] + 0.1 * rng.normal(size=(2, 3)), [0.03, 0.05], 9, 8))
            for joint in joints
        ]
    )
    underside = Underside(BODY, knees()[1], mesh)
    motion = posed(PERSON, {PERSON.names[joint]: rng.normal(size=(20, 3)) for joint in joints}, np.zeros((20, 3)))
    lowest = (mesh.posed(motion) @ UP).min(axis=1)
    np.testing.assert_allclose(underside.lowest_of_foot(motion, ankle, UP), lowest, atol=1e-6)
    assert len(underside.foot(ankle)) < len(mesh.vertices)


def test_a_joint_without_skin_has_none_below():
    elbow = np.array([BODY.anatomy.roles["leftLowerArm"]])
    motion = Motion(PERSON, np.zeros((1, 3)), PERSON.rest_rotations[None], "0.02")
    assert Underside(BODY, *knees()[::-1]).below(motion, elbow, UP) == 0.0


def test_a_scabbard_that_hangs_from_the_hips_carries_nothing():
    hips, down = PERSON.index("Hips"), np.array([[0.0, 0.0, 0.0], [0.0, -0.8, 0.0]])
    radii, segments = np.array([[0.12, 0.12]]), np.array([SEGMENTS.index("pelvis")])
    capsules = Capsules(np.array([hips]), np.zeros((1, 2, 3)), radii, segments)
    skin = hips, capsule_surface(PERSON.rest_positions[hips] + 1e-9 * down, [0.12, 0.12], 41, 40)
    scabbard = hips, capsule_surface(PERSON.rest_positions[hips] + down, [0.02, 0.02], 9, 8)
    motion = Motion(PERSON, np.zeros((1, 3)), PERSON.rest_rotations[None], "0.02")
    for mesh in (mesh_of([skin]), mesh_of([skin, scabbard])):
        below = Underside(BODY, capsules, mesh).below(motion, np.array([hips]), UP)
        np.testing.assert_allclose(below, 0.12, rtol=0.06)


# ---- in a run


def lowest_knee(thigh, shin):
    """(frames,), the height of the lowest skin of the right knee over that of the feet's joints [legs], and how high
    the knee is, while the child kneels on it with legs of these radii [cm].
    """
    child = load_target(SAMPLES / "child.json").skeleton
    roles = Body.of(child).anatomy.roles
    parts = {"UpperLeg": thigh, "LowerLeg": shin}
    radii = {roles[side + part]: radius for side in ("left", "right") for part, radius in parts.items()}
    result = retarget(read_bvh(SAMPLES / "supports" / "kneel.bvh")[::4], Target(child, {}, "child", radii=radii))
    knee, supports = roles["rightLowerLeg"], result.supports
    on = supports.weights[:, supports.joints.tolist().index(knee)] >= 0.99
    below = Undersides.of(result.matching, (result.skins.source.capsules, result.skins.target.capsules), None)
    height = result.motion.positions[on, knee] @ UP
    skin = height - below.target.below(result.motion, np.array([knee]), UP)[on, 0]
    return (skin + below.soles[1]) / Body.of(child).leg_length, height / Body.of(child).leg_length


def test_without_skin_nothing_changes():
    child, source = load_target(SAMPLES / "child.json"), read_bvh(SAMPLES / "supports" / "kneel.bvh")[::8]
    thick = Target(child.skeleton, {}, "child", radii={1: 20.0})
    with_none, of_stick = retarget(source, thick, Options(skin="none")), retarget(source, child)
    np.testing.assert_array_equal(with_none.motion.rotations, of_stick.motion.rotations)
    np.testing.assert_array_equal(with_none.motion.translations, of_stick.motion.translations)
    thin, normal, thick = (lowest_knee(*radii) for radii in ((3.0, 2.0), (7.0, 5.0), (14.0, 11.0)))
    assert thin[1].mean() < normal[1].mean() - 0.005
    assert normal[1].mean() < thick[1].mean() - 0.02
    for skin, _ in (thin, normal, thick):
        assert -0.02 < skin.mean() < 0.04


def test_the_height_of_a_support_is_right_up_to_where_its_skin_is_as_high():
    source = read_bvh(SAMPLES / "supports" / "kneel.bvh")[::8]
    child = load_target(SAMPLES / "child.json").skeleton
    knee = Body.of(child).anatomy.roles["rightLowerLeg"]
    result = retarget(source, Target(child, {}, "child", radii={knee: 11.0}))
    assert result.metrics["result"]["support_height"] < 1
    baseline = replace(result.baseline, match=replace(result.baseline.match, skins=None))
    assert replace(result, baseline=baseline).metrics["result"]["support_height"] > 2


@pytest.mark.parametrize("side", [-90, 90])
def test_a_body_that_lies_on_an_elbow_lies_on_the_floor_while_its_feet_are_in_the_air(side):
    clip, turn = read_bvh(SAMPLES / "hands_on_hips.bvh")[::6], Rotation.from_euler("z", side, degrees=True)
    rotations = np.array(clip.rotations)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    lying = replace(clip, rotations=rotations, root_positions=turn.apply(np.array(clip.root_positions)))
    down = np.median(lying.positions[..., 1].min(axis=1)) - 3.0
    result = retarget(replace(lying, root_positions=lying.root_positions - down * UP), load_target(HERO))
    lowest = result.mesh.posed(result.motion)[..., 1].min(axis=1)
    assert np.median(np.abs(lowest)) < 0.02 * result.matching.target.height
