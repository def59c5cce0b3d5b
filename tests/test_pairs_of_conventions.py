"""Matching every convention to every other: joints of the same part, whatever their names."""

from functools import cache

import numpy as np
import pytest
from bodies import CORPUS, body_of, nameless, needs_corpus
from named_bodies import DATA, needs_names, published
from zoo import CONVENTIONS, rig

from distretarget import DistretargetError, read_bvh
from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.matching.matching import find_matching, refusal

PUBLISHED = tuple(DATA["_roles"])

LIMBS = ("hips", "head", *(side + part for side in SIDES for part in (*ARM, *LEG)))
FIVE_TOES = {"benchmark.bvh", "face-poseunits.bvh", "tpose.bvh"}  # none of these names is known as the end of a foot
NO_BODY = {"full_precision_frame_time.bvh", "rotation_first_root.bvh"}  # with few joints

rigs = pytest.mark.parametrize("pose", ["T", "A"])


@cache
def published_roles(convention):
    return {role: name for role, name in DATA["_roles"][convention].items() if name}


@cache
def roles(convention):
    """The names of the joints of each role in a rig."""
    body = rig(convention, "T")
    return {role: body.names[joint] for role, joint in by_names(body).roles.items()}


def assert_roles_meet(source, source_roles, target, target_roles):
    """Assert that each role drives the same role and no other; `source_roles`, `target_roles` are names by role."""
    drivers = find_matching(body_of(source), body_of(target)).drivers
    expected = {target.index(name): source_roles.get(role) for role, name in target_roles.items()}
    for joint, name in expected.items():
        driver = source.names[drivers[joint]] if drivers[joint] >= 0 else None
        assert driver == name or (name is None and driver not in source_roles.values()), target.names[joint]


def test_the_parts_of_the_rigs_are_those_of_people():
    for convention in CONVENTIONS:
        assert set(roles(convention)) >= {*LIMBS, "spine", "chest", "neck"}


@needs_names
@pytest.mark.parametrize("source", PUBLISHED)
def test_published_names_onto_published_names(source):
    for target in PUBLISHED:
        assert_roles_meet(published(source), published_roles(source), published(target), published_roles(target))


@rigs
@pytest.mark.parametrize("source", PUBLISHED)
def test_published_names_onto_rigs_and_back(source, pose):
    for target in CONVENTIONS:
        body = rig(target, pose)
        assert_roles_meet(published(source), published_roles(source), body, roles(target))
        assert_roles_meet(body, roles(target), published(source), published_roles(source))


@rigs
@pytest.mark.parametrize("source", CONVENTIONS)
@pytest.mark.parametrize("target", CONVENTIONS)
def test_rigs_onto_rigs(source, target, pose):
    assert_roles_meet(rig(source, "T"), roles(source), rig(target, pose), roles(target))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_rig_without_names_is_known_by_its_shape(convention):
    for pose in ("T", "A"):
        body = rig(convention, pose)
        known, found = (
            find_matching(body_of(source), body_of(rig("mixamo", "T"))) for source in (body, nameless(body))
        )
        joints = [known.target.anatomy.roles[role] for role in LIMBS]
        np.testing.assert_array_equal(found.drivers[joints], known.drivers[joints])


@needs_corpus
@pytest.mark.parametrize("path", sorted(CORPUS.rglob("*.bvh")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_a_file_without_names_is_matched_as_with_them(path):
    try:
        motion = read_bvh(path)
    except DistretargetError:
        pytest.skip("no file that can be read")
    if not len(motion):
        pytest.skip("no frames")
    body, target = motion.rigid_skeleton, rig("mixamo", "T")
    known, found = (find_matching(Body.of(source, motion), body_of(target)) for source in (body, nameless(body)))
    if path.name in NO_BODY:
        assert refusal(known)
        assert refusal(found)
        return
    parts = known.target.anatomy.roles
    several = [target.names[parts[role]] for role in LIMBS if known.drivers[parts[role]] != found.drivers[parts[role]]]
    expected = ["mixamorig:LeftToeBase", "mixamorig:RightToeBase"] if path.name in FIVE_TOES else []
    assert several == expected
    spine = list(known.target.anatomy.spine)
    np.testing.assert_array_equal(found.rotation_sources[spine], known.rotation_sources[spine])
    np.testing.assert_allclose(found.blend[spine], known.blend[spine])
