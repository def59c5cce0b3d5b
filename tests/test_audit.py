"""`distretarget audit`: planted faults are found, clips are compared, and the table and exit status say so."""

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import SAMPLES, sample
from planted_faults import PLANTED, faults_of
from program import refused, run, succeeded

from distretarget import Motion, read_bvh, write_bvh
from distretarget.batch.audit import LIMITS, AuditedClip, _compare, audit
from distretarget.skeleton import Skeleton

CLEAN = ("clap", "squat", "turn", "walk", "wave")


@pytest.mark.parametrize("name", CLEAN)
def test_clean_clips_have_no_faults(name):
    assert faults_of(sample(name)) == {}


@pytest.mark.parametrize("fault", PLANTED)
@pytest.mark.parametrize("name", ["squat", "walk"])
def test_a_planted_fault_is_found(name, fault):
    kind, plant = PLANTED[fault]
    assert kind in faults_of(plant(sample(name)))


@pytest.mark.parametrize("frames", [slice(0), slice(1), slice(2), slice(3), slice(5), np.zeros(50, np.intp)])
def test_short_and_still_clips_have_no_faults_but_that(frames):
    part = sample("walk")[frames]
    still = {"still"} if isinstance(frames, np.ndarray) else set()
    assert faults_of(part).keys() == ({"unreadable"} if len(part) < 2 else still)


def test_a_frame_of_a_fault_is_one_of_the_clip_as_it_is():
    """Frames left out of the search, repeated ones and those before the motion begins, count."""
    planted = PLANTED["an arm that leaps for a frame"][1](sample("walk"))
    assert faults_of(planted)["jumps"].frame in (124, 125)
    late = PLANTED["T-pose in the first five frames"][1](planted[np.repeat(np.arange(len(planted)), 2)])
    found = faults_of(late)
    assert found["first_pose"].value == 5
    assert found["jumps"].frame in range(248, 252)


@pytest.mark.parametrize("milliseconds", ["33.333", "8.3333", "16.667"])
def test_a_frame_time_in_milliseconds_is_a_fault(milliseconds):
    found = faults_of(replace(sample("walk"), frame_time_text=milliseconds))["frame_time"]
    assert found.where == f"{float(milliseconds):.3g} s a frame"


CLEAN_CLIPS = ("clap", "squat", "turn", "walk")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("clips/deep").mkdir(parents=True)
    for name in CLEAN_CLIPS:
        shutil.copy(SAMPLES / f"{name}.bvh", "clips/deep" if name == "walk" else "clips")
    return tmp_path


def faults(folder):
    clips = audit(sorted(folder.glob("clips/**/*.bvh")))
    found = {clip.path.stem: set(clip.faults(LIMITS)) for clip in clips}
    return {name: kinds for name, kinds in found.items() if kinds}


def planted(name, change):
    text = Path("clips/clap.bvh").read_text()
    Path(f"clips/{name}.bvh").write_text(change(text))


def scaled(motion, factor):
    skeleton: Skeleton = motion.skeleton.with_offsets(factor * motion.skeleton.offsets)
    return type(motion)(skeleton, factor * motion.root_positions, motion.rotations, motion.frame_time_text)


@pytest.mark.usefixtures("folder")
def test_a_page_shows_the_worst_frame_of_each_fault():
    motion = sample("wave")
    joint = motion.skeleton.index("LeftKnee")
    rotations = np.array(motion.rotations)
    rotations[100:103, joint] = [1.0, 0.0, 0.0, 0.0]
    write_bvh("clips/<i>.bvh", Motion(motion.skeleton, motion.root_positions, rotations, motion.frame_time_text))
    done = run("audit", "clips", "--report", "audit.html")
    assert done.returncode == 1
    page = Path("audit.html").read_text()
    assert "5 clips: 4 without faults" in page
    assert "&lt;i&gt;.bvh" in page
    assert "<i>" not in page
    assert page.count("<svg") == page.count("<circle") / 3 >= 1
    assert "LeftKnee" in page


def test_clean_clips_of_one_rig_have_no_faults(folder):
    assert faults(folder) == {}


def test_a_clip_in_another_unit_is_found(folder):
    write_bvh("clips/metres.bvh", scaled(sample("wave"), 0.01))
    assert faults(folder) == {"metres": {"unit"}}


def test_of_two_clips_none_is_the_unusual_one(folder):
    for name in CLEAN_CLIPS[1:]:
        next(folder.glob(f"clips/**/{name}.bvh")).unlink()
    write_bvh("clips/metres.bvh", scaled(sample("wave"), 0.01))
    assert faults(folder) == {}


@pytest.mark.parametrize("change", [lambda motion: motion, lambda motion: scaled(motion, 1.2)])
def test_a_clip_that_is_there_twice_is_found_at_any_place_and_size(folder, change):
    motion = change(sample("clap"))
    path = motion.root_positions + np.array([30.0, 0.0, -20.0])
    write_bvh("clips/copy.bvh", type(motion)(motion.skeleton, path, motion.rotations, motion.frame_time_text))
    assert faults(folder) == {"copy": {"duplicate"}}


@pytest.mark.parametrize(
    "change",
    [lambda text: text[: len(text) // 2], lambda text: text[:0], lambda text: text.replace("Frames: 277", "Frames: 0")],
)
def test_what_cannot_be_read_is_a_fault_and_stops_nothing(folder, change):
    planted("broken", change)
    assert faults(folder) == {"broken": {"unreadable"}}


@pytest.mark.usefixtures("folder")
def test_faults_are_listed_and_the_exit_status_says_so():
    clean = run("audit", "clips")
    assert (clean.returncode, clean.stdout) == (0, "4 clips: 4 without faults\n")
    motion = read_bvh("clips/turn.bvh")
    path = np.array(motion.root_positions)
    path[50:] += [100.0, 0.0, 0.0]
    write_bvh(
        "clips/turn.bvh", type(motion)(motion.skeleton, path, motion.rotations, motion.frame_time_text), overwrite=True
    )
    done = run("audit", "clips", "--table", "audit.csv")
    assert done.returncode == 1
    assert "cuts 1 (frame 50)" in done.stdout
    assert "4 clips: 3 without faults\n1 cuts: " in done.stdout
    rows = {row["clip"]: row for row in csv.DictReader(Path("audit.csv").read_text().splitlines())}
    assert len(rows) == 4
    assert rows["clips/turn.bvh"]["faults"] == "cuts"
    assert rows["clips/turn.bvh"]["cuts"] == "1"
    succeeded("audit", "clips", "--limit", "cuts=1")


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (["none"], 2, "none: there is no such file or folder"),
        (["empty"], 1, "there are no clips"),
        (["clips", "--limit", "skate=1"], 2, "found 'skate=1'"),
        (["clips", "--limit", "cuts=x"], 2, "found 'x'"),
        (["clips", "--table", "audit.txt"], 1, ".csv"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_wrong_usage_is_one_line(arguments, status, says):
    Path("empty").mkdir()
    assert says in refused("audit", *arguments, status=status)


@pytest.mark.parametrize(("ups", "found"), [("YYZ", [2]), ("YYZZ", []), ("YZYZY", [1, 3]), ("YYZX", []), ("YYYY", [])])
def test_what_is_usual_is_what_more_than_half_of_the_clips_have(ups, found):
    clips = [AuditedClip(path=Path(up), findings={}, up=up, leg=1.0, frame_time=0.02) for up in ups]
    _compare(clips)
    assert [number for number, clip in enumerate(clips) if "up_axis" in clip.findings] == found
    rates = [AuditedClip(path=Path(up), findings={}, leg=1.0, frame_time=0.02 + 0.01 * "YZX".index(up)) for up in ups]
    _compare(rates)
    off = [number for number, clip in enumerate(rates) if clip.faults(LIMITS).keys() & {"frame_time"}]
    assert off == found
