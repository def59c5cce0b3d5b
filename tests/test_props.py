"""Props: where they go, what their files show of their surfaces, and limbs that keep off them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, lengthened, moved, sample, sample_target, with_bone
from bvh_texts import format_bvh
from sample_scenes import SCENES, standing_prop
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from distretarget import (
    BvhError,
    Grip,
    Motion,
    MotionError,
    Prop,
    SettingsError,
    SkeletonError,
    prop_of,
    retarget_scene,
)
from distretarget.io.bvh import parse_bvh
from distretarget.io.obj import MOST_POINTS, parse_obj, static_prop
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.contact_terms import DIRECTION_RANGE, TOUCH
from distretarget.scene.contacts import NEAREST, ContactPoints, find_prop_contacts
from distretarget.scene.props import PropSurface, nearest_on_bones
from distretarget.scene.scene_file import load_scene
from distretarget.scene.skin import Bodies, PropShape
from distretarget.skin.capsules import SEGMENTS


@cache
def drummer():
    (motion,) = SCENES["drum_on_table"]().performers.values()
    return motion


@cache
def child():
    return sample_target("child").for_source(drummer().skeleton).skeleton


def with_stick(motion):
    """The performer with a stick fixed to the right hand."""
    skeleton = with_bone(motion.skeleton, "Stick", "RightWrist")
    skeleton = with_bone(skeleton, "StickTip", "Stick")
    skeleton = skeleton.with_offsets([*motion.skeleton.offsets, [-8.0, 0.0, 0.0], [-30.0, 5.0, 10.0]])
    rotations = np.concatenate([motion.rotations, np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), 2, 1))], axis=1)
    return Motion(skeleton, motion.root_positions, rotations, motion.frame_time_text)


def test_a_prop_is_a_motion_of_its_own():
    source = with_stick(drummer())
    stick = prop_of(source, "Stick")
    assert stick.skeleton.names == ("Stick", "StickTip")
    np.testing.assert_allclose(stick.positions, source.positions[:, -2:], atol=1e-9)


def test_a_prop_stays_in_the_hand_that_holds_it():
    source = with_stick(drummer())
    stick = Prop(name="stick", motion=prop_of(source, "Stick"), held_by=(Grip(0, "RightWrist"),))
    done = retarget_scene([source], [child()], [stick])
    (body,), (prop,) = done.results, done.props
    hand = body.motion.skeleton.index("RightWrist")
    grip = np.linalg.norm(prop.motion.positions[:, 0] - body.motion.positions[:, hand], axis=1)
    np.testing.assert_allclose(grip, prop.scale * 8.0, rtol=1e-5)
    in_hand = (
        Rotation.from_quat(body.motion.world_rotations[:, hand])
        .inv()
        .apply(prop.motion.positions[:, 1] - body.motion.positions[:, hand])
    )
    assert np.ptp(in_hand, axis=0).max() < 1e-5 * body.matching.target.height


def test_a_prop_follows_the_performer_who_holds_it():
    """Also if that is not the first of the scene."""
    holder = with_stick(moved(drummer(), Rotation.identity(), shift=(400.0, 0.0, 0.0)))
    stick = Prop(name="stick", motion=prop_of(holder, "Stick"), scale=1, held_by=(Grip(1, "RightWrist"),))
    done = retarget_scene([drummer(), holder], [drummer().skeleton, child()], [stick])
    hand = done.results[1].motion.positions[:, child().index("RightWrist")]
    grip = np.linalg.norm(done.props[0].motion.positions[:, 0] - hand, axis=1)
    np.testing.assert_allclose(grip, done.props[0].scale * 8.0, rtol=1e-5)


def test_what_one_hand_holds_does_not_move_the_hand():
    """The prop follows the hand, and not the other way round: the performer moves as without it."""
    source = drummer()
    ball = with_bone(source.skeleton, "Ball", "RightWrist")
    ball = ball.with_offsets([*source.skeleton.offsets, [-8.0, 0.0, 0.0]])
    rotations = np.concatenate([source.rotations, np.tile([0.0, 0.0, 0.0, 1.0], (len(source), 1, 1))], axis=1)
    with_ball = Motion(ball, source.root_positions, rotations, source.frame_time_text)
    held = Prop(name="ball", motion=prop_of(with_ball, "Ball"), held_by=(Grip(0, "RightWrist"),))
    alone, holding = (retarget_scene([source], [child()], props).results[0].motion for props in ((), (held,)))
    np.testing.assert_allclose(holding.positions, alone.positions, atol=1e-9)


def test_a_staff_lies_in_the_line_of_the_two_hands_that_hold_it():
    """Where hands are matters far more than how each is turned: arms of other lengths would turn the staff askew."""
    scene = SCENES["staff"]()
    (source,) = scene.performers.values()
    done = retarget_scene([source], [lengthened(source.rigid_skeleton, {"Elbow": 1.4, "Collar": 1.5})], scene.props)
    (staff,), body = done.props, done.results[0].motion
    hands = np.subtract(*(body.positions[:, body.skeleton.index(f"{side}Wrist")] for side in ("Left", "Right")))
    along = staff.motion.positions[:, -1] - staff.motion.positions[:, 0]
    cosines = np.abs((hands * along).sum(axis=1)) / np.linalg.norm(hands, axis=1) / np.linalg.norm(along, axis=1)
    assert np.degrees(np.arccos(np.minimum(cosines, 1.0))).max() < 0.5


def test_a_hand_that_rests_on_a_prop_rests_where_the_prop_is():
    """A wall that is a prop has a place in the target's world; without it the hand rests where the body has it."""
    source = sample("supports/hand_on_wall")[::2]
    hand = np.median(source.positions[:, source.skeleton.index("RightWrist")], axis=0)
    wall = Prop(name="wall", motion=standing_prop("wall", hand + 5.0 * (np.eye(3) - 1 / 3)), scale=0.8)
    done = retarget_scene([source], [child()], [wall])
    held, joint = done.results[0].supports, child().index("RightWrist")
    column = held.joints.tolist().index(joint)
    rests = held.weights[:, column] > 0.99
    assert rests.sum() > 60
    off = np.linalg.norm(held.places[rests, column] - done.props[0].motion.positions[rests].mean(axis=1), axis=1)
    assert np.median(off) < 0.5  # [cm]


def test_feet_that_stand_are_not_drawn_to_props_beside_them():
    """They have places of their own on the floor."""
    box = Prop(name="box", motion=standing_prop("box", np.array([[x, 5.0, z] for x in (-12, 12) for z in (0, 15)])))
    alone, beside = (retarget_scene([drummer()], [child()], props).results[0].motion for props in ((), (box,)))
    np.testing.assert_allclose(beside.positions, alone.positions, atol=1e-9)


def touching(distances, regions, reach=0.5):
    """The stiffness, (points,), of joints at these distances [leg lengths] from a prop of one point."""
    source = np.array(distances)[None, :, None] * np.array([1.0, 0.0, 0.0])
    numbers, ones = np.arange(len(distances)), np.ones(len(distances))
    points = ContactPoints(numbers, np.array(regions), source, ones, ones, np.zeros(1, np.intp))
    settings = ContactSettings(reach=reach)
    found = find_prop_contacts(points, np.zeros((1, 1, 3)), 1.0, np.ones((1, len(distances))), 0.02, settings)
    np.testing.assert_array_equal(found.joints, numbers)
    return found.A[0, :, 0, 0]


def test_joints_of_one_region_share_their_hold_on_a_prop_and_those_of_others_do_not():
    """A hand with many finger joints is drawn to a table about as strongly as one without."""
    (one,) = touching([0.0], [0])
    np.testing.assert_allclose(touching([0.0, 0.0], [0, 1]), one)
    several = touching([0.0] * 16, [0] * 16)
    assert one < several.sum() < 6 * one
    np.testing.assert_allclose(several, several[0])
    distance = 2.0 * DIRECTION_RANGE  # [leg lengths]
    near, far = touching([0.0], [0])[0], touching([distance], [0])[0]
    as_of_joints = TOUCH / (TOUCH + distance) * NEAREST / (NEAREST + distance)
    assert far == pytest.approx(0.5 * as_of_joints * near)


def test_a_prop_that_nobody_holds_stands_still_in_its_own_size():
    box = Prop(name="box", motion=standing_prop("box", np.array([[40, 0, 60], [60, 0, 60], [50, 30, 60]])), scale=1.0)
    points = box.motion.positions[0]
    done = retarget_scene([drummer()], [child()], [box])
    (prop,) = done.props
    assert len(prop.motion) == len(drummer())
    assert np.ptp(prop.motion.positions, axis=0).max() == 0
    scale = done.world_scale
    middle = points.mean(axis=0)
    expected = points - middle + middle * [scale, 1.0, scale]
    np.testing.assert_allclose(prop.motion.positions[0], expected, atol=1e-9)


@pytest.mark.parametrize("performer", [0, 1])
def test_a_prop_may_have_the_scale_of_either_performer(performer):
    """The number names the performer whose size the prop follows, such as the one whose chair it is."""
    box = Prop(name="box", motion=standing_prop("box", np.array([[0, 0, 90], [20, 0, 90]])), scale=performer)
    sources = [drummer(), moved(drummer(), Rotation.identity(), shift=(400.0, 0.0, 0.0))]
    done = retarget_scene(sources, [child(), drummer().skeleton], [box])
    small, large = (one.root_scale for one in done.results)
    assert small < 0.7 * large
    assert done.props[0].scale == pytest.approx((small, large)[performer])
    size = np.linalg.norm(np.subtract(*done.props[0].motion.positions[0]))
    assert size == pytest.approx(20 * (small, large)[performer])


def test_a_scene_with_a_prop_that_is_turned_has_the_same_result():
    scene = SCENES["staff"]()
    (source,), (staff,) = scene.performers.values(), scene.props
    turn, shift = Rotation.from_euler("Y", 110, degrees=True), (200.0, 0.0, 50.0)
    done = retarget_scene([source], [child()], [staff])
    elsewhere = retarget_scene(
        [moved(source, turn, shift)], [child()], [replace(staff, motion=moved(staff.motion, turn, shift))]
    )
    for one, other in ((done.results[0], elsewhere.results[0]), (done.props[0], elsewhere.props[0])):
        expected = turn.apply(one.motion.positions.reshape(-1, 3)) + done.world_scale * np.array(shift)
        assert np.abs(expected - other.motion.positions.reshape(-1, 3)).max() < 1e-4 * child().longest_path


def test_props_that_cannot_be_are_refused():
    prop = Prop(name="box", motion=standing_prop("box", np.ones((1, 3))))
    for wrong, error, words in (
        ({"scale": 3}, SettingsError, "scale of performer 3"),
        ({"held_by": (Grip(2, "RightWrist"),)}, SettingsError, "held by performer 2"),
        ({"held_by": (Grip(0, "RightWrst"),)}, SkeletonError, "RightWrist"),
        ({"held_by": (Grip(0, "Stick"),)}, SettingsError, "drives no joint"),
    ):
        with pytest.raises(error, match=words):
            retarget_scene([with_stick(drummer())], [child()], [replace(prop, **wrong)])
    for scale in (0.0, -1.0, "big", True):
        with pytest.raises(SettingsError, match="the scale of 'box'"):
            replace(prop, scale=scale)


@pytest.mark.parametrize("held_by", [(), (Grip(0, "RightWrist"),)], ids=["free", "held"])
def test_props_too_large_to_compute_with_are_refused(held_by):
    box = standing_prop("box", np.array([[40.0, 0.0, 60.0], [60.0, 0.0, 60.0]]))
    with pytest.raises(MotionError, match=r"'box' reaches beyond 1e\+12 with a scale of 1e\+12; choose a smaller"):
        Prop(name="box", motion=box, scale=1e12, held_by=held_by)
    with pytest.raises(MotionError, match=r"'box' reaches beyond 1e\+12 with a scale of 1e\+12; choose a smaller"):
        retarget_scene([drummer()], [child()], [Prop(name="box", motion=box, held_by=held_by)], world_scale=1e12)
    for far in (1e13, 1e300):
        with pytest.raises(MotionError, match=r"'box' has positions beyond 1e\+12"):
            Prop(name="box", motion=replace(box, root_positions=far * np.ones((1, 3))), held_by=held_by)


CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (1, 2) for z in (-1, 0)) + "f 1 2 3\n"


def test_a_prop_has_the_points_of_its_file():
    motion = static_prop(parse_obj(f"# a cube\r\n{CUBE}vn 0 1 0\n", "cube.obj")[0], "cube")
    assert motion.skeleton.names[0] == "cube"
    points = motion.positions[0]
    expected = [[x, y, z] for x in (0, 1) for y in (1, 2) for z in (-1, 0)]
    np.testing.assert_allclose(sorted(points.tolist()), expected)
    assert motion.skeleton.lengths[1:].max() == 1.0
    motion = static_prop(parse_obj(CUBE, "cube.obj")[0], "cube")
    back = parse_bvh(format_bvh(motion), "cube.bvh")
    np.testing.assert_allclose(sorted(back.positions[0].tolist()), sorted(motion.positions[0].tolist()), atol=1e-6)


def test_many_points_are_thinned():
    line = static_prop(np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1001), "line")
    kept = np.sort(line.positions[0, :, 0])
    assert len(kept) == MOST_POINTS
    assert np.diff(kept).max() < 3.0 / MOST_POINTS


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("vn 1 2 3\n", 0, "has no vertices"),
        ("v 1 2\n", 1, "found '1 2', expected three"),
        ("v 0 0 0\nv 1 x 2\n", 2, "found '1 x 2'"),
        ("v 1 nan 2\n", 1, "finite"),
        ("v 1_0 0 0\n", 1, "found '1_0 0 0', expected three"),
        ("v 1 ٣ 2\n", 1, "expected three finite"),
    ],
)
def test_what_is_no_obj_is_refused(text, line, words):
    with pytest.raises(BvhError, match=words) as caught:
        parse_obj(text, "prop.obj")
    assert caught.value.line == line


CORNERS = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 3.0)])
TRIANGLES = ConvexHull(CORNERS).simplices


def outwards(corners, triangles):
    """The triangles of a convex mesh with their corners in the order in which they face out."""
    out = np.cross(
        corners[triangles[:, 1]] - corners[triangles[:, 0]], corners[triangles[:, 2]] - corners[triangles[:, 0]]
    )
    faces_out = ((corners[triangles[:, 0]] - corners.mean(axis=0)) * out).sum(axis=1) > 0
    return np.where(faces_out[:, None], triangles, triangles[:, ::-1])


def height(surface, x):
    feet, out = surface.nearest(x, 50.0)
    return ((x - feet) * out).sum(axis=1)


@pytest.mark.parametrize("order", [1, -1])
def test_the_distance_from_a_box_is_known(order):
    surface = PropSurface.of_mesh(CORNERS, outwards(CORNERS, TRIANGLES)[:, ::order])
    x = np.random.default_rng(0).uniform(-2, 5, (2000, 3))
    beyond = np.maximum(-x, x - CORNERS.max(axis=0))
    known = np.where((beyond > 0).any(axis=1), np.linalg.norm(np.maximum(beyond, 0), axis=1), beyond.max(axis=1))
    assert surface.closed.all()
    np.testing.assert_allclose(height(surface, x), known, atol=1e-4)


def test_sheets_have_two_sides_points_stand_alone_and_nothing_is_near_beyond_the_farthest():
    surface = PropSurface.of_mesh(CORNERS, [[0, 1, 4], [1, 5, 4]])  # y = 0
    assert not surface.closed.any()
    np.testing.assert_allclose(height(surface, np.array([[1.0, 0.5, 1.0], [1.0, -0.5, 1.0]])), [0.5, 0.5])
    mixed = outwards(CORNERS, TRIANGLES)
    mixed[0] = mixed[0, ::-1]
    assert not PropSurface.of_mesh(CORNERS, mixed).closed.any()
    surface = PropSurface.of_mesh(CORNERS, np.zeros((0, 3), int))
    feet, out = surface.nearest(np.array([[2.5, 1.0, 3.0]]), 5.0)
    np.testing.assert_allclose([feet[0], out[0]], [[2, 1, 3], [1, 0, 0]])
    assert np.isnan(PropSurface.of_mesh(CORNERS, TRIANGLES).nearest(np.array([[50.0, 0.0, 0.0]]), 5.0)[0]).all()


def test_the_distance_from_bones_is_known():
    positions = np.array([[[0.0, 0, 0], [10, 0, 0], [0, 4, 0]]])
    feet, out = nearest_on_bones(positions, np.array([-1, 0, 0]), np.array([[[3.0, 1, 0], [12, 0, 0], [1, 3, 0]]]))
    np.testing.assert_allclose(feet[0], [[3, 0, 0], [10, 0, 0], [0, 3, 0]])
    np.testing.assert_allclose(out[0], [[0, 1, 0], [1, 0, 0], [1, 0, 0]])


@pytest.mark.parametrize("corner", ["1_0", "٣", "x", "1.5", "0", "5", "-5", "9" * 5000])
def test_faces_of_an_obj_file(corner):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/2/2 3\nv 0 1 0\nf 1 2 3 -1\n"
    vertices, triangles = parse_obj(text, "prop.obj")
    assert len(vertices) == 4
    np.testing.assert_array_equal(triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]])
    with pytest.raises(BvhError, match="expected the number of one of the 4 vertices above") as caught:
        parse_obj(f"{text}f 1/1/1 -2 {corner}\n", "prop.obj")
    assert caught.value.line == 7


@cache
def drums():
    """Drumming on a block, with and without skin; the block in its own file, and turned with the performer."""
    (source,), _ = load_scene(SAMPLES / "scenes" / "drum_on_table" / "scene.json").read()
    low, high = np.array([-48.0, 52.0, 18.0]), np.array([48.0, 92.0, 60.0])
    corners = low + (high - low) * (CORNERS > 0)
    motion = static_prop(corners, "block")
    surface = PropSurface.of_mesh(corners - motion.positions[0, 0], outwards(CORNERS, TRIANGLES))
    prop = Prop(name="block", motion=motion, surface=surface)
    body = source.rigid_skeleton
    return [retarget_scene([source], [body], [prop], skin=skin) for skin in ("average", "none")], surface


def hand_gaps(scene, skins, surface):
    """(frames,), the least gap of hands and the block [body units]."""
    motion, prop = scene.results[0].motion, scene.props[0].motion
    kept = np.zeros((1, len(SEGMENTS)), bool)
    bodies = Bodies([skins.target], shapes=[PropShape(surface, kept, kept)], moved=lambda _: [prop])
    hands = [number for number, name in enumerate(SEGMENTS) if "hand" in name]
    on = np.isin(bodies.balls.pairs[:, 0], hands) & (bodies.balls.pairs[:, 1] >= len(SEGMENTS))
    return bodies.gaps([motion])[:, on].min(axis=1)


def test_hands_lie_on_a_block():
    (thick, stick), surface = drums()
    skins = thick.results[0].skins
    before, after = hand_gaps(stick, skins, surface), hand_gaps(thick, skins, surface)
    inside = before < -0.01
    assert inside.sum() > 20
    assert (after[inside] < -0.01).mean() < 0.25  # the beats are fast
    assert np.abs(np.median(after[inside])) < np.abs(np.median(before[inside])) / 3


def test_without_skin_the_surface_of_a_prop_says_nothing():
    (_, stick), _ = drums()
    (source,), _ = load_scene(SAMPLES / "scenes" / "drum_on_table" / "scene.json").read()
    bones = Prop(name="block", motion=stick.props[0].source[:1])
    plain = retarget_scene([source], [source.rigid_skeleton], [bones], skin="none")
    np.testing.assert_array_equal(plain.results[0].motion.positions, stick.results[0].motion.positions)
