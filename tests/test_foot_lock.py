"""Foot lock: which feet rest, and where they belong on the target."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import (
    LEG,
    SIDES,
    UP,
    body_of,
    lengthened,
    matched,
    person,
    posed,
    sample,
    sample_target,
    taken,
    tree_of,
    with_feet,
)
from scipy.spatial.transform import Rotation

from distretarget import ContactSettings, Options, retarget
from distretarget.baseline.rotation_copy import SINK, RootScale, find_root_scale, rotation_copy
from distretarget.body.body import Body
from distretarget.body.resting import REST_SPEED
from distretarget.matching.matching import match
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.foot_lock import feet_within_reach, find_foot_lock, hips_rise
from distretarget.objectives.supports import no_supports
from distretarget.pipeline.performer import Performer, Transfer, match_performer


def pitched_feet(sine):
    """The person with toes below the ankles, by the sine of the flat foot's pitch."""
    return with_feet(np.arcsin(sine), 0.14)


def standing(body, frames=40, turns=None, path=None):
    path = np.zeros((frames, 3)) if path is None else path
    return posed(body, turns or {}, path + (LEG + 0.1) * UP)


def stance_of(source, target, scale=1.0, up="Y"):
    matching = match(body_of(source).with_up(up), body_of(target))
    return stance_by(matching, scale)


def stance_by(matching, scale):
    return find_foot_lock(Clip.of(matching, RootScale.even(scale)))


def places_of(stance, target, name):
    return stance.places[:, stance.joints.tolist().index(target.index(name))]


def test_a_body_without_legs_or_whose_legs_follow_nothing_stands_nowhere():
    chain = tree_of(np.eye(3))
    stance = stance_of(standing(chain, 20), chain, 2.0)
    assert (stance.joints.shape, stance.weights.shape, stance.places.shape) == ((0,), (20, 0), (20, 0, 3))
    assert no_supports(20).weights.shape == (20, 0)
    body = person()
    matching = matched(standing(body), body, {"LeftAnkle": None})
    assert matching.legs is None
    assert len(stance_by(matching, 1.0).joints) == 0


def test_feet_of_a_standing_person_rest_but_for_a_lifted_one():
    stance = stance_of(standing(person()), person())
    names = {person().names[joint] for joint in stance.joints}
    assert names == {"LeftAnkle", "LeftToe", "RightAnkle", "RightToe"}
    np.testing.assert_allclose(stance.weights, 1.0)
    lifted = {"LeftHip": np.array([-0.9, 0, 0]), "LeftKnee": np.array([1.2, 0, 0])}
    stance = stance_of(standing(person(), turns=lifted), person())
    for joint, weights in zip(stance.joints, stance.weights.T, strict=True):
        expected = 0.0 if person().names[joint].startswith("Left") else 1.0
        np.testing.assert_allclose(weights, expected)
    stance = stance_of(standing(person(), frames=1), person())
    np.testing.assert_allclose(stance.weights, 1.0)


def test_feet_alternate_in_a_walk_and_planted_frames_have_full_weight():
    source = sample("walk")
    stance = stance_of(source, source.skeleton)
    weights = {source.skeleton.names[joint]: stance.weights[:, i] for i, joint in enumerate(stance.joints)}
    middle = slice(30, -30)
    left, right = weights["LeftAnkle"][middle], weights["RightAnkle"][middle]
    assert np.all(np.maximum(left, right) > 0)
    assert np.mean((left < 0.6) & (right > 0.99)) > 0.1
    assert np.mean((right < 0.6) & (left > 0.99)) > 0.1
    for name, weight in weights.items():
        assert np.all((weight >= 0) & (weight <= 1 + 1e-12))
        assert np.sum(np.diff((weight > 0.7).astype(int)) == 1) >= 2
        assert np.abs(np.diff(weight)).max() < 0.3
        path = source.positions[:, source.skeleton.index(name)]
        speed = np.linalg.norm(np.gradient(path, source.frame_time, axis=0), axis=1)
        slow = speed < 0.5 * REST_SPEED * 88.8
        assert np.all(weight[slow] > 0.99)


@pytest.mark.parametrize("direction", [(0, 1, 0), (1, 0, 0), (0, -1, 0), (0, 0.6, 0.8)])
def test_nothing_rests_while_the_whole_body_flies_or_skates(direction):
    speed = 1.5 * REST_SPEED * LEG
    path = np.outer(speed * 0.02 * np.arange(40), direction) + 5 * UP
    assert stance_of(standing(person(), path=path), person()).weights.max() == 0.0


def test_a_jump_is_left_alone_in_the_air():
    time = 0.02 * np.arange(150)
    flight = np.clip(time - 0.5, 0, 1.6)
    rise = 0.5 * 9.81 * flight * (1.6 - flight)
    stance = stance_of(standing(person(), path=np.outer(rise, UP)), person())
    np.testing.assert_allclose(stance.weights[time < 0.48], 1.0)
    np.testing.assert_allclose(stance.weights[time > 2.12], 1.0)
    rising, falling = (time > 0.87) & (time < 0.92), (time > 1.68) & (time < 1.73)
    assert rising.any()
    assert falling.any()
    np.testing.assert_array_equal(stance.weights[rising | falling], 0.0)


@pytest.mark.parametrize("factor", [0.3, 0.8, 1.2, 3.0])
def test_places_keep_the_foot_of_the_rotation_copy(factor):
    body = pitched_feet(0.4)
    target = lengthened(body, {"Toe": factor})
    turns = Rotation.random(40, rng=np.random.default_rng(0)).as_rotvec()
    source = standing(body, turns={"LeftAnkle": turns, "RightAnkle": turns[::-1]})
    stance = stance_of(source, target, 0.9)
    copy = rotation_copy(matched(source, target), RootScale.even(0.9)).positions
    for side in SIDES:
        ankle, toe = (places_of(stance, target, side + name) for name in ("Ankle", "Toe"))
        expected = copy[:, target.index(f"{side}Ankle")] - copy[:, target.index(f"{side}Toe")]
        np.testing.assert_allclose(ankle - toe, expected, atol=1e-9)


@pytest.mark.parametrize("sine", [0.1, 0.4, 0.7])
@pytest.mark.parametrize("target_sine", [0.1, 0.4, 0.7])
def test_a_flat_sole_stands_flat_on_the_floor_whatever_the_build_of_the_foot(sine, target_sine):
    source, target = standing(pitched_feet(sine)), pitched_feet(target_sine)
    stance = stance_of(source, target)
    places = {name: places_of(stance, target, f"Left{name}") for name in ("Ankle", "Toe")}
    np.testing.assert_allclose((places["Ankle"] - places["Toe"]) @ UP, 0.14 * target_sine)
    source_toe = source.positions[:, source.skeleton.index("LeftToe")]
    np.testing.assert_allclose(places["Toe"] @ UP, source_toe @ UP)
    source_ankle = source.positions[:, source.skeleton.index("LeftAnkle")]
    np.testing.assert_allclose(places["Ankle"][:, [0, 2]], source_ankle[:, [0, 2]], atol=1e-9)


@pytest.mark.parametrize("target_sine", [0.1, 0.7])
def test_hips_rise_by_what_the_ankles_of_the_target_are_higher(target_sine):
    source, target = standing(pitched_feet(0.4)), pitched_feet(target_sine)
    result = retarget(source, target)
    ankle, hip = (result.motion.positions[:, target.index(f"Left{name}")] @ UP for name in ("Ankle", "Hip"))
    np.testing.assert_allclose(hip - ankle, LEG, atol=1e-4)
    toes = result.motion.positions[:, target.index("LeftToe")] @ UP
    np.testing.assert_allclose(ankle - toes, 0.14 * target_sine, atol=1e-4)


def rising(ankles, weights, shots=0):
    """How much higher the hips belong, (frames,), where the ankles belong so much higher than in the source,
    (frames,), and rest by `weights`, (frames,).
    """
    source = standing(person(), len(ankles))
    clip = Clip.of(matched(source, pitched_feet(0.7)), RootScale.even(1.0))
    feet, frames = find_foot_lock(clip), np.arange(len(ankles))
    places = source.positions[:, feet.joints] + ankles[:, None, None] * UP
    feet = replace(feet, places=places, weights=np.tile(weights[:, None], (1, len(feet.joints))))
    return hips_rise(replace(clip, shots=np.broadcast_to(shots, frames.shape).astype(np.intp)), feet)


def test_hips_rise_as_far_as_ankles_that_rest_in_each_shot_or_else_by_what_the_soles_are_thicker():
    """As on tiptoe, where a longer foot lifts the ankle higher."""
    ankles = np.where(np.abs(np.arange(400) - 200) < 60, 0.1, 0.02)
    rise = rising(ankles, np.ones(400))
    far = np.abs(np.abs(np.arange(400) - 200) - 60) > 40
    np.testing.assert_allclose(rise[far], ankles[far], atol=2e-3)
    assert np.abs(np.diff(rise, 2)).max() < 0.08 / 50
    resting = np.arange(40) < 10
    np.testing.assert_allclose(rising(np.where(resting, 0.02, 0.5), 1.0 * resting), 0.02)
    shots = np.arange(40) >= 25
    np.testing.assert_allclose(rising(np.where(shots, 0.5, 0.02), np.ones(40), shots), np.where(shots, 0.5, 0.02))
    source_sole, target_sole = 0.0, 0.14 * 0.7  # of feet that are level, and pitched by a sine of 0.7
    np.testing.assert_allclose(rising(np.zeros(40), np.zeros(40)), target_sole - source_sole, atol=1e-9)


def test_a_foot_that_stands_flat_lifts_the_hips_more_than_one_on_its_toes():
    lifted = standing(
        pitched_feet(0.3), turns={"LeftAnkle": [0.9, 0, 0], "LeftHip": [-0.4, 0, 0], "LeftKnee": [0.8, 0, 0]}
    )
    clip = Clip.of(matched(lifted, pitched_feet(0.7)), RootScale.even(1.0))
    feet = find_foot_lock(clip)
    feet = replace(feet, weights=np.ones_like(feet.weights))
    left, right = ((feet.places - clip.source.positions[:, feet.joints]) @ UP)[:, ::2].T
    assert np.all(np.abs(hips_rise(clip, feet) - right) < 0.4 * np.abs(left - right))


def test_a_foot_that_is_still_in_the_air_lifts_the_hips_less_than_one_on_the_floor():
    raised = standing(person(), turns={"LeftHip": [-0.6, 0, 0], "LeftKnee": [1.2, 0, 0], "LeftAnkle": [-0.6, 0, 0]})
    clip = Clip.of(matched(raised, person()), RootScale.even(1.0))
    feet = find_foot_lock(clip)
    rises = np.where(np.isin(feet.joints, feet.joints[:2]), 0.1, 0.0)
    places = raised.positions[:, feet.joints] + rises[:, None] * UP
    assert 0.0 < hips_rise(clip, replace(feet, places=places, weights=np.ones_like(feet.weights))).max() < 0.03


@pytest.mark.parametrize(("feet", "share"), [([1, 1, 0, 0], -1.0), ([0, 0, 1, 1], 1.0), ([1, 1, 1, 1], 0.0)])
def test_wide_hips_that_tilt_are_as_high_as_narrow_ones_by_the_leg_that_stands(feet, share):
    tilt, wider = 0.3, 2.0
    upright = {"Hips": [0, 0, tilt], "LeftHip": [0, 0, -tilt], "RightHip": [0, 0, -tilt]}
    body = person()
    clip = Clip.of(matched(standing(body, turns=upright), lengthened(body, {"Hip": wider})), RootScale.even(1.0))
    stance = find_foot_lock(clip)
    stance = replace(stance, weights=np.tile(np.array(feet, float), (len(clip), 1)))
    ankles = [pair.source.ankle for pair in clip.legs]
    places = np.repeat(clip.source.positions[:, ankles], 2, axis=1)
    left, right = body.offsets[[body.index(f"{side}Hip") for side in SIDES]]
    lower = (wider - 1.0) * 0.5 * (left - right)[0] * np.sin(tilt)  # than the source's, of the joint that is lower
    np.testing.assert_allclose(hips_rise(clip, replace(stance, places=places)), share * lower, atol=1e-6)


def test_on_one_leg_hips_tilt_as_fast_as_the_sources_and_not_in_a_jump():
    """Wide hips that sway on the left leg, and then in the air."""
    body, frames = person(), np.arange(200)
    tilts = np.outer(0.2 * np.sin(0.2 * frames), [0, 0, 1])
    sways = posed(body, {"Hips": tilts, "LeftHip": -tilts}, np.tile((LEG + 0.1) * UP, (200, 1)))
    clip = Clip.of(matched(sways, with_hips(body, 2.0)), RootScale.even(1.0))
    feet = find_foot_lock(clip)
    places = np.repeat(sways.positions[:, [pair.source.ankle for pair in clip.legs]], 2, axis=1)
    left = 1.0 * ((frames < 100)[:, None] & (np.arange(4) < 2))
    rise = hips_rise(clip, replace(feet, places=places, weights=left))
    half = body.offsets[body.index("LeftHip")][0]
    np.testing.assert_allclose(rise[10:90], -half * np.sin(tilts[10:90, 2]), atol=0.25 * 0.2 * half)
    np.testing.assert_allclose(rise[110:], 0.0, atol=1e-9)


def with_forefoot(body):
    """The body with its toe joints right below the ankles, so that they turn the whole foot."""
    offsets = np.array(body.offsets)
    for side in SIDES:
        offsets[body.index(f"{side}Toe")] = [0.0, -0.05, 0.0]
        offsets[body.index(f"{side}Toe_End")] = [0.0, 0.0, 0.2]
    return body.with_offsets(offsets)


def test_how_far_a_forefoot_is_bent_as_it_rests_belongs_to_the_rig():
    """Feet on the floor are flat, and what such a joint turns besides that turns the toes of the target."""
    frames, more = np.arange(60), 0.5
    bent = np.outer(0.2 + more * (frames >= 40), [1.0, 0.0, 0.0])
    lifted = np.outer(-1.2 * (frames >= 40), [1.0, 0.0, 0.0])  # of the left leg, which then does not rest
    turns = {"LeftToe": bent, "RightToe": [0.2, 0.0, 0.0], "LeftHip": lifted}
    result = retarget(standing(with_forefoot(person()), 60, turns), person())
    toes = {side: person().index(f"{side}Toe") for side in SIDES}
    turned = {side: Rotation.from_quat(result.motion.rotations[:, toe]).magnitude() for side, toe in toes.items()}
    np.testing.assert_allclose(turned["Right"], 0.0, atol=1e-3)
    np.testing.assert_allclose(turned["Left"][:20], 0.0, atol=1e-3)
    np.testing.assert_allclose(turned["Left"][50:], more, atol=1e-3)
    feet = result.motion.positions[:, [toes["Right"], person().index("RightAnkle")]] @ UP
    np.testing.assert_allclose(np.ptp(feet, axis=1), 0.0, atol=0.01)


def test_a_first_frame_in_another_posture_says_nothing_of_the_rest():
    body, target = pitched_feet(0.3), lengthened(pitched_feet(0.3), {"Toe": 1.4})
    lifted = standing(body, turns={"LeftHip": [-1.2, 0, 0], "LeftKnee": [1.5, 0, 0]})
    path, rotations = np.array(lifted.root_positions), np.array(lifted.rotations)
    rotations[0] = standing(body).rotations[0]
    path[0] += [0.0, 0.0, 0.4]
    stance = stance_of(replace(lifted, root_positions=path, rotations=rotations), target)
    left = [target.names[joint].startswith("Left") for joint in stance.joints]
    np.testing.assert_allclose(stance.weights[0], 1.0)
    np.testing.assert_allclose(stance.weights[1:, left], 0.0)


def held_by_hand(clip, feet):
    """The supports with a hand that rests as well."""
    hand = np.array([clip.skeleton.index("LeftWrist")])
    return feet.with_joints(hand, clip.regions.of_joint[hand], np.ones((len(clip), 1)), np.zeros((len(clip), 1, 3)))


@pytest.mark.parametrize(("rise", "share"), [(0.0, 0.0), (0.25, 0.15625), (0.5, 0.5), (1.0, 1.0), (3.0, 1.0)])
@pytest.mark.parametrize("moments", [30, 50])
def test_feet_that_legs_do_not_reach_for_a_while_rest_as_near_as_they_do(rise, share, moments):
    """For less than half of the rest, that is; where legs are too short most of the time, feet stay."""
    clip = Clip.of(matched(standing(person(), 80), person()), RootScale.even(1.0))
    feet, rises = find_foot_lock(clip), np.outer(rise * SINK * LEG * (np.arange(80) < moments), UP)
    moved = feet_within_reach(clip.raised(rises), held_by_hand(clip, feet)).places[:, :4] - feet.places
    np.testing.assert_array_equal(feet_within_reach(clip.raised(rises), feet).places, feet.places)  # on feet alone
    expected = share * rises if moments < 40 else 0.0 * rises
    np.testing.assert_allclose(moved, np.repeat(expected[:, None], 4, axis=1), atol=1e-9)


def test_feet_leave_their_places_smoothly_and_each_on_its_own():
    clip = Clip.of(matched(standing(person(), 80), person()), RootScale.even(1.0))
    feet, time = find_foot_lock(clip), np.arange(80)
    lower = np.outer(SINK * LEG * np.exp(-(((time - 40) / 8) ** 2)), UP)[:, None] * np.array([0, 0, 1, 1])[:, None]
    low = held_by_hand(clip, replace(feet, places=feet.places - lower))
    moved = feet_within_reach(clip, low).places[:, :4] - feet.places + lower
    np.testing.assert_allclose(moved[40], lower[40], atol=1e-5)
    np.testing.assert_array_equal(moved[:, :2], 0.0)
    assert moved.min() > -1e-9
    assert (moved <= lower + 1e-9).all()
    assert np.abs(np.diff(moved, axis=0)).max() < 0.15 * SINK * LEG


def test_hips_of_a_cartwheel_are_not_held_by_short_legs():
    result = retarget(sample("supports/cartwheel"), sample_target("child"))
    copy, own = (result.metrics[side]["hips_acceleration"] for side in ("rotation_copy", "result"))
    assert own < 2.2 * copy  # 5.0 if feet stay on the floor


def with_hips(body, factor):
    """The body with hip joints so many times as far apart."""
    offsets = np.array(body.offsets)
    offsets[[body.index(f"{side}Hip") for side in SIDES]] *= [factor, 1.0, 1.0]
    return body.with_offsets(offsets)


def splay(motion):
    """(frames, legs), how far each leg points to the left of the hips' middle plane [degrees]."""
    left, right, *ankles = (
        motion.positions[:, motion.skeleton.index(name)] for name in ("LeftHip", "RightHip", "LeftAnkle", "RightAnkle")
    )
    across = (left - right) / np.linalg.norm(left - right, axis=1, keepdims=True)
    legs = [ankle - hip for ankle, hip in zip(ankles, (left, right), strict=True)]
    return np.degrees(
        [np.arcsin((leg * across).sum(axis=1) / np.linalg.norm(leg, axis=1)) for leg in legs],
    ).T


widths = pytest.mark.parametrize("width", [0.5, 0.8, 1.3, 2.0])


@widths
@pytest.mark.parametrize("spread", [0.1, 0.4])
def test_legs_below_hips_of_another_width_are_splayed_as_the_source_s(width, spread):
    turns = {"LeftHip": [0.0, 0.0, spread], "RightHip": [0.0, 0.0, -spread]}
    path = np.tile((np.cos(spread) - 1.0) * LEG * UP, (40, 1))
    source = standing(pitched_feet(0.3), turns=turns, path=path)
    result = retarget(source, with_hips(pitched_feet(0.3), width)).motion
    np.testing.assert_allclose(splay(result), splay(source), atol=0.05)


@widths
def test_legs_stay_splayed_while_a_body_turns_on_the_spot(width):
    """Its feet skate as the source's do; they are not kept where they were before the turn."""
    angles = np.linspace(0.0, 2 * np.pi, 200)
    source = standing(pitched_feet(0.3), 200, turns={"Hips": np.outer(angles, UP)})
    stance = stance_of(source, source.skeleton)
    assert stance.weights.min() == 1.0
    result = retarget(source, with_hips(pitched_feet(0.3), width)).motion
    np.testing.assert_allclose(splay(result), splay(source), atol=3.0)


@pytest.mark.parametrize("frame_time", ["0.0001", "0.02", "10"])
def test_a_foot_that_hangs_still_all_the_time_has_a_place(frame_time):
    lifted = {"LeftHip": np.array([-0.9, 0, 0]), "LeftKnee": np.array([1.2, 0, 0])}
    source = replace(standing(pitched_feet(0.3), 3000, turns=lifted), frame_time_text=frame_time)
    place = places_of(stance_of(source, with_hips(pitched_feet(0.3), 2.0)), pitched_feet(0.3), "LeftAnkle")
    np.testing.assert_allclose(place, place[:1].repeat(3000, axis=0), atol=1e-6)


def test_feet_that_stand_together_do_not_meet_below_narrow_hips():
    body = pitched_feet(0.3)
    apart = body.offsets[body.index("LeftHip"), 0] * 2
    turn = np.arcsin((apart - 0.12 * LEG) / 2 / LEG)
    source = standing(body, turns={"LeftHip": [0.0, 0.0, -turn], "RightHip": [0.0, 0.0, turn]})
    for width in (0.5, 0.1):
        places = stance_of(source, with_hips(body, width)).places
        gap = np.linalg.norm((places[:, 0] - places[:, 2])[:, [0, 2]], axis=1)
        assert np.all(gap > 0.1 * LEG)
        assert np.all(gap < 0.12 * LEG)


def test_a_heel_that_lifts_leaves_the_toe_where_it_is():
    """The target's foot is longer; its toe neither slides nor sinks while the source's foot rolls over its toe."""
    body, angles = pitched_feet(0.3), np.linspace(0.0, 0.8, 40)
    target = lengthened(body, {"Toe": 1.5})
    source = standing(body, turns={"LeftAnkle": np.outer(angles, [1, 0, 0])})
    toe = np.array(source.positions[:, body.index("LeftToe")])
    rolling = replace(source, root_positions=source.root_positions + toe[0] - toe)
    place = places_of(stance_of(rolling, target), target, "LeftToe")
    np.testing.assert_allclose(place[:, [0, 2]], np.tile(place[0, [0, 2]], (40, 1)), atol=1e-5)
    assert np.ptp(place @ UP) < 0.003 * LEG


def test_a_foot_that_trembles_about_its_ankle_leaves_the_ankle_where_it_is():
    """As the feet of captured clips do; the target's foot is longer, and its toe trembles farther."""
    body, angles = pitched_feet(0.3), 0.2 * np.sin(2.0 * np.arange(60.0))
    source, target = (
        standing(body, 60, turns={"LeftAnkle": np.outer(angles, [0, 1, 0])}),
        lengthened(body, {"Toe": 2.0}),
    )
    held = stance_of(source, target)
    ankle, toe = (places_of(held, target, joint)[10:-10] for joint in ("LeftAnkle", "LeftToe"))
    assert np.ptp(ankle, axis=0).max() < 0.15 * np.ptp(toe, axis=0).max()


@pytest.mark.parametrize("factor", [0.3, 0.8, 1.2, 3.0])
def test_a_foot_that_turns_evenly_through_the_vertical_has_a_place_that_moves_without_a_jump(factor):
    body = pitched_feet(0.0)
    target = lengthened(body, {"Toe": factor})
    angles = np.linspace(-np.pi, np.pi, 721)
    source = standing(body, 721, turns={"LeftAnkle": np.outer(angles, [1, 0, 0])})
    ankle = places_of(stance_of(source, target), target, "LeftAnkle")
    assert np.all(np.isfinite(ankle))
    assert np.abs(np.diff(ankle, 2, axis=0)).max() < 0.14 * factor * np.radians(0.5)


def without_feet(body):
    """The body whose legs end at the ankles."""
    return taken(body, [joint for joint, name in enumerate(body.names) if "Toe" not in name])


@pytest.mark.parametrize("footless", ["source", "target"])
def test_ankles_are_compared_with_ankles_where_a_body_has_no_feet(footless):
    whole, ankles = pitched_feet(0.4), without_feet(pitched_feet(0.4))
    source, target = (ankles, whole) if footless == "source" else (whole, ankles)
    result = retarget(standing(source), target)
    for name in ("LeftAnkle", "RightAnkle", "Hips"):
        expected = result.source.positions[:, source.index(name)]
        np.testing.assert_allclose(result.motion.positions[:, target.index(name)], expected, atol=1e-6)


@pytest.mark.parametrize("name", ["walk", "squat", "turn"])
@pytest.mark.parametrize("body", ["child", "giant"])
def test_resting_feet_of_the_result_are_at_their_places_on_exact_bones(name, body):
    source = sample(name)
    target = sample_target(body).for_source(source.rigid_skeleton).skeleton
    held, free = (retarget(source, target, Options(supports=supports)) for supports in ("hold", "free"))
    stance = held.supports
    resting = stance.weights > 1 - 1e-9
    assert resting.mean() > 0.3
    body = Body.of(target)
    off, off_free = (
        np.linalg.norm(result.motion.positions[:, stance.joints] - stance.places, axis=-1)[resting] / body.leg_length
        for result in (held, free)
    )
    assert off.max() < 1e-3
    assert off.mean() < 5e-5
    assert off_free.max() > 5 * off.max() or off_free.max() < 1e-6  # a squat's feet are in place in the copy
    lower = [joint for leg in body.legs for joint in (leg.ankle, leg.toe)]
    bones = held.motion.positions[:, lower] - held.motion.positions[:, target.parents[lower]]
    expected = np.broadcast_to(target.lengths[lower], bones.shape[:2])
    np.testing.assert_allclose(np.linalg.norm(bones, axis=-1), expected, rtol=1e-9)


@pytest.mark.parametrize("body", ["child", "giant", "long_arms"])
def test_feet_that_are_held_hardly_move_the_hips(body):
    """Legs bend instead: the hips of a squat stay as high over the feet as in the source, almost."""
    metrics = retarget(sample("squat"), sample_target(body)).metrics["result"]
    assert metrics["hips_height"] < 0.15  # [% of leg length]


@pytest.mark.parametrize("longer", [1.15, 1.3])
def test_strides_beyond_the_reach_of_the_legs_lower_the_hips_no_more_than_they_must(longer):
    """As of a child that keeps up with adults; its feet do not skate for it."""
    source, target = sample("walk"), sample_target("rigs/mixamo_a").skeleton
    match_of_both = match_performer(Transfer(source, target))
    height = find_root_scale(match_of_both.matching)
    performer = Performer.of(match_of_both, RootScale(longer * height, height))
    performer = performer.with_supports(Options(), ContactSettings())
    clip, feet = performer.clip, performer.supports
    result = performer.posed(solve_contact(clip, feet, performer.settings)).positions
    legs, length = clip.target_legs, clip.leg_lengths[1]
    path = clip.copy_on_path(np.arange(len(target)))
    hips = [leg.hip for leg in legs]
    lowered = (path[:, hips] - result[:, hips]).mean(axis=1) @ clip.up
    needed = []
    for k, leg in enumerate(legs):
        ankle = path[:, leg.ankle] + feet.weights[:, [2 * k]] * (feet.places[:, 2 * k] - path[:, leg.ankle])
        away = path[:, leg.hip] - ankle
        along = np.linalg.norm(away - np.outer(away @ clip.up, clip.up), axis=1)
        needed.append(away @ clip.up - np.sqrt(np.maximum(length**2 - along**2, 0.0)))
    assert np.max(needed) > 0.01 * length
    assert lowered.max() < np.max(needed) + 0.005 * length
    rests = feet.weights[:, :4] > 0.999
    missed = np.linalg.norm(result[:, feet.joints[:4]] - feet.places[:, :4], axis=-1)
    assert missed[rests].max() < 0.005 * length
