"""Builds from files: whose skin the solver, the command line and batches take."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, PERSON, SAMPLES, sample_target
from capsule_bodies import capsule_surface, mesh_of
from program import last_records, run, succeeded

from distretarget import Body, Build, Builds, FileError, Options, SkeletonEdit, load_build, load_target, read_motion
from distretarget.body.build import OWN_BUILDS, average_build
from distretarget.io.input_file import load_file
from distretarget.io.target_file import with_source
from distretarget.pipeline.options import DEFAULT_OPTIONS
from distretarget.pipeline.performer import Transfer, match_performer, target_capsules

CLAP, WALK = SAMPLES / "clap.bvh", SAMPLES / "walk.bvh"
STOUT = Build({part: capsules * [1, 1, 1, 2] for part, capsules in average_build("adult").parts.items()})


def surfaces(target, options=DEFAULT_OPTIONS, builds=OWN_BUILDS):
    """The mean radii of source and target."""
    skins = match_performer(Transfer(read_motion(CLAP), target, options, builds=builds)).skins
    return None if skins is None else tuple(side.capsules.radii.mean() for side in (skins.source, skins.target))


def test_the_target_is_as_thick_as_its_mesh():
    target = sample_target("hero")
    assert surfaces(target)[1] == pytest.approx(target_capsules(target).radii.mean())
    without = replace(target, capsules=None, mesh=lambda: None)
    assert surfaces(without) is None
    assert surfaces(without, Options(skin="average"))[1] != pytest.approx(surfaces(target)[1])


def test_builds_that_are_given_come_first():
    target, as_average = load_target(WALK), Options(skin="average")
    average = surfaces(target, as_average)
    assert surfaces(target, as_average, builds=Builds(source=STOUT)) == pytest.approx((2 * average[0], average[1]))
    assert surfaces(target, builds=Builds(target=STOUT)) == pytest.approx((average[0], 2 * average[1]))


def test_a_source_with_other_lengths_keeps_its_build():
    edit = SkeletonEdit(1.0, {}, {}, "")
    source, target = surfaces(edit, builds=Builds(source=STOUT))
    assert source == pytest.approx(target)


def test_no_skin_is_no_thickness():
    assert surfaces(sample_target("hero"), Options(skin="none")) is None
    assert surfaces(sample_target("hero"), Options(objective="paper")) is None


def test_the_mesh_of_a_source_is_its_build():
    file = load_file(HERO)
    build = with_source(Builds(), file).source
    body = Body.of(sample_target("hero").skeleton)
    assert build.on(body).radii.sum() == pytest.approx(target_capsules(sample_target("hero")).radii.sum())
    assert with_source(Builds(), load_file(CLAP)).source is None


def test_a_file_without_thickness_is_no_build():
    with pytest.raises(FileError, match="expected a GLB, VRM or FBX with a mesh"):
        load_build(CLAP)


def test_the_command_line_takes_the_build_of_another_character(tmp_path):
    for name, more in {"own": (), "hero": ("--skin", HERO, "--source-skin", HERO), "none": ("--skin", "none")}.items():
        succeeded("retarget", CLAP, WALK, "-o", tmp_path / f"{name}.bvh", *more)
    failed = run("retarget", CLAP, WALK, "-o", tmp_path / "x.bvh", "--skin", WALK)
    assert failed.returncode == 1
    assert "does not show how thick" in failed.stderr
    assert (
        run("retarget", CLAP, WALK, "-o", tmp_path / "x.bvh", "--skin", "none", "--source-skin", HERO).returncode == 2
    )


def test_a_batch_gives_what_single_runs_give(tmp_path):
    succeeded("retarget", CLAP, HERO, "-o", tmp_path / "one.bvh", "--skin", HERO)
    succeeded("batch", CLAP, HERO, "-o", tmp_path / "many", "--format", "bvh", "--jobs", "1", "--skin", HERO)
    assert (tmp_path / "many" / "clap.bvh").read_bytes() == (tmp_path / "one.bvh").read_bytes()
    record = last_records(tmp_path / "many")["clap.bvh"]
    assert record["options"]["target_build"] == load_build(HERO).hash
    assert np.isfinite(record["seconds"])


def test_a_mesh_is_that_of_a_skeleton_whose_joints_are_as_far_from_each_other():
    """What moves the mesh is displaced as a whole where a joint above it moves in a clip, as a pelvis on some rigs."""
    elbow, wrist, shoulder = (PERSON.names.index(f"Left{name}") for name in ("Elbow", "Wrist", "Shoulder"))
    balls = [(joint, PERSON.rest_positions[[joint, joint]] + [[0, 0, 0], [0.01, 0, 0]]) for joint in (elbow, wrist)]
    mesh = mesh_of([(joint, capsule_surface(ends, [0.1, 0.1])) for joint, ends in balls])
    build = Build({}, own=(PERSON, mesh))
    assert build.mesh_on(PERSON) is mesh
    by = np.array([0.1, -0.2, 0.3])
    moved = build.mesh_on(displaced(shoulder, by))
    np.testing.assert_allclose(moved.vertices, mesh.vertices + by)
    assert build.mesh_on(displaced(wrist, 0.1 * by)) is None
    assert build.mesh_on(sample_target("hero").skeleton) is None


def displaced(joint, by):
    """The sample's body with a joint at another place."""
    offsets = PERSON.offsets.copy()
    offsets[joint] += by
    return PERSON.with_offsets(offsets)


def test_a_build_is_printed_in_a_line():
    assert repr(load_build(HERO)).startswith("<Build of 2")
    assert len(repr(load_build(HERO))) < 60
