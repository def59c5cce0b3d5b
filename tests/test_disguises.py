"""Files as people have them: a motion in another structure gives the same result as in the plain one, or is refused."""

from dataclasses import replace

import numpy as np
import pytest
from animals import dog
from bodies import HERO, SIDES, swaying
from built_rigs import BUILDS, with_axes
from disguises import (
    ARM,
    DISGUISES,
    LEG,
    MIXAMO,
    all_under_root,
    beside,
    exchanged,
    farthest_apart,
    groups,
    hips_on_floor,
    leaning,
    nulls,
    off,
    on_high_ankles,
    plain,
    resting,
    sample,
    straight_below,
    striding,
    targets,
    toes_end,
    turned_at_most,
    twins,
    with_heels,
    with_joints_before_thighs,
    with_sword,
    with_twists,
    without_toes,
)

from distretarget import Body, MatchingError, load_target, retarget
from distretarget.body.tree_repairs import reparented
from distretarget.skeleton import POSITION_CHANNELS

pytestmark = pytest.mark.parametrize("disguise", DISGUISES, ids=repr)


@pytest.mark.parametrize("clip", ["walk", "clap"])
@pytest.mark.parametrize("parts", [("Ankle",), ("Wrist",), ("Ankle", "Wrist")])
def test_feet_and_hands_that_hang_from_the_root_are_those_of_the_body(disguise, parts, clip, tmp_path):
    for target in targets():
        assert off(beside(*parts), disguise, clip, tmp_path, target) < 0.01


def test_hands_of_short_forearms_that_hang_from_the_root_are_those_of_the_body(disguise):
    clap = sample("clap")
    offsets, wrists = np.array(clap.skeleton.offsets), [clap.skeleton.index(f"{side}Wrist") for side in SIDES]
    offsets[wrists] *= 0.48
    short = replace(clap, skeleton=clap.skeleton.with_offsets(offsets))
    for target in targets():
        motions = [retarget(disguise.worn(each), target).motion for each in (short, beside("Wrist")(short))]
        assert farthest_apart(*motions) < 0.01


@pytest.mark.parametrize("clip", ["walk", "squat"])
def test_feet_beside_the_body_of_a_target_are_where_its_legs_end(disguise, clip, tmp_path):
    usual, other = (disguise.target(structure, tmp_path) for structure in (plain, beside("Ankle")))
    results = [retarget(sample(clip), target) for target in (usual, other)]
    assert farthest_apart(*(result.motion for result in results)) < 0.01
    assert results[1].warnings == results[0].warnings
    skeleton = results[1].motion.skeleton
    if not disguise.gltf:
        assert skeleton == other.skeleton
        assert 0 in skeleton.parents[[skeleton.index(disguise.by_sample["LeftAnkle"])]]


@pytest.mark.parametrize("build", [None, *BUILDS])
def test_a_joint_straight_below_the_ankle_is_no_toe(disguise, build):
    """Feet point as their tips do, whatever a joint below the ankle shows and however the joints are built."""
    high, straight = on_high_ankles(sample("squat")), straight_below(sample("squat"))
    if build:
        axes = build(Body.of_motion(high))
        high, straight = with_axes(high, axes), with_axes(straight, axes)
    for target in targets():
        motions = [retarget(disguise.worn(each), target).motion for each in (high, straight)]
        assert turned_at_most(*motions, ("Ankle", "Foot")) < 3.0


@pytest.mark.parametrize("clip", ["walk", "wave"])
@pytest.mark.parametrize(("what", "parts"), [("arms", ARM), ("legs", LEG)])
def test_limbs_are_on_the_sides_where_they_are(disguise, what, parts, clip, tmp_path):
    for target in targets():
        assert off(exchanged(*parts), disguise, clip, tmp_path, target) < 0.01
    result = retarget(disguise.worn_by(exchanged(*parts)(sample(clip)), tmp_path), target)
    line = f"the source's names exchange left and right of the {what}; they are taken as the body shows them"
    assert line in result.warnings


@pytest.mark.parametrize(("parts", "clip"), [(ARM, "wave"), ((*ARM, *LEG), "hands_on_hips")])
def test_limbs_of_a_target_are_on_the_sides_where_they_are(disguise, parts, clip, tmp_path):
    usual, other = (disguise.target(structure, tmp_path) for structure in (plain, exchanged(*parts)))
    one, result = (retarget(sample(clip), target) for target in (usual, other))
    np.testing.assert_allclose(result.motion.positions, one.motion.positions, atol=1e-6 * one.matching.target.height)


def test_knees_show_the_front_of_a_body_without_toes(disguise, tmp_path):
    def structure(motion):
        return exchanged(*ARM, *LEG)(without_toes(motion))

    for target in targets():
        usual, other = (disguise.worn_by(write(sample("squat")), tmp_path) for write in (without_toes, structure))
        results = [retarget(each, target) for each in (usual, other)]
        assert farthest_apart(*(result.motion for result in results)) < 0.01
        assert any("exchange left and right;" in line for line in results[1].warnings)


@pytest.mark.parametrize("clip", ["walk", "squat"])
def test_the_pelvis_is_where_the_thighs_begin(disguise, clip, tmp_path):
    for target in targets():
        for structure in (hips_on_floor, lambda motion: hips_on_floor(with_joints_before_thighs(motion))):
            assert off(structure, disguise, clip, tmp_path, target) < 0.01


@pytest.mark.parametrize("clip", ["walk", "squat"])
def test_hips_of_a_target_stay_on_the_floor_below_its_pelvis(disguise, clip, tmp_path):
    usual, other = (disguise.target(structure, tmp_path) for structure in (plain, hips_on_floor))
    source = resting("Shoulder", "z", -45)(sample(clip))  # on the same rig, other soles may be seen
    one, result = (retarget(source, target) for target in (usual, other))
    apart = np.linalg.norm(result.motion.positions - one.motion.positions, axis=-1)[:, 1:]
    assert apart.max() < 0.001 * one.matching.target.height
    assert result.motion.skeleton == other.skeleton
    assert result.warnings == one.warnings


TAILS = [(0.0, 8.0, 0.0), (0.0, 0.0, -8.0), (0.0, 8.0, -8.0), (0.0, 0.0, -20.0)]


@pytest.mark.parametrize("clip", ["walk", "squat"])
@pytest.mark.parametrize("way", TAILS[:3])
def test_end_sites_that_lead_up_or_back_are_no_soles_and_turn_no_toes(disguise, way, clip):
    for target in targets():
        motions = [disguise.worn(toes_end(*each)(sample(clip))) for each in ((0.0, 0.0, 6.0), way)]
        assert farthest_apart(*(retarget(motion, target).motion for motion in motions)) < 1.0


@pytest.mark.parametrize("way", TAILS)
def test_end_sites_of_a_target_that_lead_up_or_back_are_no_soles(disguise, way, tmp_path):
    usual, other = (disguise.target(toes_end(*each), tmp_path) for each in ((0.0, 0.0, 6.0), way))
    one, result = (retarget(sample("squat"), target) for target in (usual, other))
    joints = [*one.motion.skeleton.joints]
    apart = np.linalg.norm(result.motion.positions - one.motion.positions, axis=-1)[:, joints]
    assert apart.max() < 0.01 * one.matching.target.height


@pytest.mark.parametrize("build", BUILDS)
def test_toes_of_a_rig_built_along_its_bones_do_not_turn_to_their_tails(disguise, build):
    flat = toes_end(0.0, 0.0, 6.0)(sample("squat"))
    axes = build(Body.of_motion(flat))
    for target in targets():
        motions = [disguise.worn(with_axes(toes_end(*way)(flat), axes)) for way in ((0.0, 0.0, 6.0), (0.0, 8.0, -8.0))]
        assert farthest_apart(*(retarget(motion, target).motion for motion in motions)) < 1.0


@pytest.mark.parametrize("build", BUILDS)
@pytest.mark.parametrize("clip", ["squat", "wave"])
def test_twist_joints_may_have_axes_of_their_own_where_all_joints_have(disguise, clip, build):
    """Without rotations, the legs are folded; one may point up and the other down."""
    built = [with_axes(each, build(Body.of_motion(each))) for each in (sample(clip), with_twists(sample(clip)))]
    for target in targets():
        motions = [retarget(disguise.worn(each), target).motion for each in built]
        assert farthest_apart(*motions) < 1.0
        assert turned_at_most(*motions, ("Ankle", "Foot", "Knee", "Leg")) < 3.0


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("mark", [".001", "_rot", "Rot"])
def test_a_joint_and_its_twin_are_one(disguise, mark, below, tmp_path):
    for target in targets():
        assert off(twins(mark, below=below), disguise, "walk", tmp_path, target) < 0.01


@pytest.mark.parametrize("structure", [groups, nulls])
def test_still_joints_between_those_of_the_body_change_nothing(disguise, structure, tmp_path):
    for target in targets():
        assert off(structure, disguise, "walk", tmp_path, target) < 0.01


@pytest.mark.parametrize("heights", [(-3.5, 0.0), (-9.0, -6.0)])
def test_heels_of_one_body_alone_are_no_soles(disguise, heights, tmp_path):
    """A foot that strikes with the heel is as high as that of a body without joints at its heels."""
    heels = with_heels(*heights)
    for target in targets():
        assert off(heels, disguise, "walk", tmp_path, target) < 0.01
    if not disguise.gltf:
        usual, other = (disguise.target(each, tmp_path) for each in (plain, heels))
        assert farthest_apart(*(retarget(sample("walk"), each).motion for each in (usual, other))) < 0.01


def test_what_a_hand_holds_changes_nothing(disguise, tmp_path):
    for target in targets():
        assert off(with_sword, disguise, "hands_on_hips", tmp_path, target) < 0.01


def test_end_sites_without_length_are_none(disguise):
    clip = sample("hands_on_hips")
    ends = clip.skeleton.end_sites
    short = clip.skeleton.with_offsets(np.where(ends[:, None], 0.0, clip.skeleton.offsets))
    joints = {joint: int(clip.skeleton.parents[joint]) for joint in clip.skeleton.joints}
    without = reparented(clip.skeleton, joints, dict(enumerate(clip.skeleton.channels)))
    for target in targets():
        motions = (disguise.worn(each) for each in (replace(clip, skeleton=short), without.motion(clip)))
        assert farthest_apart(*(retarget(motion, target).motion for motion in motions)) < 0.01


LEANING = [leaning(*lean) for lean in (("z", 30), ("z", -10), ("x", 7), ("x", 24), ("x", -15), ("y", 8))]


@pytest.mark.parametrize("structure", LEANING)
def test_a_rest_pose_that_leans_changes_nothing(disguise, structure):
    for target in targets():
        results = [retarget(disguise.worn(each(sample("walk"))), target) for each in (plain, structure)]
        assert farthest_apart(*(result.motion for result in results)) < 0.05
        assert results[1].warnings == results[0].warnings


@pytest.mark.parametrize("structure", LEANING)
def test_a_target_whose_rest_pose_leans_moves_as_the_plain_one(disguise, structure, tmp_path):
    if disguise.gltf:
        pytest.skip("a character stands on its floor")
    usual, other = (disguise.target(each, tmp_path) for each in (plain, structure))
    source = resting("Shoulder", "z", -45)(sample("walk"))  # another rig
    results = [retarget(source, target) for target in (usual, other)]
    assert farthest_apart(*(result.motion for result in results)) < 0.05
    assert results[1].warnings == results[0].warnings


def test_a_rest_pose_out_of_a_stride_is_named(disguise):
    """How the trunk turns in it cannot be told from the build; the rest is right."""
    walk, line = sample("walk"), "strides at rest, and how trunk, hands and head turn there is taken for its build"
    plain_result = retarget(disguise.worn(walk), targets()[1])
    result = retarget(disguise.worn(striding(walk)), targets()[1])
    assert next(each for each in result.warnings if line in each).startswith("the source strides")
    assert not [each for each in plain_result.warnings if line in each]
    assert farthest_apart(plain_result.motion, result.motion) < 8.0
    assert not retarget(striding(walk), striding(walk).skeleton).warnings


TURNED_OUT = [resting("Hip", "y", 30), resting("Ankle", "y", 30)]
TILTED = [resting("Hip", "z", 20), resting("Ankle", "x", 30)]


@pytest.mark.parametrize("degrees", [30, 40])
def test_feet_that_hang_in_the_rest_pose_stand_as_they_rest_in_the_motion(disguise, degrees):
    hanging = resting("Ankle", "x", degrees)
    motions = [retarget(disguise.worn(each(sample("walk"))), load_target(HERO)).motion for each in (plain, hanging)]
    assert farthest_apart(*motions) < 0.1


@pytest.mark.parametrize("structure", [*TURNED_OUT, *TILTED])
def test_a_rest_pose_turns_or_tilts_no_feet(disguise, structure):
    """Feet that turn out, hang, or stand on their edges below splayed legs in the rest pose stand as they do in the
    motion.
    """
    for target in targets():
        motions = [retarget(disguise.worn(each(sample("walk"))), target).motion for each in (plain, structure)]
        assert farthest_apart(*motions) < 1.0
        assert turned_at_most(*motions, ("Ankle", "Foot")) < 4.0


@pytest.mark.parametrize("structure", TILTED)
@pytest.mark.parametrize("frames", [slice(0, 12), slice(48, 66)])
def test_one_foot_that_stands_flat_shows_how_the_other_does(disguise, structure, frames):
    for target in targets():
        clips = (disguise.worn(each(sample("walk"))[frames]) for each in (plain, structure))
        assert turned_at_most(*(retarget(clip, target).motion for clip in clips), ("Ankle", "Foot")) < 4.0


@pytest.mark.parametrize("structure", TURNED_OUT)
def test_a_target_with_feet_turned_out_at_rest_turns_them_as_the_source_does(disguise, structure, tmp_path):
    if disguise.gltf:
        pytest.skip("the feet of a mesh of boxes are not flat")
    usual, other = (disguise.target(each, tmp_path) for each in (plain, structure))
    one, result = (retarget(sample("walk"), target) for target in (usual, other))
    joints = [*one.motion.skeleton.joints]
    apart = np.linalg.norm(result.motion.positions - one.motion.positions, axis=-1)[:, joints]
    assert apart.max() < 0.01 * one.matching.target.height
    assert not [line for line in result.warnings if line.startswith("heading")]


def test_knees_turn_out_with_the_feet_of_the_rest_pose(disguise):
    for target in targets():
        motions = [retarget(disguise.worn(each(sample("squat"))), target).motion for each in (plain, TURNED_OUT[0])]
        assert turned_at_most(*motions, ("Knee", "RightLeg", "LeftLeg")) < 4.0


def test_bodies_that_stand_on_the_edges_of_their_feet_alike_keep_them(disguise):
    splayed = disguise.worn(TILTED[0](sample("walk")))
    result = retarget(splayed, splayed.skeleton)
    assert farthest_apart(result.motion, splayed) < 0.01


@pytest.mark.parametrize("structure", [groups, nulls])
def test_still_joints_between_those_of_a_target_follow_their_parents(disguise, structure, tmp_path):
    if disguise.gltf:
        pytest.skip("a mesh knows no other joints")
    usual, other = (disguise.target(each, tmp_path) for each in (plain, structure))
    assert farthest_apart(*(retarget(sample("walk"), target).motion for target in (usual, other))) < 1.5


def test_a_map_may_name_a_twin(disguise, tmp_path):
    source, target = disguise.worn_by(twins("_rot", below=True)(sample("wave")), tmp_path), targets()[0]
    hand = f"{disguise.by_sample['LeftWrist']}_rot"
    result = retarget(source, target, joint_map={"LeftWrist": hand})
    assert result.source.skeleton.keys[result.drivers[target.index("LeftWrist")]] == hand


def test_a_flat_tree_is_refused(disguise, tmp_path):
    source, target = disguise.worn_by(all_under_root(sample("walk")), tmp_path), targets()[0]
    for pair in ((source, target), (sample("walk"), source.skeleton)):
        with pytest.raises(MatchingError, match="is flat: its joints hang from the root, not from each other"):
            retarget(*pair)


def test_a_target_whose_root_cannot_turn_says_so_and_not_what_follows_from_it(disguise, tmp_path):
    skeleton = disguise.target(plain, tmp_path).skeleton
    fixed = replace(skeleton, channels=(POSITION_CHANNELS, *skeleton.channels[1:]))
    for body, times in ((fixed, 1), (skeleton, 0)):
        result = retarget(sample("turn"), body)
        lines = [line for line in result.warnings if "does not turn" in line]
        assert len(lines) == times
        assert not times or ([*result.warnings], result.verdict) == (lines, f"T{lines[0][1:]}.")
        assert all(line.endswith(f"the target's root {body.names[0]!r} lacks rotation channels") for line in lines)


@pytest.mark.parametrize("parts", [("UpLeg", "Leg"), ("UpLeg", "Leg", "Foot")])
def test_four_legs_of_which_two_have_the_names_of_arms_are_refused(disguise, parts, tmp_path):
    """Hind legs without names that are known are legs by the tree."""
    if disguise.names is MIXAMO:
        pytest.skip("equal names need no guess by parts")
    named = dog(own_names=False)
    animal = replace(named, names=tuple(_unknown(name, parts) for name in named.names))
    for pair in ((swaying(animal), targets()[0]), (disguise.worn_by(sample("walk"), tmp_path), animal)):
        with pytest.raises(MatchingError, match=r"seems to go on all fours|no human body is recognised"):
            retarget(*pair)


def _unknown(name, parts):
    return next((name.replace(part, f"Hind{part[::-1]}") for part in parts if part in name and "Arm" not in name), name)
