"""Builds, from files and average ones: which one bones show, how thick each is, and where users name them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, PERSON, SAMPLES, sample_target, taken
from capsule_bodies import capsule_surface, mesh_of
from program import last_records, run, succeeded

from distretarget import Body, Build, Builds, FileError, Options, SkeletonEdit, load_build, load_target, read_motion
from distretarget.body.build import AGES, BUILDS, OWN_BUILDS, age_of, average_build
from distretarget.body.segments import proportions
from distretarget.io.input_file import load_file
from distretarget.io.reading import with_source
from distretarget.pipeline.options import DEFAULT_OPTIONS
from distretarget.pipeline.performer import Transfer, match_performer, target_capsules
from distretarget.scene.scene_file import load_scene
from distretarget.skin.capsules import SEGMENTS


def like(leg, crown):
    """The body of a person with legs of this share of its size, and the top of the head so far over the shoulders."""
    body = Body.of(PERSON)
    own_leg, own_crown = proportions(body)
    size = body.leg_length / own_leg
    lengths = np.array(PERSON.lengths)
    bones = [PERSON.index(f"{side}{joint}") for side in ("Left", "Right") for joint in ("Knee", "Ankle")]
    lengths[bones] *= leg * (1 - own_leg) / (own_leg * (1 - leg))
    end = next(joint for joint in PERSON.children[PERSON.index("Head")] if PERSON.end_sites[joint])
    lengths[end] += (crown * (1 - own_leg) / (1 - leg) - own_crown) * size
    return Body.of(PERSON.with_lengths(lengths))


def radius(build, body, part):
    """The mean radius of a part of a body with a build [% of two leg lengths]."""
    capsules = build.on(body)
    on = [part in SEGMENTS[segment] for segment in capsules.segments]
    return 50 * capsules.radii[on].mean() / body.leg_length


@pytest.mark.parametrize(
    ("leg", "crown", "age"),
    [(0.64, 0.27, "adult"), (0.69, 0.24, "adult"), (0.63, 0.34, "child"), (0.59, 0.35, "child"), (0.58, 0.42, "baby")],
)
def test_legs_and_head_show_the_age(leg, crown, age):
    body = like(leg, crown)
    assert proportions(body) == pytest.approx((leg, crown))
    assert age_of(body) == age
    assert age_of(Body.of(body.skeleton.with_offsets(7.0 * body.skeleton.offsets))) == age


def test_the_sample_child_is_a_child_and_what_bones_do_not_show_an_adult():
    child = sample_target("child").skeleton
    assert age_of(Body.of(child)) == "child"
    assert age_of(Body.of(taken(child, np.flatnonzero(~child.end_sites)))) == "adult"


@pytest.mark.parametrize("rig", sorted((SAMPLES / "rigs").glob("*.json")), ids=lambda path: path.stem)
def test_the_rigs_of_adults_are_adults(rig):
    assert age_of(Body.of(load_target(rig).skeleton)) == "adult"


@pytest.mark.parametrize("name", BUILDS)
def test_every_build_has_all_parts_and_is_symmetric(name):
    body = Body.of(PERSON)
    capsules = average_build(name).on(body)
    assert {SEGMENTS[each] for each in capsules.segments} >= {*SEGMENTS} - {"belly"}
    assert (capsules.radii > 0).all()
    for part in SEGMENTS[:12:2]:
        left, right = (capsules.segments == SEGMENTS.index(part.replace("left", side)) for side in ("left", "right"))
        np.testing.assert_allclose(capsules.radii[left], capsules.radii[right])


@pytest.mark.parametrize(
    ("thinner", "thicker", "parts"),
    [
        ("thin", "adult", ("thigh", "upper arm", "pelvis", "neck")),
        ("adult", "fat", ("thigh", "upper arm", "pelvis", "neck")),
        ("adult", "muscular", ("thigh", "upper arm", "forearm")),
        ("adult", "child", ("neck", "chest", "head")),
        ("child", "baby", ("thigh", "upper arm", "chest", "head")),
    ],
)
def test_builds_differ_as_people_do(thinner, thicker, parts):
    body = like(0.62, 0.27)
    for part in parts:
        assert radius(average_build(thinner), body, part) < radius(average_build(thicker), body, part)


def test_a_head_that_bones_show_is_as_large_as_they_show():
    baby, build = like(0.58, 0.42), average_build("baby")
    flat = Body.of(baby.skeleton.with_lengths(np.where(baby.skeleton.end_sites, 0.0, baby.skeleton.lengths)))
    assert radius(build, flat, "head") == pytest.approx(radius(build, baby, "head"), rel=0.25)
    larger = like(0.58, 0.46)
    assert radius(build, larger, "head") > 1.05 * radius(build, baby, "head")


def test_a_source_of_which_only_bones_are_known_has_the_average_of_its_age():
    for age, shares in zip(AGES, ((0.64, 0.27), (0.63, 0.34), (0.58, 0.42)), strict=True):
        assert age_of(like(*shares)) == age


def test_a_build_is_loaded_by_its_name():
    assert load_build("fat") is average_build("fat")
    with pytest.raises(FileError, match="neither a file nor an average build"):
        load_build("fatt")


def test_the_command_line_takes_builds_by_name(tmp_path):
    clap, child = SAMPLES / "clap.bvh", SAMPLES / "child.json"
    outputs = {}
    for name in ("fat", "thin"):
        succeeded("retarget", clap, child, "-o", tmp_path / f"{name}.bvh", "--skin", name, "--source-skin", "thin")
        outputs[name] = (tmp_path / f"{name}.bvh").read_bytes()
    assert outputs["fat"] != outputs["thin"]
    failed = run("retarget", clap, child, "-o", tmp_path / "x.bvh", "--skin", "fatt")
    assert failed.returncode == 1
    assert "neither a file nor an average build" in failed.stderr
    assert "thickness of an average child" in run("skeleton", "show", child).stdout


def test_a_performer_of_a_scene_takes_builds_by_name(tmp_path):
    performer = {"source": "one.bvh", "target": "hero.json", "skin": "fat", "source_skin": "thin"}
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"format": "distretarget-scene", "version": 1, "performers": [performer]}))
    (found,) = load_scene(path).performers
    assert found.skin_files == []
    (tmp_path / "one.bvh").write_bytes((SAMPLES / "clap.bvh").read_bytes())
    builds = found.recipe(Options()).builds
    assert (builds.source, builds.target) == (average_build("thin"), average_build("fat"))


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
    assert surfaces(sample_target("hero"), Options(skin="none")) is None
    assert surfaces(sample_target("hero"), Options(objective="paper")) is None


def test_builds_that_are_given_come_first():
    target, as_average = load_target(WALK), Options(skin="average")
    average = surfaces(target, as_average)
    assert surfaces(target, as_average, builds=Builds(source=STOUT)) == pytest.approx((2 * average[0], average[1]))
    assert surfaces(target, builds=Builds(target=STOUT)) == pytest.approx((average[0], 2 * average[1]))


def test_a_source_with_other_lengths_keeps_its_build():
    edit = SkeletonEdit(1.0, {}, {}, "")
    source, target = surfaces(edit, builds=Builds(source=STOUT))
    assert source == pytest.approx(target)


def test_the_mesh_of_a_source_is_its_build():
    file = load_file(HERO)
    build = with_source(Builds(), file).source
    body = Body.of(sample_target("hero").skeleton)
    assert build.on(body).radii.sum() == pytest.approx(target_capsules(sample_target("hero")).radii.sum())
    assert with_source(Builds(), load_file(CLAP)).source is None
    with pytest.raises(FileError, match="expected a GLB, VRM or FBX with a mesh"):
        load_build(CLAP)


def test_the_command_line_takes_the_build_of_another_character(tmp_path):
    for name, more in {"own": (), "hero": ("--skin", HERO, "--source-skin", HERO), "none": ("--skin", "none")}.items():
        succeeded("retarget", CLAP, WALK, "-o", tmp_path / f"{name}.bvh", *more)
    own, hero, none = ((tmp_path / f"{name}.bvh").read_bytes() for name in ("own", "hero", "none"))
    assert own == none != hero
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
