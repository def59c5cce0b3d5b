"""Which way a body faces, whether it stands, and whether it is a person at all."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from animals import dog
from bodies import CORPUS, SAMPLES, needs_corpus, person, posed
from make_rigs import CONVENTIONS, rig
from scipy.spatial.transform import Rotation

from distretarget import read_bvh
from distretarget.body.axes import body_axes, is_pose, on_all_fours, sides_agree, toe_bone
from distretarget.body.conventions import by_names
from distretarget.body.shape import by_shape

SIDES = [("Left", "Right"), ("_l", "_r")]
# The 24 ways to stand along the axes, and two that are oblique.
WAYS = [
    *Rotation.create_group("O"),
    Rotation.from_euler("Y", 140, degrees=True),
    Rotation.from_euler("XYZ", [20, 50, 70], degrees=True),
]
PEOPLE = [person(), *(rig(convention, pose) for convention, pose in itertools.product(CONVENTIONS, "TA"))]

ways = pytest.mark.parametrize("way", WAYS, ids=[f"way{k}" for k in range(len(WAYS))])


def turned(body, turn):
    """The rest pose turned in the world."""
    return body.with_offsets(turn.apply(np.array(body.offsets)))


def crossed(body):
    """The body with the names of left and right exchanged."""
    return replace(body, names=tuple(map(_crossed, body.names)))


def _crossed(name):
    for pair in SIDES:
        for one, other in (pair, pair[::-1]):
            if one in name and (one in ("Left", "Right") or name.removesuffix("_End").endswith(one)):
                return name.replace(one, other)
    return name


def armed(body, angle):
    """The body with its arms turned down from the horizontal [degrees]."""
    anatomy = by_names(body)
    offsets = np.array(body.offsets)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = {anatomy.roles[f"{side}UpperArm"]}
        turn = Rotation.from_rotvec([0, 0, -sign * np.radians(angle)])
        for joint in range(len(body)):
            if body.parents[joint] in arm:
                arm.add(joint)
                offsets[joint] = turn.apply(offsets[joint])
    return body.with_offsets(offsets)


def bent(**angles):
    """A person with joints turned forwards about the axis from side to side [degrees]."""
    turns = {name: np.radians([angle, 0, 0]) for name, angle in angles.items()}
    return posed(person(), turns, np.tile([0.0, 0.5, 0.0], (5, 1)))


CRAWLING = bent(Hips=90, LeftHip=-90, RightHip=-90, LeftKnee=90, RightKnee=90)
ON_HANDS_AND_FEET = bent(Hips=90, LeftHip=-90, RightHip=-90)
SITTING = bent(LeftHip=-90, RightHip=-90, LeftKnee=90, RightKnee=90)


def folded(motion):
    """The motion on the same body with the posture of its first frame as its rest pose, and no rotations."""
    world = motion.positions[0]
    body = motion.skeleton.with_offsets(
        world - world[motion.skeleton.parents] * (motion.skeleton.parents >= 0)[:, None]
    )
    return posed(body, {}, motion.root_positions)


@cache
def sample(name):
    return read_bvh(SAMPLES / f"{name}.bvh")


@ways
def test_left_is_left_whichever_way_a_body_stands(way):
    for body in PEOPLE:
        standing = turned(body, way)
        assert sides_agree(standing, by_names(standing), None) is True
        assert sides_agree(crossed(standing), by_names(crossed(standing)), None) is False


@pytest.mark.parametrize("body", PEOPLE, ids=lambda body: body.names[1])
def test_a_mirrored_body_has_its_names_on_the_wrong_sides(body):
    flipped = body.with_offsets(body.offsets * [-1, 1, 1])
    assert sides_agree(flipped, by_names(flipped), None) is False
    assert sides_agree(crossed(flipped), by_names(crossed(flipped)), None) is True


@ways
def test_the_axes_of_a_body_turn_with_it(way):
    for body in PEOPLE[:3]:
        anatomy = by_names(body)
        axes, there = (body_axes(anatomy, b.rest_positions) for b in (body, turned(body, way)))
        np.testing.assert_allclose(there, way.as_matrix() @ axes, atol=1e-12)
        np.testing.assert_allclose(axes[:, 0], [1, 0, 0], atol=1e-6)
        assert axes[1, 1] > 0.98
        assert axes[2, 2] > 0.98


def test_the_motion_tells_left_from_right_where_the_rest_pose_does_not():
    body = rig("lafan1", "X")
    assert sides_agree(body, by_names(body), None) is None
    motion = posed(body, {}, np.zeros((3, 3)))
    assert sides_agree(body, by_names(body), motion.positions) is None
    walk = sample("walk")
    bare = walk.skeleton.with_offsets(np.abs(walk.skeleton.offsets) @ np.ones((3, 3)) * [1, 0, 0])
    for named, agree in ((bare, True), (crossed(bare), False)):
        assert sides_agree(named, by_names(named), walk.positions) is agree


def test_feet_without_toes_tell_nothing():
    body = rig("xsens", "T")
    offsets = np.array(body.offsets)
    offsets[[joint for joint, name in enumerate(body.names) if "Toe" in name]] = 0.0
    bare = body.with_offsets(offsets)
    assert toe_bone(bare, by_names(bare), "left") is None
    assert sides_agree(bare, by_names(bare), None) is None


def test_the_toe_bone_goes_to_the_toes():
    body = rig("mixamo", "T")
    foot, toe = toe_bone(body, by_names(body), "left")
    assert (body.names[foot], body.names[toe]) == ("mixamorig:LeftFoot", "mixamorig:LeftToeBase")


@ways
def test_people_stand_in_their_rest_poses(way):
    for body in PEOPLE:
        assert is_pose(turned(body, way), by_names(body))


@pytest.mark.parametrize(
    ("angle", "pose"), [(-85, False), (-75, False), (-45, True), (0, True), (45, True), (90, True)]
)
def test_arms_may_hang_but_not_be_raised_along_the_trunk(angle, pose):
    for convention in ("mixamo", "xsens", "lafan1"):
        body = armed(rig(convention, "T"), angle)
        assert is_pose(body, by_names(body)) is pose


def test_bones_along_one_axis_and_legs_across_the_trunk_are_no_pose():
    body = rig("lafan1", "X")
    assert not is_pose(body, by_names(body))
    on_a_floor = folded(bent(LeftHip=-90, RightHip=-90)).skeleton
    assert not is_pose(on_a_floor, by_names(on_a_floor))


@pytest.mark.parametrize("own_names", [True, False])
@ways
def test_dogs_go_on_all_fours(way, own_names):
    animal = turned(dog(own_names=own_names), way)
    anatomy = by_names(animal) or by_shape(animal, None)
    assert anatomy is None or on_all_fours(animal, anatomy, None)
    walking = posed(animal, {}, np.zeros((5, 3))).positions
    assert anatomy is None or on_all_fours(animal, anatomy, walking)


def test_a_dog_with_the_names_of_people_is_taken_for_one_but_for_its_legs():
    animal = dog(own_names=False)
    assert by_names(animal) is not None
    assert not is_pose(animal, by_names(animal))


@ways
def test_people_do_not_go_on_all_fours_by_their_rest_poses(way):
    for body in PEOPLE:
        standing = turned(body, way)
        assert not on_all_fours(standing, by_names(standing), None)


@pytest.mark.parametrize(
    "motion", [CRAWLING, ON_HANDS_AND_FEET, SITTING], ids=["crawling", "on hands and feet", "sitting"]
)
def test_people_who_crawl_or_sit_do_not_where_their_rest_pose_stands(motion):
    body = motion.skeleton
    assert not on_all_fours(body, by_names(body), motion.positions)


def test_people_who_get_up_once_do_not_whatever_their_rest_pose():
    crawl = folded(ON_HANDS_AND_FEET)
    body = crawl.skeleton
    assert on_all_fours(body, by_names(body), crawl.positions)
    upright = np.concatenate([crawl.positions, posed(person(), {}, np.zeros((2, 3))).positions])
    assert not on_all_fours(body, by_names(body), upright)


def test_a_rest_pose_that_is_none_tells_nothing_of_legs():
    body = rig("lafan1", "X")
    assert not on_all_fours(body, by_names(body), None)


@needs_corpus
@pytest.mark.parametrize("name", ["cmu_daz/02_01", "cmu_mb/05_03", "makehuman/walk1", "pybvh/bvh_test2"])
def test_recorded_people_are_people_who_know_left_from_right(name):
    motion = read_bvh(CORPUS / f"{name}.bvh")
    body = motion.rigid_skeleton
    anatomy = by_names(body)
    assert is_pose(body, anatomy)
    assert sides_agree(body, anatomy, motion.positions) is True
    assert not on_all_fours(body, anatomy, motion.positions)
