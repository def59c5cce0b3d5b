"""`distretarget skeleton`: showing, exporting, matching and editing skeletons."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import HERO, SAMPLES, person, sample, swaying, tree_of
from built_rigs import along_bones, with_axes
from program import refused, run, succeeded

from distretarget import Body, read_bvh, write_bvh
from distretarget.io.reading import load_target
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.scene.scene_file import load_scene

pytestmark = pytest.mark.usefixtures("folder")

RIGS = SAMPLES / "rigs"


def renamed(skeleton, rename):
    return replace(skeleton, names=tuple(map(rename, skeleton.names)))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A clip, its body as a skeleton file, one with meaningless names, and one that is not a body."""
    monkeypatch.chdir(tmp_path)
    body = person()
    write_bvh("in.bvh", swaying(body))
    (tmp_path / "body.json").write_text(skeleton_to_json(body, "somebody", {"Head": "Head", "Neck": None}))
    numbers = {name: f"j{number}" for number, name in enumerate(body.names)}
    (tmp_path / "numbers.json").write_text(skeleton_to_json(renamed(body, numbers.get), "numbers"))
    blocks = tree_of([[0, 0, 0], [0, 1, 0]], ["Block", "Lid"])
    (tmp_path / "blocks.json").write_text(skeleton_to_json(blocks, "blocks"))
    return tmp_path


# show and export


@pytest.mark.parametrize(
    ("file", "says"),
    [
        (RIGS / "mixamo_t.json", "joints named as in Mixamo"),
        ("numbers.json", "joints recognised by shape"),
        ("blocks.json", "no human body recognised"),
    ],
)
def test_show_says_what_is_recognised(file, says):
    assert run("skeleton", "show", file).stdout.splitlines()[0].endswith(f"; {says}")


def test_show_says_how_thick_a_body_is():
    said = run("skeleton", "show", HERO).stdout
    assert "thickness of its mesh [m]" in said
    assert "upper arm" in said
    assert "thickness of an average adult" in run("skeleton", "show", SAMPLES / "walk.bvh").stdout


def test_what_is_exported_from_a_skeleton_file_is_that_file():
    for file in ("body.json", RIGS / "unreal_a.json"):
        assert load_target(file).name
        written = json.loads(run("skeleton", "export", file).stdout)
        assert written == json.loads(Path(file).read_text())


# match


def test_match_prints_a_table_in_the_order_of_the_tree():
    done = run("skeleton", "match", "in.bvh", RIGS / "xsens_t.json")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[:4] == [
        "source: joints named as in Xsens MVN",
        "target: joints named as in Xsens MVN",
        "matched: 22 of the target's 23 joints (18 by equal name, 4 by names)",
        "",
    ]
    target = load_target(RIGS / "xsens_t.json").skeleton
    table = lines[4 : lines.index("", 4)]
    assert table[0].split("  ")[0] == "target joint"
    names = [target.names[joint] for joint in target.depth_first if not target.end_sites[joint]]
    assert [line.split()[0] for line in table[1:]] == names
    column = table[0].index("source joint")
    assert all(line[column - 2 : column] == "  " and line[column] != " " for line in table)
    assert any("rotation between Chest" in line for line in table)
    assert lines[-2:] == ["joints of the target without a counterpart: none", "joints of the source not used: none"]


def test_match_says_how_a_joint_was_found_and_what_is_left():
    Path("map.json").write_text('{"j5": "LeftWrist", "j0": null}')
    lines = run("skeleton", "match", "body.json", "numbers.json", "--map", "map.json").stdout.splitlines()
    rows = {line.split()[0]: line.split() for line in lines[5:] if line.startswith("j") and line[1].isdigit()}
    assert len(rows) == 22
    assert rows["j5"][1] == "LeftWrist"
    assert rows["j5"][-1] == "map"
    assert rows["j0"] == ["j0", "-"]
    assert {row[-1] for key, row in rows.items() if key not in ("j0", "j5")} <= {"shape", "tip"}
    assert lines[-2].startswith("joints of the target without a counterpart: j0")
    assert lines[-1].startswith("joints of the source not used: Hips")


def test_match_takes_the_short_form():
    done = succeeded("skeleton", "match", "in.bvh", SAMPLES / "long_arms.json")
    assert "matched: 22 of the target's 22 joints (22 by equal name)" in done.stdout


def test_a_map_is_written_and_taken_back(folder):
    succeeded("skeleton", "match", "in.bvh", RIGS / "unreal_a.json", "-o", "map.json")
    pairs = json.loads((folder / "map.json").read_text())
    assert pairs["pelvis"] == "Hips"
    assert pairs["ik_hand_gun"] is None
    for name, options in (("plain", []), ("mapped", ["--map", "map.json"])):
        succeeded("in.bvh", RIGS / "unreal_a.json", "-o", f"{name}.bvh", *options)
    assert (folder / "plain.bvh").read_bytes() == (folder / "mapped.bvh").read_bytes()
    assert "exists already" in run("skeleton", "match", "in.bvh", "body.json", "-o", "map.json").stderr
    succeeded("skeleton", "match", "in.bvh", "body.json", "-o", "map.json", "--overwrite")


def test_what_cannot_be_matched_is_shown_and_written_all_the_same(folder):
    done = run("skeleton", "match", "in.bvh", "blocks.json", "-o", "map.json")
    assert done.returncode == 1
    assert "target: no human body recognised\nmatched: 0 of the target's 2 joints\n" in done.stdout
    reason = "only 0 of 2 joints of the target have a driver by name, and no human body is recognised in the target"
    assert done.stderr == f"distretarget: blocks.json: {reason}; fill in map.json and give it with --map\n"
    assert json.loads((folder / "map.json").read_text()) == {"Block": None, "Lid": None}
    again = run("in.bvh", "blocks.json", "-o", "out.bvh", "--map", "map.json")
    assert f"blocks.json: {reason}; " in again.stderr
    assert "--map MAP.json" in again.stderr
    (folder / "map.json").write_text('{"Block": "Chest", "Lid": "Head"}')
    succeeded("in.bvh", "blocks.json", "-o", "out.bvh", "--map", "map.json")


def test_a_rest_pose_is_given_once_and_kept_in_the_map(folder):
    """A rig that stands in no rest pose; with `rest.bvh` it moves as the same clip by joints that do."""
    walk = sample("walk")[:40]
    axes = along_bones(Body.of_motion(walk))
    still = replace(walk[:1], rotations=np.tile(walk.skeleton.rest_rotations, (1, 1, 1)))
    clip, rest = with_axes(walk, axes), with_axes(still, axes)
    unturned = replace(rest, rotations=still.rotations)
    for name, motion in {"clip": clip, "rest": rest, "plain": walk, "unturned": unturned, "none": rest[:0]}.items():
        write_bvh(f"{name}.bvh", motion)
    target = RIGS / "mixamo_t.json"
    succeeded("skeleton", "match", "clip.bvh", target, "--rest", "rest.bvh", "-o", "map.json")
    for name, options in (("rest", ["--rest", "rest.bvh"]), ("map", ["--map", "map.json"])):
        succeeded("clip.bvh", target, "-o", f"{name}_out.bvh", *options)
    succeeded("batch", "clip.bvh", target, "-o", "out", "--rest", "rest.bvh")
    results = [folder / name for name in ("rest_out.bvh", "map_out.bvh", "out/clip.bvh")]
    assert len({path.read_bytes() for path in results}) == 1
    succeeded("plain.bvh", target, "-o", "plain_out.bvh")
    performers = [{"source": "clip.bvh", "target": str(target), "map": "map.json"}]
    scene = {"format": "distretarget-scene", "version": 1, "performers": performers}
    (folder / "scene.json").write_text(json.dumps(scene))
    retargeted = load_scene("scene.json").retargeted().results[0]
    assert retargeted.matching.source.standing is not None
    own, known = (read_bvh(f"{name}_out.bvh").positions for name in ("map", "plain"))
    np.testing.assert_allclose(own, known, atol=1.0)
    succeeded("skeleton", "match", "clip.bvh", target, "--map", "map.json", "-o", "again.json")
    assert (folder / "again.json").read_bytes() == (folder / "map.json").read_bytes()
    text = json.loads((folder / "map.json").read_text())
    (folder / "less.json").write_text(json.dumps(text | {"rest": {"Hips": [0, 0, 0, 1]}}))
    (folder / "wrong.json").write_text(json.dumps(text | {"rest": {"Hips": [0, 0, 1]}}))
    for option, file, reason in (
        ("--rest", "unturned.bvh", "unturned.bvh: nobody can stand in"),
        ("--rest", "none.bvh", "none.bvh: has no frames"),
        ("--rest", "missing.bvh", "missing.bvh: there is no such file"),
        ("--rest", "rest_out.bvh", "rest_out.bvh: the rest pose has other joints than SOURCE: it lacks"),
        ("--map", "less.json", "less.json: the rest pose has other joints than SOURCE: it lacks"),
        ("--map", "wrong.json", 'wrong.json: rest["Hips"]: expected a rotation of four numbers'),
    ):
        line = refused("clip.bvh", target, "-o", "failed.bvh", option, file)
        assert line.startswith(f"distretarget: {reason}")


def test_match_refuses_to_write_over_its_inputs():
    for output in ("in.bvh", "body.json", "numbers.json"):
        arguments = "in.bvh", "body.json", "--map", "numbers.json", "-o", output, "--overwrite"
        assert "is an input as well" in refused("skeleton", "match", *arguments)


# edit


def test_edit_changes_lengths_and_keeps_the_rest():
    options = ["--scale", "2", "--length", "LeftKnee=0.5", "--factor", "*Wrist=1.5"]
    done = run("skeleton", "edit", "body.json", *options, "-o", "new.json")
    body, edited = load_target("body.json"), load_target("new.json")
    expected = 2 * body.skeleton.lengths
    expected[[key.endswith("Wrist") for key in body.skeleton.keys]] *= 1.5
    expected[body.skeleton.index("LeftKnee")] = 0.5
    np.testing.assert_allclose(edited.skeleton.lengths, expected, rtol=1e-14)
    assert (edited.name, edited.map) == ("somebody", body.map)
    assert done.stdout.startswith("26 bones changed; height ")
    before, after = done.stdout.split("height ")[1].split(" -> ")
    assert float(before) < float(after)
    assert done.stdout.count("\n") == 1


def test_edit_takes_bvh_and_keeps_units_and_axis():
    assert run("skeleton", "edit", "in.bvh", "--scale", "1", "-o", "same.json").stdout.startswith("0 bones changed; ")
    assert load_target("same.json").name == "in"
    done = run("skeleton", "edit", SAMPLES / "child.json", "--factor", "LeftKnee=1.1", "-o", "child.json")
    assert done.stdout.startswith("1 bone changed; ")
    assert done.stdout.endswith(" cm\n")
    child = load_target("child.json").skeleton
    assert (child.units, child.up) == ("cm", "Y")


def test_patterns_pass_over_bones_without_length():
    body = person()
    offsets = body.offsets.copy()
    offsets[body.index("LeftToe")] = 0
    Path("flat.json").write_text(skeleton_to_json(body.with_offsets(offsets), "flat"))
    succeeded("skeleton", "edit", "flat.json", "--length", "Left*=0.1", "-o", "new.json")
    edited = load_target("new.json").skeleton
    changed = [key.startswith("Left") and key != "LeftToe" for key in edited.keys]
    np.testing.assert_allclose(edited.lengths[changed], 0.1)
    assert edited.lengths[edited.index("LeftToe")] == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--factor", "LeftKne=2"], "in.bvh: --factor LeftKne: no such bone; did you mean 'LeftKnee'"),
        (["--length", "left*=2"], "in.bvh: --length left*: no such bone; "),
        (
            ["--factor", "Left*=2", "--factor", "LeftKnee=3"],
            "--factor Left* and --factor LeftKnee are both for the bone",
        ),
        (
            ["--length", "*Knee=2", "--factor", "LeftKnee=3"],
            "--length *Knee and --factor LeftKnee are both for the bone",
        ),
        (["--factor", "Hips=2"], "the root has no bone"),
        (["--scale", "2", "-o", "in.bvh", "--overwrite"], "in.bvh: is an input as well"),
        (["--scale", "2", "-o", "body.json"], "body.json: exists already"),
    ],
)
def test_edits_that_fail(options, says):
    assert says in refused("skeleton", "edit", "in.bvh", "-o", "new.json", *options)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "nothing to change; give --scale, --length or --factor"),
        (["--scale", "0"], "expected a number above 0"),
        (["--scale", "nan"], "expected a number above 0"),
        (["--scale", "1e60"], "to 1e+12"),
        (["--length", "LeftKnee"], "expected a bone, = and a number, found 'LeftKnee'"),
        (["--factor", "=2"], "expected a bone, = and a number, found '=2'"),
        (["--factor", "LeftKnee=long"], "expected a number above 0, from 1e-12 to 1e+12, found 'long'"),
    ],
)
def test_edits_without_a_meaning_are_wrong_usage(options, says):
    assert says in refused("skeleton", "edit", "in.bvh", "-o", "new.json", *options, status=2)


def test_the_short_form_is_no_skeleton_to_edit():
    line = refused("skeleton", "edit", SAMPLES / "long_arms.json", "--scale", "2", "-o", "new.json")
    assert "short form needs a source" in line
