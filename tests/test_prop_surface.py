"""The surfaces of props: known answers, and limbs that keep off them."""

from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES
from scipy.spatial import ConvexHull

from distretarget import BvhError, Prop, retarget_scene
from distretarget.io.obj import parse_obj, parse_obj_mesh
from distretarget.scene.props import PropSurface, nearest_on_bones
from distretarget.scene.scene_file import load_scene
from distretarget.scene.skin import Bodies, PropShape
from distretarget.skin.capsules import SEGMENTS

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


def test_a_sheet_has_two_sides():
    surface = PropSurface.of_mesh(CORNERS, [[0, 1, 4], [1, 5, 4]])  # y = 0
    assert not surface.closed.any()
    np.testing.assert_allclose(height(surface, np.array([[1.0, 0.5, 1.0], [1.0, -0.5, 1.0]])), [0.5, 0.5])


def test_faces_that_do_not_agree_where_out_is_are_sheets():
    mixed = outwards(CORNERS, TRIANGLES)
    mixed[0] = mixed[0, ::-1]
    assert not PropSurface.of_mesh(CORNERS, mixed).closed.any()


def test_points_without_faces_stand_alone():
    surface = PropSurface.of_mesh(CORNERS, np.zeros((0, 3), int))
    feet, out = surface.nearest(np.array([[2.5, 1.0, 3.0]]), 5.0)
    np.testing.assert_allclose([feet[0], out[0]], [[2, 1, 3], [1, 0, 0]])


def test_nothing_is_near_beyond_the_farthest():
    assert np.isnan(PropSurface.of_mesh(CORNERS, TRIANGLES).nearest(np.array([[50.0, 0.0, 0.0]]), 5.0)[0]).all()


def test_the_distance_from_bones_is_known():
    positions = np.array([[[0.0, 0, 0], [10, 0, 0], [0, 4, 0]]])
    feet, out = nearest_on_bones(positions, np.array([-1, 0, 0]), np.array([[[3.0, 1, 0], [12, 0, 0], [1, 3, 0]]]))
    np.testing.assert_allclose(feet[0], [[3, 0, 0], [10, 0, 0], [0, 3, 0]])
    np.testing.assert_allclose(out[0], [[0, 1, 0], [1, 0, 0], [1, 0, 0]])


def test_faces_of_an_obj_file():
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/2/2 3\nv 0 1 0\nf 1 2 3 -1\n"
    vertices, triangles = parse_obj_mesh(text, "prop.obj")
    assert len(vertices) == 4
    np.testing.assert_array_equal(triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]])
    for face in ("0 1 2", "1 2 5", "1 x 2", "-5 1 2"):
        with pytest.raises(BvhError, match="expected the number of one of the 4 vertices above") as caught:
            parse_obj_mesh(text + f"f {face}\n", "prop.obj")
        assert caught.value.line == 7


@cache
def drums():
    """Drumming on a block, with and without skin; the block in its own file, and turned with the performer."""
    (source,), _ = load_scene(SAMPLES / "scenes" / "drum_on_table" / "scene.json").read()
    low, high = np.array([-48.0, 52.0, 18.0]), np.array([48.0, 92.0, 60.0])
    corners = low + (high - low) * (CORNERS > 0)
    text = "".join("v {} {} {}\n".format(*corner) for corner in corners)
    motion = parse_obj(text, "block.obj")
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
