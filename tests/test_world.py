"""Axes, units and the root's OFFSET: the same posture in another world, with its feet on the floor."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, SAMPLES, in_world, moved, onto, person, posed, short_walk, spun
from scipy.spatial.transform import Rotation
from zoo import CONVENTIONS, rig

from distretarget import Body, Options, diff, load_target, read_bvh, retarget
from distretarget.baseline.world import World, find_root_offset, with_root_offset
from distretarget.body.axes import axis_vector
from distretarget.skeleton import AXES

INCH = 2.54  # cm
UNITS = {"mm": 10.0, "cm": 1.0, "m": 0.01, "inches": 1 / INCH}
Y = axis_vector("Y")

ups = pytest.mark.parametrize("up", AXES)
conventions = pytest.mark.parametrize("convention", CONVENTIONS)


def heading(motion):
    """(3,), the horizontal unit vector from the root's first position to its last."""
    way = motion.root_positions[-1] - motion.root_positions[0]
    return way / np.linalg.norm(way)


def near(found, expected, relative=1e-6):
    size = np.ptp(expected, axis=(0, 1)).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * size)


def test_y_up_and_facing_z_becomes_z_up_and_facing_minus_y_and_back():
    there = World("Y", "Z", "replaced").turned(short_walk())
    np.testing.assert_allclose(spun(onto("Z"), [0, 0, 1]), [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(heading(there), spun(onto("Z"), heading(short_walk())), atol=1e-12)
    assert heading(there)[1] < -0.99
    back = World("Z", "Y", "replaced").turned(there)
    np.testing.assert_allclose(back.positions, short_walk().positions, atol=1e-9)
    assert World("X", "X", "replaced").turned(short_walk()) is short_walk()


@ups
def test_turning_keeps_postures(up):
    there = World("Y", up, "replaced").turned(short_walk())
    np.testing.assert_allclose(there.positions @ axis_vector(up), short_walk().positions @ Y, atol=1e-9)
    np.testing.assert_allclose(there.rotations[:, 1:], short_walk().rotations[:, 1:])


def test_inches_with_z_up_onto_centimetres_with_y_up_and_back():
    source = in_world(short_walk(), onto("Z"), 1 / INCH)
    body = short_walk().skeleton
    there = retarget(source, replace(body, up="Y", units="cm"))
    assert (there.world.source_up, there.world.up) == ("Z", "Y")
    near(there.motion.positions, short_walk().positions)
    assert heading(there.motion)[2] > 0.99
    back = retarget(there.motion, source.skeleton)
    assert (back.world.source_up, back.world.up) == ("Y", "Z")
    near(back.motion.positions, source.positions)
    assert heading(back.motion)[1] < -0.99


@conventions
def test_postures_and_heading_on_another_body(convention):
    body = rig(convention, "A")
    plain = retarget(short_walk(), body)
    other = retarget(in_world(short_walk(), onto("Z"), 1 / INCH), body)
    near(other.motion.positions, plain.motion.positions, 1e-5)
    ahead = heading(other.motion)
    assert ahead @ (axis_vector("-Y") if body.up == "Z" else axis_vector("Z")) > 0.99


@pytest.mark.parametrize(
    ("unit", "target_unit"), [("mm", "m"), ("m", "mm"), ("cm", "inches"), ("inches", "cm"), ("m", "m")]
)
def test_units_do_not_matter(unit, target_unit):
    body = rig("lafan1", "T")
    scale = UNITS[target_unit]
    source = in_world(short_walk(), Rotation.identity(), UNITS[unit])
    result = retarget(source, body.with_offsets(scale * body.offsets))
    near(result.motion.positions, scale * retarget(short_walk(), body).motion.positions)


@ups
def test_a_given_axis_is_the_one_that_would_be_found(up):
    source, body = in_world(short_walk(), onto(up)), replace(rig("xsens", "T"), up="Y")
    found, given = retarget(source, body), retarget(source, body, Options(source_up=up))
    assert found.world == given.world
    np.testing.assert_array_equal(found.motion.positions, given.motion.positions)
    near(found.motion.positions, retarget(short_walk(), body).motion.positions, 1e-5)


@ups
def test_the_targets_axis_may_be_given(up):
    result = retarget(short_walk(), short_walk().skeleton, Options(target_up=up))
    assert result.world.up == up
    near(result.motion.positions, World("Y", up, "replaced").turned(short_walk()).positions)


def test_one_frame_is_enough():
    motion = short_walk()
    for up in AXES:
        frame = in_world(motion[:1], onto(up))
        assert Body.of_motion(frame).up_in_motion == up
        near(retarget(frame, replace(motion.skeleton, up="Y")).motion.positions, motion.positions[:1])


@pytest.mark.parametrize("up", ["X", "Y", "Z", "-X"])
@pytest.mark.parametrize("clip", ["cartwheel", "crawl"])
def test_a_body_that_stands_in_few_frames_shows_its_axis_by_them_or_by_its_floor(up, clip):
    """The rest pose stands along Y in any world, as in data sets of SMPL."""
    motion = moved(read_bvh(SAMPLES / "supports" / f"{clip}.bvh")[::3], onto(up))
    assert Body.of_motion(motion).up_in_motion == up


def lying(axis, **bends):
    """A person who lies on the floor, turned there about an axis, with joints bent about the axis from side to side
    [degrees].
    """
    turns = {name: np.radians([angle, 0, 0]) for name, angle in bends.items()}
    return posed(person(), turns | {"Hips": np.pi / 2 * axis_vector(axis)}, np.tile([0.0, 0.1, 0.0], (5, 1)))


@pytest.mark.parametrize("up", ["Y", "-X"])
@pytest.mark.parametrize("axis", ["X", "Z"])
@pytest.mark.parametrize(
    "bends",
    [{}, {"LeftHip": -100, "RightHip": -100, "LeftKnee": 90, "RightKnee": 90}, {"LeftHip": -90, "RightHip": -90}],
    ids=["straight", "knees up", "legs up"],
)
def test_a_lying_person_has_the_up_of_the_rest_pose(up, axis, bends):
    motion = lying(axis, **bends)
    source = in_world(motion, onto(up))
    assert Body.of_motion(source).up_in_motion == up
    near(retarget(source, replace(person(), up="Y")).motion.positions, motion.positions)


@pytest.mark.parametrize("up", ["Y", "-X"])
def test_a_person_who_stands_and_then_falls_on_the_face_has_the_up_of_the_rest_pose(up):
    """It lies four times as long as it stands, with its feet near the origin, and no joint is at the floor."""
    falls = np.repeat([0.0, np.pi / 2], [10, 40])
    root = np.where(falls[:, None] > 0, [0.0, 0.07, 0.9], [0.0, 0.96, 0.0])
    motion = posed(person(), {"Hips": np.outer(falls, axis_vector("X"))}, root)
    assert Body.of_motion(in_world(motion, onto(up))).up_in_motion == up


@pytest.mark.parametrize("height", [-150.0, -30.0, -10.0, 0.0, 10.0, 30.0])
def test_a_source_that_stays_off_height_0_is_warned_of(height):
    result = retarget(moved(short_walk(), Rotation.identity(), (0.0, height, 0.0)), rig("mixamo", "A"))
    lines = [line for line in result.warnings if line.startswith("the source stays")]
    assert len(lines) == (abs(height) == 30.0 or height == -150.0)
    if lines:
        side = "above" if height > 0.0 else "below"
        assert lines[0].endswith(f"% of a leg {side} height 0, and the result with it")
        number = float(lines[0].split()[3])
        assert number == pytest.approx(100.0 * abs(height) / result.matching.source.leg_length, abs=6.0)


def with_offset(motion, rise, *, added):
    """The motion of a body whose root has an OFFSET; its channels are added to it or replace it."""
    body = motion.skeleton
    offsets = np.array(body.offsets)
    offsets[0] = rise * Y
    path = motion.root_positions - added * offsets[0]
    return replace(motion, skeleton=body.with_offsets(offsets), root_positions=path)


@ups
@pytest.mark.parametrize("added", [True, False])
def test_the_feet_show_whether_the_root_offset_is_added_or_replaced(up, added):
    motion = with_offset(short_walk(), 92.0, added=added)
    source = in_world(motion, onto(up))
    assert find_root_offset(Body.of_motion(source), axis_vector(up)) == ("added" if added else "replaced")
    result = retarget(source, replace(short_walk().skeleton, up="Y"))
    near(result.motion.positions, short_walk().positions)


def test_an_offset_that_feet_do_not_speak_for_is_replaced():
    high = moved(short_walk(), Rotation.identity(), (0, 300, 0))
    for rise in (0.0, 50.0, 92.0):
        assert find_root_offset(Body.of_motion(with_offset(high, rise, added=False)), Y) == "replaced"
    assert find_root_offset(Body.of_motion(with_offset(short_walk(), 4.0, added=False)), Y) == "replaced"
    motion = with_offset(short_walk(), 92.0, added=True)
    channels = (motion.skeleton.channels[1], *motion.skeleton.channels[1:])
    fixed = replace(motion, skeleton=replace(motion.skeleton, channels=channels))
    assert find_root_offset(Body.of_motion(fixed), Y) == "replaced"


@pytest.mark.parametrize(("height", "added"), [(0.05, True), (0.15, False)])
def test_feet_are_on_the_floor_up_to_a_tenth_of_a_leg_above_it(height, added):
    """A thick sole or a toe without an End Site is no flight; `height` is in leg lengths."""
    leg = Body.of_motion(short_walk()).leg_length
    raised = moved(short_walk(), Rotation.identity(), (0, height * leg, 0))
    found = find_root_offset(Body.of_motion(with_offset(raised, 92.0, added=True)), Y)
    assert found == ("added" if added else "replaced")


def test_a_given_meaning_counts():
    motion = with_offset(short_walk(), 92.0, added=False)
    result = retarget(motion, short_walk().skeleton, Options(root_offset="added"))
    near(result.motion.positions, short_walk().positions + 92.0 * Y)
    np.testing.assert_allclose(with_root_offset(motion).root_positions, short_walk().root_positions + 92.0 * Y)


def test_bodies_that_look_the_other_way_by_convention_turn_round():
    clip = short_walk()
    back = replace(clip.skeleton, faces_negative_z=True)
    result = retarget(clip, back)
    half = Rotation.from_euler("Y", 180, degrees=True)
    near(result.motion.positions, half.apply(clip.positions.reshape(-1, 3)).reshape(clip.positions.shape))
    same = retarget(replace(clip, skeleton=back), back)
    near(same.motion.positions, clip.positions)


def soles(target, motion):
    """How high the lowest joint of the feet is above the floor, (frames,), and in the bind pose."""
    skeleton = target.skeleton
    feet = [joint for joint, name in enumerate(skeleton.names) if "Foot" in name or "Toe" in name]
    bind = (skeleton.rest_positions + skeleton.offsets[0])[feet, 1].min()
    return motion.positions[:, feet, 1].min(axis=1), bind


@pytest.mark.parametrize("rise", [0.0, -4.0, 9.0])
@pytest.mark.parametrize("clip", ["walk", "clap", "squat"])
def test_flat_feet_are_as_high_as_in_the_bind_pose(clip, rise):
    source = read_bvh(SAMPLES / f"{clip}.bvh")[:120]
    source = replace(source, root_positions=np.add(source.root_positions, [0.0, rise, 0.0]))
    target = load_target(HERO)
    result = retarget(source, target, Options(skin="none"))
    heights, bind = soles(target, result.motion)
    assert np.median(heights) == pytest.approx(bind, abs=0.002)
    assert result.metrics["result"]["foot_height"] < 0.2
    assert diff(source, result.motion).metrics["result"]["foot_height"] < 0.2


def test_a_clip_without_a_floor_stays_where_it_is():
    source = read_bvh(SAMPLES / "clap.bvh")[:40]
    source = replace(source, root_positions=np.add(source.root_positions, [0.0, 60.0, 0.0]))
    target = load_target(HERO)
    result = retarget(source, target)
    np.testing.assert_array_equal(result.source.root_positions, source.root_positions)


def test_other_targets_have_no_floor():
    target = load_target(HERO)
    bare = replace(target.skeleton, floor_at_zero=False)
    source = read_bvh(SAMPLES / "clap.bvh")[:40]
    np.testing.assert_array_equal(retarget(source, bare).source.root_positions, source.root_positions)


def test_legs_without_length_are_no_legs():
    skeleton = load_target(HERO).skeleton
    legs = [joint for joint, name in enumerate(skeleton.names) if name.endswith(("Leg", "Foot")) and "Up" not in name]
    offsets = np.array(skeleton.offsets)
    offsets[legs] = 0.0
    body = Body.of(skeleton.with_offsets(offsets))
    assert body.legs is None
    assert body.unit > 0


@pytest.mark.parametrize(("factor", "line"), [(2.54, "172 % of a leg above"), (0.01, "108 % of a leg below")])
def test_a_path_in_other_units_than_the_body_leaves_the_floor_and_is_named(factor, line):
    walk = read_bvh(SAMPLES / "walk.bvh")[::3]
    result = retarget(replace(walk, root_positions=factor * walk.root_positions), rig("mixamo", "T"))
    assert f"the source stays {line} height 0, and the result with it" in result.warnings
