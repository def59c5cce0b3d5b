"""Points on the surface of a mesh: where they are in a pose, what is out, and how far parts are apart."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import sample_run
from capsule_bodies import capsule_surface, mesh_of
from scipy.spatial import ConvexHull, KDTree
from scipy.spatial.transform import Rotation

from distretarget import Motion
from distretarget.measure.skin import find_skin
from distretarget.measure.skin_depths import PARTS, find_depths
from distretarget.numerics.vectors import normalised
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.surface import SurfaceSamples

LEFT, RIGHT = (SEGMENTS.index(f"{side} hand") for side in ("left", "right"))
TRUNK = tuple(SEGMENTS.index(name) for name in ("chest", "belly", "pelvis", "left thigh", "right thigh"))


def surface_of(clip, turned_in=()):
    """The surface of a run's target, with some triangles turned inside out."""
    result = sample_run(clip)
    mesh, triangles = result.mesh, result.mesh.triangles.copy()
    triangles[turned_in] = triangles[turned_in][:, ::-1]
    other = type(mesh)(vertices=mesh.vertices, joints=mesh.joints, weights=mesh.weights, triangles=triangles)
    skin = result.skins.target
    return SurfaceSamples.of(other, result.motion.skeleton, skin.of_joint, skin.capsules)


def shuffled(mesh):
    """The same mesh with its vertices, triangles and their corners in another order."""
    rng = np.random.default_rng(0)
    order, rows = rng.permutation(len(mesh.vertices)), rng.permutation(len(mesh.triangles))
    numbers = np.empty(len(order), np.intp)
    numbers[order] = np.arange(len(order))
    turns = (np.arange(3) + rng.integers(3, size=(len(rows), 1))) % 3
    triangles = np.take_along_axis(numbers[mesh.triangles[rows]], turns, axis=1)
    return type(mesh)(
        vertices=mesh.vertices[order], joints=mesh.joints[order], weights=mesh.weights[order], triangles=triangles
    )


def test_points_are_the_same_however_the_mesh_is_ordered():
    result = sample_run("clap")
    skin, skeleton = result.skins.target, result.motion.skeleton
    one, other = (
        SurfaceSamples.of(mesh, skeleton, skin.of_joint, skin.capsules).points
        for mesh in (result.mesh, shuffled(result.mesh))
    )
    still = result.motion[:1]
    np.testing.assert_allclose(posed(one.places, still), posed(other.places, still), atol=1e-9)
    np.testing.assert_allclose(one.radii, other.radii, rtol=1e-9)


def test_points_do_not_depend_on_the_last_bits_of_vertices():
    """The axis of a hand's capsule ends in the middle of faces of its box, which are as much outside as the others."""
    result = sample_run("clap")
    body, skin = result.matching.target, result.skins.target
    corners, triangles = box((0.5, 1.0, 0.1), (0.2, 0.1, 0.05))
    own = skin.capsules[skin.capsules.segments == LEFT][:1]
    ends = np.array([[0.4, 1.0, 0.1], [0.6, 1.0, 0.1]]) - body.skeleton.rest_positions[own.joints]
    noise, found = np.random.default_rng(0), []
    for _ in range(8):
        mesh = mesh_of([(body.anatomy.roles["leftHand"], (corners + noise.normal(0.0, 1e-16, (8, 3)), triangles))])
        found.append(SurfaceSamples.of(mesh, body.skeleton, skin.of_joint, replace(own, ends=ends[None])).points)
    for points in found:
        np.testing.assert_allclose(points.places.b, found[0].places.b, atol=1e-12)


def test_points_are_the_same_left_and_right():
    """A box for each hand, and two for the head; those on the right are mirror images of those on the left."""
    result = sample_run("clap")
    body, skin = result.matching.target, result.skins.target
    rest, roles = body.skeleton.rest_positions, body.anatomy.roles
    mirror, (corners, triangles) = np.array([-1.0, 1.0, 1.0]), box((0.5, 1.0, 0.1), (0.2, 0.1, 0.05))
    head = box((0.15, 1.6, 0.0), (0.2, 0.3, 0.2))
    halves = [
        (roles["leftHand"], (corners, triangles)),
        (roles["rightHand"], (mirror * corners, triangles[:, ::-1])),
        (roles["head"], head),
        (roles["head"], (mirror * head[0], head[1][:, ::-1])),
    ]
    ends, numbers = skin.capsules.ends.copy(), skin.capsules.segments
    for segment, middle in ((LEFT, (0.5, 1.0, 0.1)), (RIGHT, (-0.5, 1.0, 0.1)), (SEGMENTS.index("head"), (0, 1.6, 0))):
        ends[numbers == segment] = middle - rest[skin.capsules.joints[numbers == segment]][:, None]
    kept = replace(skin.capsules, ends=ends)[np.isin(numbers, [LEFT, RIGHT, SEGMENTS.index("head")])]
    points = SurfaceSamples.of(mesh_of(halves), body.skeleton, skin.of_joint, kept).points
    still = Motion(body.skeleton, rest[:1], np.tile([0.0, 0.0, 0.0, 1.0], (1, len(rest), 1)), "0.1")
    places = posed(points.places, still)[0]
    assert KDTree(places).query(mirror * places)[0].max() < 1e-9


def posed(bound, motion):
    """Vectors that are bound to joints, in each frame, (frames, vectors, 3)."""
    matrices = Rotation.from_quat(motion.world_rotations.reshape(-1, 4)).as_matrix()
    matrices = matrices.reshape(*motion.positions.shape[:2], 3, 3)
    rows = np.repeat(np.arange(len(bound.first) - 1), np.diff(bound.first))
    moved = np.einsum("frij,rj->fri", matrices[:, bound.joints], bound.b[:, :3])
    moved += bound.b[:, 3:] * motion.positions[:, bound.joints]
    found = np.zeros((len(motion), len(bound.first) - 1, 3))
    np.add.at(found, (slice(None), rows), moved)
    return found


def test_points_lie_on_the_posed_triangles_and_their_normals_lead_out():
    motion, points = sample_run("clap").motion[60:64], surface_of("clap").points
    bounds = points.places, points.first_edges, points.second_edges
    places, one, other = (posed(bound, motion) for bound in bounds)
    outwards = np.cross(one, other)
    corners = sample_run("clap").mesh.posed(motion)[:, sample_run("clap").mesh.triangles]
    for point in range(0, places.shape[1], 97):
        off = corners[2] - places[2, point]
        normals = np.cross(off[:, 1] - off[:, 0], off[:, 2] - off[:, 0])
        heights = np.abs((normals * off[:, 0]).sum(axis=1)) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
        inside = np.ones(len(off), bool)
        for k in range(3):
            inside &= (np.cross(off[:, k], off[:, (k + 1) % 3]) * normals).sum(axis=1) >= -1e-12
        assert heights[inside].min() < 1e-9
    runs = points.runs
    first, end = runs.first[runs.of_segment[TRUNK[0] : TRUNK[0] + 2]]
    away = places[0, first:end] - places[0, first:end].mean(axis=0)
    assert ((away * outwards[0, first:end]).sum(axis=1) > 0.0).mean() > 0.9


def test_the_points_of_a_run_are_in_its_ball_in_all_poses():
    motion, points = sample_run("clap").motion[::20], surface_of("clap").points
    runs, middles = points.runs, points.runs.middles
    places, centres = posed(points.places, motion), posed(middles, motion)
    rows = np.repeat(np.arange(len(runs.radii)), np.diff(middles.first))
    ways = posed(middles._replace(first=np.arange(len(rows) + 1)), motion) - middles.b[:, 3:] * centres[:, rows]
    radii = np.tile(runs.radii, (len(motion), 1))
    np.add.at(radii, (slice(None), rows), runs.spread * np.linalg.norm(ways, axis=2))
    of_point = np.repeat(np.arange(len(runs.radii)), np.diff(runs.first))
    shares = np.linalg.norm(places - centres[:, of_point], axis=2) / radii[:, of_point]
    assert shares.max() < 1.0 + 1e-9
    assert np.median(shares) > 0.5


def test_a_mesh_whose_triangles_face_in_is_the_same_surface():
    motion, wanted = sample_run("clap").motion[55:75:4], np.ones((5, 1), bool)
    one, other = (
        surface_of("clap", turned_in).gaps(motion, [(LEFT, (RIGHT,))], wanted, 1.0) for turned_in in ((), slice(None))
    )
    np.testing.assert_allclose(one, other, atol=2e-3)


@pytest.mark.parametrize(("clip", "limb", "part"), [("clap", LEFT, (RIGHT,)), ("hands_on_hips", LEFT, TRUNK)])
@pytest.mark.parametrize("which", ["motion", "rotation_copy"])
def test_gaps_are_those_that_the_metrics_measure(clip, limb, part, which):
    result = sample_run(clip)
    motion, body = getattr(result, which)[::5], result.matching.target
    far = 0.04 * body.height
    gaps = surface_of(clip).gaps(motion, [(limb, part)], np.ones((len(motion), 1), bool), far)[:, 0]
    skin, reach = (
        find_skin(body, result.skins.target.capsules, result.mesh),
        np.full((1, len(PARTS), len(SEGMENTS)), far),
    )
    depths = find_depths(skin.patches, skin.solids, (motion.positions, motion.world_rotations), reach)[0]
    measured = -depths[:, limb, list(part)].max(axis=1)
    if part == (RIGHT,):
        measured = np.minimum(measured, -depths[:, RIGHT, LEFT])
    near = np.minimum(gaps, measured) < 0.75 * far
    assert near.sum() > 3
    assert np.median(np.abs(gaps - measured)[near]) < 0.006 * body.height


def test_what_is_not_wanted_is_not_looked_for():
    motion = sample_run("clap").motion[60:64]
    wanted = np.array([[True], [False], [True], [False]])
    gaps = surface_of("clap").gaps(motion, [(LEFT, (RIGHT,))], wanted, 0.3)
    assert (gaps[[1, 3]] == 0.3).all()
    assert (gaps[[0, 2]] < 0.3).all()


def test_triangles_between_two_parts_count_so_that_coarse_meshes_have_no_holes():
    """A trunk whose side is one row of triangles from the pelvis to the chest, and a forearm beside its middle."""
    result = sample_run("clap")
    body, skin = result.matching.target, result.skins.target
    rest, roles = body.skeleton.rest_positions, body.anatomy.roles
    hips, chest, arm = rest[roles["hips"]], rest[roles["chest"]], roles["leftLowerArm"]
    tall = np.array([hips, chest]) + np.array([[0.0, -0.4, 0.0], [0.0, 0.4, 0.0]])
    beside = tall.mean(axis=0) + np.array([[0.25, -0.02, 0.0], [0.25, 0.02, 0.0]])
    coarse, round_arm = capsule_surface(tall, [0.1, 0.1], rings=4), capsule_surface(beside, [0.05, 0.05])
    mesh = mesh_of([(roles["hips"], coarse), (arm, round_arm)])
    mesh.joints[len(coarse[0]) // 2 : len(coarse[0])] = roles["chest"]
    surface = SurfaceSamples.of(mesh, body.skeleton, skin.of_joint, skin.capsules)
    still = Motion(body.skeleton, rest[:1], np.tile([0.0, 0.0, 0.0, 1.0], (1, len(rest), 1)), "0.1")
    parts = [(skin.of_joint[arm], tuple(np.unique(skin.of_joint[[roles["hips"], roles["chest"]]]).tolist()))]
    assert surface.gaps(still, parts, np.ones((1, 1), bool), 1.0)[0, 0] == pytest.approx(
        0.25 - 0.1 * np.cos(np.pi / 6) - 0.05, abs=0.01
    )


def box(middle, size):
    """The corners, (8, 3), and triangles, (12, 3), of a box."""
    signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij")).reshape(3, -1).T
    hull = ConvexHull(signs)
    first, second = (signs[hull.simplices[:, k]] - signs[hull.simplices[:, 0]] for k in (1, 2))
    out = (np.cross(first, second) * hull.equations[:, :3]).sum(axis=1)
    triangles = np.where((out > 0.0)[:, None], hull.simplices, hull.simplices[:, ::-1])
    return np.asarray(middle) + signs * size, triangles


def hand_and_head(middle, small, corners, triangles):
    """How far a hand, a small box about a place off the head's joint, is from a head with these triangles."""
    result = sample_run("clap")
    body, skin = result.matching.target, result.skins.target
    rest, roles = body.skeleton.rest_positions, body.anatomy.roles
    head, hand = roles["head"], roles["leftHand"]
    middle, (own, others) = rest[head] + middle, small
    mesh = mesh_of([(head, (rest[head] + corners, triangles)), (hand, (middle + own, others))])
    ends = skin.capsules.ends.copy()
    for joint, at in ((head, rest[head]), (hand, middle)):
        ends[skin.capsules.joints == joint] = at - rest[joint]
    surface = SurfaceSamples.of(mesh, body.skeleton, skin.of_joint, replace(skin.capsules, ends=ends))
    still = Motion(body.skeleton, rest[:1], np.tile([0.0, 0.0, 0.0, 1.0], (1, len(rest), 1)), "0.1")
    return surface.gaps(still, [(LEFT, (SEGMENTS.index("head"),))], np.ones((1, 1), bool), 1.0)[0, 0]


def bowl(count=32):
    """The corners and triangles of a bowl that widens upwards, 0.1 high, from a floor 0.1 wide to a rim 0.3 wide."""
    angles = 2.0 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angles), np.zeros(count), np.sin(angles)], axis=1)
    corners = np.concatenate([[[0.0, -0.05, 0.0]], *((0.1 + t) * ring + [0.0, t, 0.0] for t in (-0.05, 0.0, 0.05))])
    this, following = np.arange(count), (np.arange(count) + 1) % count
    floor = np.stack([np.zeros_like(this), 1 + this, 1 + following], axis=1)
    walls = [
        1 + k * count + np.stack(corner, axis=1)
        for k in (0, 1)
        for corner in ((this, this + count, following), (following, this + count, following + count))
    ]
    return corners, np.concatenate([floor, *walls])


@pytest.mark.parametrize(("place", "expected"), [((0.08, 0.11, 0.0), 0.08), ((0.04, -0.01, 0.0), -0.06)])
def test_what_is_over_an_open_part_is_outside(place, expected):
    """A head that is a bowl, and a small hand over it, which lies behind the rim, or in it."""
    gap = hand_and_head(np.array(place), box(np.zeros(3), 0.02 * np.ones(3)), *bowl())
    assert gap == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("towards", [(1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, -1)])
@pytest.mark.parametrize("turned", [False, True])
def test_a_box_is_as_far_as_it_is_off_its_faces_edges_and_corners(towards, turned):
    """A head of six faces, and a hand of six faces off it; `turned`, a corner of the hand points at the head."""
    sides, away = 0.3 * np.ones(3), normalised(np.array(towards, float))
    small, others = box(np.zeros(3), 0.06 * np.ones(3))
    if turned:
        small = Rotation.align_vectors([-away], [normalised(small[0])])[0].apply(small)
    middle = 0.5 * sides * np.array(towards) + (0.05 - (small @ away).min()) * away
    gap = hand_and_head(middle, (small, others), *box(np.zeros(3), sides))
    assert gap == pytest.approx(0.05, abs=0.004)
