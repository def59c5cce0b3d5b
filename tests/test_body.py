"""What a body derives from skeleton, parts and motion, and its mesh without what its hands hold."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from animals import dog, on_a_root
from bodies import (
    CORPUS,
    HERO,
    WAYS,
    bent_chain,
    in_world,
    lengthened,
    lowered,
    moved,
    needs_corpus,
    onto,
    other_lengths,
    person,
    posed,
    sample,
    sample_target,
    swaying,
    turned,
)
from scipy.spatial.transform import Rotation
from zoo import CONVENTIONS, rig

import distretarget
from distretarget import Motion, read_bvh, retarget
from distretarget.body.axes import axis_vector
from distretarget.body.body import Body
from distretarget.body.build import bare_mesh
from distretarget.pipeline.performer import target_capsules
from distretarget.skeleton import AXES
from distretarget.skin.mesh import Looks

SIDES = [("Left", "Right"), ("_l", "_r")]
PEOPLE = [person(), *(rig(convention, pose) for convention, pose in itertools.product(CONVENTIONS, "TA"))]

ups = pytest.mark.parametrize("up", AXES)
ways = pytest.mark.parametrize("way", WAYS, ids=[f"way{k}" for k in range(len(WAYS))])


def crossed(body):
    """The body with the names of left and right exchanged."""
    return replace(body, names=tuple(map(_crossed, body.names)))


def _crossed(name):
    for pair in SIDES:
        for one, other in (pair, pair[::-1]):
            if one in name and (one in ("Left", "Right") or name.removesuffix("_End").endswith(one)):
                return name.replace(one, other)
    return name


def symmetric(body):
    """The body with the bones of its right side as long as those of its left."""
    lengths = np.array(body.lengths)
    for joint, name in enumerate(body.names):
        if name.startswith("Right"):
            lengths[joint] = lengths[body.index("Left" + name.removeprefix("Right"))]
    return body.with_lengths(lengths)


def bent(**angles):
    """A person with joints turned forwards about the axis from side to side [degrees]."""
    turns = {name: np.radians([angle, 0, 0]) for name, angle in angles.items()}
    return posed(person(), turns, np.tile([0.0, 0.5, 0.0], (5, 1)))


CRAWLING = bent(Hips=90, LeftHip=-90, RightHip=-90, LeftKnee=90, RightKnee=90)
ON_HANDS_AND_FEET = bent(Hips=90, LeftHip=-90, RightHip=-90)
SITTING = bent(LeftHip=-90, RightHip=-90, LeftKnee=90, RightKnee=90)


def with_joints_at(body, positions):
    """A motion without rotations in which the joints are at positions, (frames, joints, 3)."""
    translations = positions - positions[:, body.parents] * (body.parents >= 0)[:, None]
    still = np.tile([0.0, 0.0, 0.0, 1.0], (*positions.shape[:2], 1))
    return Motion.of_translations(body, translations, still, "0.02")


def folded(motion):
    """The motion on the same body with the posture of its first frame as its rest pose, and no rotations."""
    body = motion.skeleton.with_offsets(with_joints_at(motion.skeleton, motion.positions[:1]).translations[0])
    return posed(body, {}, motion.root_positions)


@ways
def test_people_stand_in_their_rest_poses_and_left_is_left_whichever_way(way):
    for body in PEOPLE:
        standing = Body.of(turned(body, way))
        assert standing.left_is_left is True
        assert standing.stands_at_rest
        assert not standing.on_all_fours
        assert Body.of(crossed(standing.skeleton)).left_is_left is False


@pytest.mark.parametrize("body", PEOPLE, ids=lambda body: body.names[1])
def test_a_mirrored_body_has_its_names_on_the_wrong_sides(body):
    flipped = body.with_offsets(body.offsets * [-1, 1, 1])
    assert Body.of(flipped).left_is_left is False
    assert Body.of(crossed(flipped)).left_is_left is True


def test_the_motion_shows_left_and_right_where_the_rest_pose_does_not():
    body = rig("lafan1", "X")
    assert Body.of(body).left_is_left is None
    motion = posed(body, {}, np.zeros((3, 3)))
    assert Body.of(body, motion).left_is_left is None
    walk = sample("walk")
    bare = walk.skeleton.with_offsets(np.abs(walk.skeleton.offsets) @ np.ones((3, 3)) * [1, 0, 0])
    for named, agree in ((bare, True), (crossed(bare), False)):
        assert Body.of(named, walk).left_is_left is agree


def test_feet_without_toes_do_not_show_left_from_right():
    body = rig("xsens", "T")
    offsets = np.array(body.offsets)
    offsets[[joint for joint, name in enumerate(body.names) if "Toe" in name]] = 0.0
    bare = body.with_offsets(offsets)
    assert Body.of(bare).left_is_left is None


@pytest.mark.parametrize(
    ("angle", "pose"), [(-85, False), (-75, False), (-45, True), (0, True), (45, True), (90, True)]
)
def test_arms_may_hang_but_not_be_raised_along_the_trunk(angle, pose):
    for convention in ("mixamo", "xsens", "lafan1"):
        body = lowered(rig(convention, "T"), angle)
        assert Body.of(body).stands_at_rest is pose


def test_bones_along_one_axis_and_legs_across_the_trunk_are_no_pose():
    body = rig("lafan1", "X")
    assert not Body.of(body).stands_at_rest
    on_a_floor = folded(bent(LeftHip=-90, RightHip=-90)).skeleton
    assert not Body.of(on_a_floor).stands_at_rest
    body = rig("lafan1", "X")
    assert not Body.of(body).on_all_fours


@pytest.mark.parametrize("own_names", [True, False])
@ways
def test_dogs_go_on_all_fours(way, own_names):
    animal = turned(dog(own_names=own_names), way)
    for body in (Body.of(animal), Body.of(animal, posed(animal, {}, np.zeros((5, 3))))):
        assert body.anatomy is None or body.on_all_fours


def test_a_dog_with_the_names_of_people_is_taken_for_one_but_for_its_legs():
    animal = dog(own_names=False)
    assert Body.of(animal).anatomy is not None
    assert not Body.of(animal).stands_at_rest


@pytest.mark.parametrize(
    "motion", [CRAWLING, ON_HANDS_AND_FEET, SITTING], ids=["crawling", "on hands and feet", "sitting"]
)
def test_people_who_crawl_or_sit_are_not_on_all_fours_if_their_rest_pose_stands(motion):
    body = motion.skeleton
    assert not Body.of(body, motion).on_all_fours


def test_people_who_stand_up_are_not_on_all_fours_whatever_their_rest_pose():
    crawl = folded(ON_HANDS_AND_FEET)
    body = crawl.skeleton
    assert Body.of(body, crawl).on_all_fours
    upright = np.concatenate([crawl.positions, posed(person(), {}, np.zeros((2, 3))).positions])
    assert not Body.of(body, with_joints_at(body, upright)).on_all_fours


@needs_corpus
@pytest.mark.parametrize("name", ["cmu_daz/02_01", "cmu_mb/05_03", "makehuman/walk1", "pybvh/bvh_test2"])
def test_captured_people_are_recognised_with_left_and_right(name):
    motion = read_bvh(CORPUS / f"{name}.bvh")
    body = Body.of_motion(motion)
    assert body.anatomy.method == "names"
    assert body.stands_at_rest
    assert body.left_is_left is True
    assert not body.on_all_fours


# ---- up


@ups
@pytest.mark.parametrize("facing", [0, 90, 217])
def test_up_is_found_by_how_the_body_stands_in_motion(up, facing):
    turn = onto(up) * Rotation.from_euler("Y", facing, degrees=True)
    for motion in (in_world(sample("walk"), turn), moved(sample("walk"), turn)):
        assert Body.of_motion(motion).up_in_motion == up
        assert Body(motion.rigid_skeleton, None, motion).up_in_motion == up
    assert Body.of_motion(moved(sample("walk"), turn)).up_in_motion == up  # although the rest pose stands along Y
    assert Body.of(in_world(sample("walk"), turn).skeleton).up_at_rest == up


def test_a_lying_person_without_a_rest_pose_has_up_along_the_body():
    body = rig("lafan1", "X")
    assert Body.of(body).up_at_rest is None
    motion = retarget(sample("walk"), body).motion
    assert Body.of_motion(motion).up_in_motion == "Y"
    assert Body.of_motion(moved(motion, Rotation.from_euler("x", 90, degrees=True))).up_in_motion == "Z"


def test_without_anatomy_or_motion_no_up_is_found():
    body = person()
    bare = body.with_offsets(np.where(np.arange(len(body))[:, None] > 6, 0.0, body.offsets))
    assert Body(bare, None, posed(bare, {}, np.zeros((1, 3)))).up_in_motion is None
    assert Body.of(bare, posed(bare, {}, np.zeros((0, 3)))).up_in_motion is None
    assert Body(body, None).up_at_rest is None
    assert Body(body, None).up == "Y"
    assert Body.of(person(), posed(person(), {}, np.zeros((0, 3)))).motion is None


@needs_corpus
@pytest.mark.parametrize(
    ("file", "up"),
    [("cmu_mb/02_01.bvh", "Y"), ("animated_drawings/dab.bvh", "Z"), ("animated_drawings/jesse_dance.bvh", "Y")],
)
def test_the_legs_of_real_clips_show_up(file, up):
    motion = read_bvh(CORPUS / file)
    assert Body(motion.rigid_skeleton, None, motion).up_in_motion == up
    assert Body.of_motion(motion).up_in_motion == up


def test_the_legs_of_a_body_of_any_proportion_show_up():
    for seed in range(10):
        body = symmetric(other_lengths(person(), seed))
        assert Body(body, None, swaying(body, angle=0.2)).up_in_motion == "Y"


@ups
def test_a_given_up_comes_before_the_files_and_that_before_the_one_found(up):
    walk = sample("walk")
    assert Body.of_motion(walk).up == "Y"
    assert Body.of(walk.skeleton).up == "Y"
    assert Body.of(turned(walk.skeleton, onto(up))).up == up
    assert Body.of(replace(walk.skeleton, up=up), walk).up == up
    assert Body.of(replace(walk.skeleton, up="X"), walk).with_up(up).up == up
    np.testing.assert_array_equal(Body.of(walk.skeleton).with_up(up).up_vector, axis_vector(up))


def test_a_body_given_its_up_is_the_same_body():
    body = Body.of_motion(sample("walk"))
    assert body.with_up("Y") is body
    assert body.with_motion(sample("walk"), "Y") is body
    other = body.with_up("Z")
    assert other is not body
    assert (other.skeleton, other.anatomy, other.motion, other.up) == (body.skeleton, body.anatomy, body.motion, "Z")
    assert other.with_up("Z") is other


# ---- size


def test_known_sizes_of_bodies():
    body = Body.of(person())
    leg = 0.435 + 0.453
    assert (body.leg_length, body.unit) == (pytest.approx(leg), pytest.approx(2 * leg))
    assert body.height == pytest.approx(np.ptp(person().rest_positions[:, 1]))
    assert body.pelvis_joint == person().index("Hips")
    body = Body.of(lengthened(person(), {"Knee": 0.3, "Ankle": 0.3}))
    assert 2 * body.leg_length < 0.9 * body.height
    assert body.unit == body.height
    assert body.leg == body.leg_length
    body = Body.of(bent_chain())
    assert (body.legs, body.leg_length, body.pelvis_joint) == (None, 0.0, None)
    assert (body.height, body.unit, body.leg) == (2.0, 3.0, 1.5)


@ups
def test_height_is_the_same_in_any_world(up):
    for body in (person(), sample("walk").skeleton):
        assert Body.of(turned(body, onto(up))).height == pytest.approx(Body.of(body).height)


# ---- other versions


def test_a_mirrored_body_has_its_parts_on_the_other_side():
    body = Body.of(person())
    assert body.mirrored.left_is_left is False
    assert body.mirrored.legs == body.legs[::-1]
    assert body.mirrored.mirrored.anatomy.roles == body.anatomy.roles
    nothing = Body(person(), None)
    assert nothing.mirrored.anatomy is None


# ---- values that are computed once


def test_joints_above_the_hips_are_no_part_of_the_body():
    assert Body.of(person()).above_hips == ()
    assert Body.of(on_a_root(posed(person(), {}, np.zeros((1, 3))), "root").skeleton).above_hips == (0,)
    unreal = rig("unreal", "A")
    assert [unreal.names[joint] for joint in Body.of(unreal).above_hips] == ["root"]


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]])


def with_box(target, name, to, length, thick=0.03):
    """The target with a box that one joint moves, from that joint's place along `to` [m]."""
    mesh, joint = target.mesh(), target.skeleton.names.index(name)
    along = np.array(to) / np.linalg.norm(to)
    aside = np.cross(along, [0.1, 0.9, 0.3])
    aside /= np.linalg.norm(aside)
    axes = np.stack([length * along, thick * aside, thick * np.cross(along, aside)])
    count, corners = len(mesh.vertices), target.skeleton.rest_positions[joint] + CORNERS @ axes
    joints, weights = (np.zeros((len(corners), mesh.joints.shape[1]), kind) for kind in (np.intp, float))
    joints[:], weights[:, 0] = joint, 1.0
    boxed = replace(
        mesh,
        vertices=np.vstack([mesh.vertices, corners]),
        joints=np.vstack([mesh.joints, joints]),
        weights=np.vstack([mesh.weights, weights]),
        triangles=np.vstack([mesh.triangles, FACES + count]),
        looks=Looks((), np.full(len(mesh.triangles) + len(FACES), -1), np.zeros((count + len(corners), 2))),
    )
    return replace(target, mesh=lambda: boxed)


def bare(target):
    return bare_mesh(Body.of(target.skeleton, target.motion), target.mesh())


def test_a_body_that_holds_nothing_keeps_its_mesh():
    assert bare(sample_target("hero")) is sample_target("hero").mesh()


@pytest.mark.parametrize("name", ["RightHand", "LeftHand"])
def test_a_sword_that_moves_with_the_hand_is_left_out_and_shown(name):
    armed = with_box(sample_target("hero"), name, [0.0, 0.3, 1.0], 0.9)
    mesh = bare(armed)
    for field in ("vertices", "joints", "weights", "triangles"):
        np.testing.assert_array_equal(getattr(mesh, field), getattr(sample_target("hero").mesh(), field))
    assert len(mesh.looks.of_triangle) == len(mesh.triangles)
    assert mesh.whole is armed.mesh()


@pytest.mark.parametrize(("name", "length"), [("RightHand", 0.15), ("Spine2", 0.9), ("RightForeArm", 0.15)])
def test_a_glove_a_bracelet_and_what_the_back_carries_are_parts_of_the_body(name, length):
    worn = with_box(sample_target("hero"), name, [0.0, 0.3, 1.0], length)
    assert bare(worn) is worn.mesh()


def test_a_sword_changes_neither_capsules_nor_the_clap():
    armed = with_box(sample_target("hero"), "RightHand", [0.0, 0.3, 1.0], 0.9)
    plain, held = target_capsules(sample_target("hero")), target_capsules(armed)
    np.testing.assert_array_equal(plain.radii, held.radii)
    np.testing.assert_array_equal(plain.ends, held.ends)
    clap = sample("clap")
    without, result = retarget(clap, sample_target("hero")), retarget(clap, armed)
    np.testing.assert_array_equal(result.motion.rotations, without.motion.rotations)
    assert result.metrics == without.metrics


def test_parts_have_joints_by_their_names_and_by_keys():
    body = Body.of(distretarget.load_target(HERO).skeleton)
    keys, regions = body.skeleton.keys, body.regions
    assert keys[body.joint_of("left forearm")] == "LeftForeArm"
    assert keys[body.joint_of("right thigh")] == "RightUpLeg"
    assert keys[body.joint_of("hips")] == "Hips"
    assert body.joint_of("RightFoot") == keys.index("RightFoot")
    assert body.joint_of("left wing") is body.joint_of("") is None
    for number, name in enumerate(regions.names):
        assert regions.of_joint[body.joint_of(name)] == number
