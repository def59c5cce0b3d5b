"""Characters on the command line: what a user gives, gets and is told."""

import json
import shutil

import numpy as np
import pytest
from bodies import SAMPLES
from characters import LOOKING_BACK, Bones, as_vrm0, character, chunks
from program import refused, run, succeeded
from test_character_files import played
from test_characters import BONES, ROLLED, WALK

from distretarget import load_target, read_bvh, read_motion, retarget

WALK_FILE = SAMPLES / "walk.bvh"


@pytest.fixture
def hero(tmp_path):
    return character(BONES, axes=ROLLED).write(tmp_path / "hero.glb")


def animations_of(path):
    return [entry["name"] for entry in chunks(path.read_bytes())[0].get("animations", [])]


def test_a_clip_on_a_character(hero, tmp_path):
    succeeded(WALK_FILE, hero, "-o", tmp_path / "out.glb")
    assert animations_of(tmp_path / "out.glb") == ["walk"]
    motion = retarget(read_bvh(WALK_FILE), load_target(hero)).motion
    assert read_motion(tmp_path / "out.glb").positions == pytest.approx(motion.positions, abs=1e-5)


def test_a_chosen_animation_at_a_frame_rate(tmp_path):
    made = character(BONES, axes=ROLLED)
    made.animate("Run", WALK)
    made.animate("Rest", WALK[:2])
    library, out = made.write(tmp_path / "library.glb"), tmp_path / "run.glb"
    line = refused(library, SAMPLES / "child.json", "-o", tmp_path / "out.bvh")
    assert "has 2 animations: 'Run', 'Rest'; choose one with --clip NAME" in line
    assert "no animation 'run'; did you mean 'Run'?" in refused(library, library, "-o", out, "--clip", "run")
    succeeded(library, library, "-o", out, "--clip", "Run", "--fps", "30", "--animations", "replace")
    assert animations_of(out) == ["Run"]
    again = read_motion(out)
    assert again.frame_time == pytest.approx(1 / 30, rel=1e-5)
    assert (len(again) - 1) / 30 <= WALK.times[-1] < len(again) / 30


def test_a_vrm_stays_a_vrm(tmp_path):
    made = as_vrm0(character(BONES.turned(LOOKING_BACK)))
    source = made.write(tmp_path / "hero.vrm")
    succeeded(WALK_FILE, source, "-o", tmp_path / "out.vrm")
    assert chunks((tmp_path / "out.vrm").read_bytes())[0]["extensions"] == made.document["extensions"]
    succeeded(WALK_FILE, source, "-o", tmp_path / "out.vrma")
    moved = read_motion(tmp_path / "out.vrma")
    path = moved.root_positions
    clip = read_bvh(WALK_FILE)
    forward = clip.root_positions[-1, 2] - clip.root_positions[0, 2]
    assert np.sign(path[-1, 2] - path[0, 2]) == np.sign(forward)  # VRM animations look to +Z


@pytest.fixture
def mocap(tmp_path):
    folder = tmp_path / "mocap"
    (folder / "more").mkdir(parents=True)
    shutil.copy(SAMPLES / "clap.bvh", folder / "clap.bvh")
    shutil.copy(SAMPLES / "turn.bvh", folder / "more" / "turn.bvh")
    made = character(BONES)
    made.animate("anything", WALK)
    made.write(folder / "step.glb")
    return folder


def test_a_folder_of_all_kinds_onto_a_character(mocap, hero, tmp_path):
    out = tmp_path / "out"
    succeeded("batch", mocap, hero, "-o", out, "--jobs", "1")
    assert [animations_of(out / name) for name in ("clap.glb", "more/turn.glb", "step.glb")] == [
        ["clap"],
        ["turn"],
        ["step"],
    ]
    again = succeeded("batch", mocap, hero, "-o", out, "--jobs", "1")
    assert "3 done before" in again.stdout
    succeeded("batch", mocap, hero, "-o", tmp_path / "bvh", "--jobs", "1", "--format", "bvh")
    assert (tmp_path / "bvh" / "step.bvh").is_file()


def test_a_folder_as_animations_of_one_file(mocap, hero, tmp_path):
    out = tmp_path / "all.glb"
    assert "all.glb: 3 animations" in succeeded("batch", mocap, hero, "-o", out, "--merge", "--jobs", "1").stdout
    assert animations_of(out) == ["clap", "more/turn", "step"]
    motion = retarget(read_bvh(SAMPLES / "clap.bvh"), load_target(hero)).motion
    nodes = [number for number, node in enumerate(chunks(hero.read_bytes())[0]["nodes"]) if "mesh" not in node]
    times = motion.frame_time * np.arange(len(motion))
    order = load_target(hero).character.joint_nodes.tolist()
    found = played(out, "clap", times, nodes)[:, [nodes.index(node) for node in order]]
    assert found == pytest.approx(motion.positions, abs=1e-4)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.glb", "all.glb.metrics.csv", "hero.glb", "mocap"]
    rows = (tmp_path / "all.glb.metrics.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows] == ["output", "clap.bvh", "more/turn.bvh", "step.bvh"]
    assert "exists already; --overwrite replaces it" in refused("batch", mocap, hero, "-o", out, "--merge")


def test_what_fails_is_left_out_of_the_file_and_tried_again(mocap, hero, tmp_path):
    bad = mocap / "bad.bvh"
    bad.write_text("HIERARCHY")
    out = tmp_path / "all.glb"
    finished = run("batch", mocap, hero, "-o", out, "--merge", "--jobs", "1")
    assert finished.returncode == 1
    assert animations_of(out) == ["clap", "more/turn", "step"]
    shutil.copy(WALK_FILE, bad)
    finished = succeeded("batch", mocap, hero, "-o", out, "--merge", "--jobs", "1", "--overwrite")
    assert "1 converted, 3 done before" in finished.stdout
    assert animations_of(out) == ["bad", "clap", "more/turn", "step"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--merge", "-o", "all.bvh"), "expected .glb, .gltf or .vrm"),
        (("--merge", "-o", "all.glb", "--format", "bvh"), "leave out --format"),
        (("--format", "vrm", "-o", "out"), "is no VRM model"),
        (("--clip", "none", "-o", "out"), ""),
    ],
)
def test_batches_that_cannot_be(mocap, hero, monkeypatch, arguments, expected):
    monkeypatch.chdir(mocap.parent)
    finished = run("batch", "mocap", hero.name, "--jobs", "1", *arguments)
    assert finished.returncode in (1, 2)
    assert expected in finished.stderr


def test_a_root_on_the_floor_carries_the_path(tmp_path):
    """The engine's root moves along the floor, and the hips above it, each with keys of its own."""
    skeleton = load_target(SAMPLES / "rigs" / "unreal_a.json").skeleton
    bones = Bones.of(skeleton)
    source, out = character(bones).write(tmp_path / "hero.glb"), tmp_path / "walk.glb"
    succeeded(WALK_FILE, source, "-o", out)
    document, _ = chunks(out.read_bytes())
    names = [node["name"] for node in document["nodes"]]
    channels = document["animations"][0]["channels"]
    moving = {names[each["target"]["node"]] for each in channels if each["target"]["path"] == "translation"}
    assert {"root", "pelvis"} <= moving
    succeeded(WALK_FILE, source, "-o", tmp_path / "still.glb", "--root-follows", "nothing")
    assert read_motion(tmp_path / "still.glb").root_positions == pytest.approx(0.0, abs=1e-6)
    succeeded(WALK_FILE, source, "-o", tmp_path / "in_place.glb", "--in-place")
    document, _ = chunks((tmp_path / "in_place.glb").read_bytes())
    path = np.array(document["animations"][0]["extras"]["root_path"])
    hips = read_motion(tmp_path / "in_place.glb")
    pelvis = hips.positions[:, hips.skeleton.index("pelvis")]
    assert np.ptp(pelvis[:, [0, 2]], axis=0).max() < 0.05 * np.ptp(path[:, [0, 2]], axis=0).max()


def test_diff_and_skeleton_take_characters(hero, tmp_path):
    out = tmp_path / "out.glb"
    succeeded(WALK_FILE, hero, "-o", out)
    assert "22 joints" in succeeded("skeleton", "show", hero).stdout
    succeeded("skeleton", "export", hero, "-o", tmp_path / "hero.json")
    assert json.loads((tmp_path / "hero.json").read_text())["units"] == "m"
    assert "named as in" in succeeded("skeleton", "match", out, hero).stdout
    assert "frames compared" in succeeded("diff", WALK_FILE, out).stdout


def test_a_vrm_0_looks_ahead_in_every_file(tmp_path):
    """As GLB in its own world, to -Z; as BVH to +Z; and from there back again, alone and merged."""
    source = as_vrm0(character(BONES.turned(LOOKING_BACK), axes=ROLLED)).write(tmp_path / "hero.vrm")
    for out in ("walk.vrm", "walk.bvh"):
        succeeded(WALK_FILE, source, "-o", tmp_path / out, "--skin", "none")
    own, bvh = read_motion(tmp_path / "walk.vrm"), read_motion(tmp_path / "walk.bvh")
    assert own.root_positions[-1, 2] < own.root_positions[0, 2]
    assert bvh.positions * [-1, 1, -1] == pytest.approx(own.positions, abs=1e-5)
    succeeded(tmp_path / "walk.bvh", source, "-o", tmp_path / "again.vrm", "--skin", "none")
    assert read_motion(tmp_path / "again.vrm").positions == pytest.approx(own.positions, abs=1e-4)
    succeeded("batch", WALK_FILE, source, "-o", tmp_path / "all.vrm", "--merge", "--jobs", "1", "--skin", "none")
    assert read_motion(tmp_path / "all.vrm").positions == pytest.approx(own.positions, abs=1e-4)


def test_each_animation_of_a_library_is_a_clip(hero, tmp_path):
    made = character(BONES)
    for name in ("Run", "Run", "a/b", ""):
        made.animate(name, WALK[:4])
    made.write(tmp_path / "library.glb")
    succeeded("batch", tmp_path / "library.glb", hero, "-o", tmp_path / "out", "--jobs", "1")
    assert sorted(path.name for path in (tmp_path / "out" / "library").iterdir()) == [
        "Run 2.glb",
        "Run.glb",
        "a_b.glb",
        "animation 4.glb",
    ]
    succeeded("batch", tmp_path / "library.glb", hero, "-o", tmp_path / "all.glb", "--merge", "--jobs", "1")
    assert animations_of(tmp_path / "all.glb") == [f"library/{name}" for name in ("Run", "Run 2", "a_b", "animation 4")]
    succeeded("batch", tmp_path / "library.glb", hero, "-o", tmp_path / "one", "--clip", "#2", "--jobs", "1")
    assert (tmp_path / "one" / "library.glb").is_file()


def test_clips_are_added_to_a_result_on_the_same_character(hero, tmp_path):
    out = tmp_path / "all.glb"
    for clip in ("walk", "clap", "walk"):
        succeeded(SAMPLES / f"{clip}.bvh", hero, "-o", out, "--add")
    assert animations_of(out) == ["walk", "clap", "walk 2"]
    for number, clip in enumerate(("walk", "clap"), start=1):
        motion = retarget(read_bvh(SAMPLES / f"{clip}.bvh"), load_target(hero)).motion
        assert read_motion(out, clip=f"#{number}").positions == pytest.approx(motion.positions, abs=1e-5)
    longer = Bones(BONES.names, BONES.parents, 1.1 * BONES.positions)
    other = character(longer, axes=ROLLED).write(tmp_path / "other.glb")
    assert "is no result on" in refused(WALK_FILE, other, "-o", out, "--add")
    assert "is an input" in refused(WALK_FILE, hero, "-o", hero, "--add")
    assert "exists already" in refused(WALK_FILE, hero, "-o", out)
    assert "holds one motion" in refused(WALK_FILE, hero, "-o", tmp_path / "out.bvh", "--add", status=2)
