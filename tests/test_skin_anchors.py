"""Contacts that a user anchors on the skin: known answers on bodies of other shapes, by their meshes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import sample, sample_target, with_bone
from scipy.spatial import cKDTree

from distretarget import Contact, ContactList, ContactsError, Options, retarget
from distretarget.body.body import Body
from distretarget.body.build import capsules_of
from distretarget.body.segments import find_segments
from distretarget.body.skin_anchors import AnchoredSkin
from distretarget.measure.skin import find_part_frames
from distretarget.skin.capsules import SEGMENTS

WALK = sample("walk")[60:190]
SPAN = (50, 80)
PALM = (0.45, 0.0)
TRUNK = [SEGMENTS.index(part) for part in ("chest", "belly", "pelvis")]
SPREAD = np.array([[i, j, 6 - i - j] for i in range(7) for j in range(7 - i)]) / 6.0  # over a triangle


@cache
def body_of_width(width):
    """The character with a trunk of another width, about its middle."""
    hero = sample_target("hero")
    mesh, body = hero.mesh(), Body.of(hero.skeleton, hero.motion)
    on = np.isin(find_segments(body).of_joint[mesh.carriers], TRUNK)
    vertices = np.array(mesh.vertices)
    vertices[on] *= [width, 1.0, width]
    wide = replace(mesh, vertices=vertices)
    return replace(hero, mesh=lambda: wide)


def touched(made, target, side):
    """How far a hand is from the trunk in each frame of `SPAN` [heights], and where that is nearest, along the trunk
    [its lengths] and round it [degrees].
    """
    mesh, body = target.mesh(), made.matching.target
    segments = find_segments(body).of_joint[mesh.carriers]
    triangles = mesh.triangles[np.isin(segments[mesh.triangles], TRUNK).all(axis=1)]
    hand, frames, found = segments == SEGMENTS.index(f"{side} hand"), find_part_frames(body), []
    for frame in range(*SPAN, 5):
        (x,) = mesh.posed(made.motion[frame : frame + 1])
        away, near = cKDTree((SPREAD @ x[triangles]).reshape(-1, 3)).query(x[hand])
        triangle, share = divmod(int(near[away.argmin()]), len(SPREAD))
        corners, shares = triangles[triangle], SPREAD[share]
        ((along, round_, _),) = frames.coordinates(
            segments[corners[[shares.argmax()]]], (shares @ mesh.vertices[corners])[None]
        )
        found.append((away.min() / body.height, along, np.degrees(round_)))
    return np.array(found).T


@pytest.mark.parametrize(
    ("width", "gap", "side"), [(1.0, 0.0, "left"), (1.0, 4.0, "right"), (1.5, 0.0, "left"), (0.85, 0.0, "right")]
)
def test_a_palm_comes_to_the_heart_of_any_body_on_either_side(width, gap, side):
    target, way = body_of_width(width), 1.0 if side == "left" else -1.0
    entry = Contact(between=(f"{side} hand", "trunk"), gap=gap, anchors=(PALM, (0.8, way * 15.0)), frames=SPAN)
    made = retarget(WALK, target, contacts=ContactList((entry,)))
    away, along, round_ = touched(made, target, side)
    height = made.matching.target.height
    assert np.abs(away - gap / 100.0 / height).max() < 0.013
    assert np.abs(along - 0.8).max() < 0.15
    assert np.abs(way * round_ - 15.0).max() < 35.0


@pytest.mark.parametrize("width", [1.0, 1.5])
@pytest.mark.parametrize("anchor", [(0.8, 10.0), (0.8, -10.0), (0.4, 180.0), (0.5, 90.0)])
def test_an_anchor_is_where_it_says_on_a_mesh_and_on_capsules(width, anchor):
    """By the axes of the measures, which are found otherwise."""
    target = body_of_width(width)
    body, mesh = Body.of(target.skeleton, target.motion), target.mesh()
    chest = body.anatomy.spine[-1]
    for given in (mesh, None):
        point = AnchoredSkin(body, capsules_of(body, mesh), given).point(chest, anchor)
        place = point.weights @ (point.offsets + body.skeleton.rest_positions[point.joints])
        segment = find_segments(body).of_joint[[point.joint]]
        ((along, round_, _),) = find_part_frames(body).coordinates(segment, place[None])
        assert along == pytest.approx(anchor[0], abs=0.02)
        assert np.remainder(np.degrees(round_) - anchor[1] + 180.0, 360.0) == pytest.approx(180.0, abs=3.0)


def test_anchors_on_both_sides_are_mirror_images():
    target = body_of_width(1.0)
    body = Body.of(target.skeleton, target.motion)
    skin = AnchoredSkin(body, capsules_of(body, target.mesh()), target.mesh())
    for part in ("Hand", "LowerArm", "UpperLeg", "LowerLeg", "Foot"):
        for anchor in ((0.5, 0.0), (0.5, 90.0), (0.7, -60.0)):
            left, right = (skin.point(body.anatomy.roles[side + part], anchor) for side in ("left", "right"))
            a, b = (
                one.weights @ (one.offsets + body.skeleton.rest_positions[one.joints]) / body.unit
                for one in (left, right)
            )
            np.testing.assert_allclose(a * [-1.0, 1.0, 1.0], b, atol=0.01)


def test_bodies_without_a_mesh_are_anchored_on_their_capsules():
    entry = Contact(between=("left hand", "head"), gap=0.0, anchors=(PALM, (0.95, 0.0)), frames=SPAN)
    made = retarget(WALK, sample_target("child"), Options(skin="average"), contacts=ContactList((entry,)))
    skin = made.skins.target
    crown = made.motion.positions[SPAN[0] : SPAN[1] + 1, made.matching.target.roles["head"], 1]
    hand = made.motion.positions[SPAN[0] : SPAN[1] + 1, made.matching.target.roles["leftHand"], 1]
    assert (hand > crown).all()
    assert skin.surface is None


def test_what_has_no_axis_cannot_be_anchored_on():
    child = sample_target("child").for_source(WALK.rigid_skeleton).skeleton
    tail = with_bone(with_bone(child, "Tail", "Hips"), "Tail2", "Tail")
    offsets = np.array(tail.offsets)
    offsets[-2:] = [0.0, 0.0, -30.0]
    tail = replace(tail, offsets=offsets)
    entry = Contact(between=("left hand", "Tail2"), gap=0.0, anchors=(PALM, PALM))
    with pytest.raises(ContactsError, match=r"contacts\[0\].anchors\[1\]: 'Tail2' has no axis to be anchored on"):
        retarget(WALK, tail, contacts=ContactList((entry,)))
