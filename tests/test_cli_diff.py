"""`distretarget diff` and the report of a run, as a user meets them."""

import csv
import io
import json
import shlex
from pathlib import Path

import numpy as np
import program
import pytest
from bodies import APART, PERSON, clapping, lengthened, posed, standing, swaying

from distretarget import write_bvh
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.measure.diff import diff

BLOCKS = """HIERARCHY
ROOT Block
{
OFFSET 0 0 0
CHANNELS 3 Zrotation Xrotation Yrotation
JOINT Lid
{
OFFSET 0 1 0
CHANNELS 3 Zrotation Xrotation Yrotation
End Site
{
OFFSET 0 1 0
}
}
}
MOTION
Frames: 1
Frame Time: 0.02
0 0 0 0 0 0
"""


def bent(degrees):
    """A person with the feet apart and the left forearm turned."""
    turn = np.radians([0, degrees, 0])
    return standing(APART | {"LeftElbow": turn, "LeftWrist": -turn}, 12, height=0.9)


def clap(most):
    return clapping(most * np.sin(np.linspace(0, np.pi, 15)) ** 2)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The working folder, with clips and a target."""
    monkeypatch.chdir(tmp_path)
    for name, motion in {"a": clap(1.0), "b": clap(0.9), "straight": bent(0), "bent": bent(10)}.items():
        write_bvh(f"{name}.bvh", motion)
    (tmp_path / "blocks.bvh").write_text(BLOCKS)
    (tmp_path / "body.json").write_text(skeleton_to_json(lengthened(PERSON, {"Elbow": 1.3}), "body"))
    return tmp_path


def run(line):
    """Run the program with a line of arguments: exit status, standard output, standard error."""
    done = program.run(*shlex.split(line))
    return done.returncode, done.stdout, done.stderr


def row(output, name):
    """The numbers in the line of a metric."""
    words = next(line for line in output.splitlines() if line.startswith(name))[len(name) :].split()
    return [float(word) for word in words[:2] if word.replace(".", "").replace("e-", "").isdigit()]


def test_the_metrics_are_printed():
    status, output, errors = run("diff straight.bvh bent.bvh -v")
    assert (status, errors) == (0, "")
    assert "12 frames compared, 50 a second" in output
    bones = diff(bent(0), bent(10)).tracks["direction_error"].values.shape[1]
    assert row(output, "direction error") == [pytest.approx(10 / bones, rel=1e-3)]
    assert row(output, "foot skate") == [0, 0]
    assert [word for line in output.splitlines() if line.startswith("contact error") for word in line.split()][2] == "-"
    assert "worst frames by contact error: " not in output
    assert "contacts: none" in output


def test_without_verbose_the_verdict_and_the_worst_frames_are_printed():
    _, output, _ = run("diff straight.bvh straight.bvh")
    assert "B is within all limits" in output
    _, output, _ = run("diff a.bvh b.bvh")
    over = [line for line in output.splitlines() if line.startswith("over a limit: ")]
    assert over
    assert all(", limit " in line and "; worst in frame " in line and "cause: " not in line for line in over)
    assert "worst frames by contact error: " in output
    assert len(output.splitlines()) < 20


def test_a_report_is_named_alike_in_all_commands(tmp_path):
    for option in ("-o", "--report"):
        status, _, _ = run(f"diff a.bvh b.bvh {option} page{option}.html")
        assert status == 0
        assert "</html>" in Path(f"page{option}.html").read_text("utf-8")
    status, _, _ = run("scene a.bvh -t body.json -o out --report scene.html")
    assert status == 0
    assert "</html>" in (tmp_path / "scene.html").read_text("utf-8")


def test_the_worst_frames_and_pairs_are_printed():
    _, output, _ = run("diff a.bvh b.bvh -v --json d.json")
    metrics = json.loads(Path("d.json").read_text())
    (line,) = (line for line in output.splitlines() if line.startswith("worst frames by contact error: "))
    assert line.split(": ")[1].startswith(f"{metrics['worst']['contact_error']} (")
    assert line.count("(") == 5
    first = metrics["contacts"][0]
    assert (
        f"  {first['regions']}: {first['distance_a']:.3f}, {first['distance_b']:.3f} in {first['frames']} frames"
        in output
    )


def test_joints_without_a_counterpart_are_printed():
    tailed = "\n".join(["JOINT Tail", "{", "OFFSET 0 0 1", "CHANNELS 0", "End Site", "{", "OFFSET 0 0 1", "}", "}"])
    text = Path("bent.bvh").read_text()
    place = text.index("JOINT ")
    Path("tail.bvh").write_text(f"{text[:place]}{tailed}\n{text[place:]}")
    assert "joints of B without a counterpart in A: 'Tail'" in run("diff straight.bvh tail.bvh")[1]
    assert "joints of A without a counterpart in B: 'Tail'" in run("diff tail.bvh straight.bvh")[1]


def test_files_have_the_same_numbers(folder):
    status, _, errors = run("diff a.bvh b.bvh --json d.json --csv d.csv")
    assert (status, errors) == (0, "")
    metrics = json.loads((folder / "d.json").read_text())
    rows = list(csv.DictReader(io.StringIO((folder / "d.csv").read_text())))
    assert [{key: float(cell) if cell else None for key, cell in line.items()} for line in rows] == metrics["frames"]
    assert metrics["program"]["command"] == "distretarget diff a.bvh b.bvh --json d.json --csv d.csv"
    assert (metrics["a"]["file"], metrics["b"]["file"]) == ("a.bvh", "b.bvh")


def test_a_file_is_named_without_its_folder(folder):
    (folder / "deep").mkdir()
    (folder / "a.bvh").rename(folder / "deep" / "a.bvh")
    run("diff deep/a.bvh b.bvh --json d.json")
    assert json.loads((folder / "d.json").read_text())["a"]["file"] == "a.bvh"


def test_files_with_the_same_name_are_named_by_their_paths(folder):
    (folder / "new").mkdir()
    (folder / "b.bvh").rename(folder / "new" / "a.bvh")
    _, output, _ = run("diff a.bvh new/a.bvh")
    assert output.startswith("A: a.bvh, ")
    assert "\nB: new/a.bvh, " in output


@pytest.mark.parametrize(
    ("limits", "over"),
    [
        ("direction_error=1", ""),
        ("direction_error=0.1", "direction_error is "),
        ("direction_error=1 turn=0.001 foot_skate=1 contact_error=0", ""),
        ("stress=0", "stress is "),
        ("foot_height=0.01 jerk=3 hips_height=0.01 pop=0", ""),
    ],
)
def test_a_metric_over_its_limit_fails(folder, limits, over):
    options = " ".join(f"--fail-over {limit}" for limit in limits.split())
    status, output, errors = run(f"diff straight.bvh bent.bvh --csv d.csv {options}")
    assert status == (1 if over else 0)
    assert output
    assert (folder / "d.csv").exists()
    assert errors.count("\n") == status
    assert errors.startswith(f"distretarget: bent.bvh: {over}" if over else "")


def test_feet_that_slide_where_they_stood_are_over_the_limit():
    """Where A does not slide, the ratio of slides is undefined, and the limit still holds."""
    for name, speed in (("still", 0.0), ("noisy", 1e-5), ("sliding", 0.02)):
        path = np.outer(np.arange(12) * 0.02 * speed, [1.0, 0, 0]) + np.array([0, 0.9, 0])
        write_bvh(f"{name}.bvh", posed(PERSON, {}, path))
    assert run("diff still.bvh noisy.bvh --fail-over foot_skate=1.1")[0] == 0
    assert run("diff noisy.bvh sliding.bvh --fail-over foot_skate=1.1")[0] == 1
    assert run("diff sliding.bvh sliding.bvh --fail-over foot_skate=1")[0] == 0


def test_every_metric_over_its_limit_is_named():
    limits = ("stress", "contact_error", "direction_error")
    errors = run("diff a.bvh b.bvh " + " ".join(f"--fail-over {name}=0" for name in limits))[2]
    assert [part.split(" is ")[0].split()[-1] for part in errors.split("; ")] == list(limits)
    assert errors.count("over 0") == 3


BAD = {
    "missing A": ("diff none.bvh b.bvh", 1, "none.bvh: there is no such file"),
    "missing B": ("diff a.bvh none.bvh", 1, "none.bvh: there is no such file"),
    "one argument": ("diff a.bvh", 2, "'B'"),
    "a skeleton file": ("diff a.bvh body.json", 1, "body.json"),
    "no body in common": ("diff a.bvh blocks.bvh", 1, "`distretarget skeleton match a.bvh blocks.bvh -o MAP.json`"),
    "output is A": ("diff a.bvh b.bvh -o a.bvh --overwrite", 1, "a.bvh: is an input"),
    "JSON is B": ("diff a.bvh b.bvh --json ./b.bvh --overwrite", 1, "is an input"),
    "CSV is JSON": ("diff a.bvh b.bvh --json d --csv d", 1, "another output"),
    "CSV exists": ("diff a.bvh b.bvh --csv blocks.bvh", 1, "--overwrite"),
    "report exists": ("diff a.bvh b.bvh -o blocks.bvh", 1, "--overwrite"),
    "no folder": ("diff a.bvh b.bvh --json no/d.json", 1, "no folder"),
    "missing map": ("diff a.bvh b.bvh --map none.json", 1, "none.json"),
    "map of a strange joint": ("diff a.bvh b.bvh --map strange.json", 1, "Tail"),
    "unknown metric": ("diff a.bvh b.bvh --fail-over beauty=1", 2, "expected one of contact_error, skin_depth"),
    "limit no number": ("diff a.bvh b.bvh --fail-over jerk=low", 2, "as limit of jerk, found 'low'"),
    "limit nan": ("diff a.bvh b.bvh --fail-over jerk=nan", 2, "as limit of jerk"),
    "limit below 0": ("diff a.bvh b.bvh --fail-over jerk=-1", 2, "as limit of jerk"),
    "no limit": ("diff a.bvh b.bvh --fail-over jerk", 2, "as limit of jerk"),
    "no frames": ("diff a.bvh still.bvh", 1, "still.bvh: B has no frames"),
    "report is the output": ("a.bvh body.json -o o --report o", 1, "another output"),
    "report is the source": ("a.bvh body.json -o o --report a.bvh --overwrite", 1, "an input"),
    "report exists already": ("a.bvh body.json -o o --report blocks.bvh", 1, "--overwrite"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_use_gives_one_line_and_changes_nothing(folder, case):
    (folder / "strange.json").write_text('{"Tail": "Hips"}')
    (folder / "still.bvh").write_text(BLOCKS.replace("Frames: 1", "Frames: 0").replace("0 0 0 0 0 0\n", ""))
    line, status, words = BAD[case]
    assert words in program.refused(*shlex.split(line), status=status)


def test_outputs_are_replaced_if_asked(folder):
    (folder / "d.csv").write_text("old")
    assert run("diff a.bvh b.bvh --csv d.csv --overwrite")[0] == 0
    assert (folder / "d.csv").read_text().startswith("frame,")


def test_a_map_is_followed(folder):
    (folder / "map.json").write_text('{"LeftElbow": null}')
    status, output, _ = run("diff a.bvh b.bvh --map map.json")
    assert status == 0
    assert "joints of B without a counterpart in A: 'LeftElbow'" in output


def test_resampling_is_reported():
    write_bvh("fast.bvh", clapping(np.sin(np.linspace(0, np.pi, 29)) ** 2, "0.01"))
    output = run("diff a.bvh fast.bvh")[1]
    assert "A was resampled from 50 to 100 frames/s" in output


def test_the_report_of_a_run(folder):
    status, output, errors = run("a.bvh body.json -o out.bvh --report out.html")
    assert (status, errors) == (0, "")
    assert output.count("\n") == 1
    page = (folder / "out.html").read_text()
    assert "distretarget a.bvh body.json -o out.bvh --report out.html" in page
    assert '"file":"out.bvh"' in page
    assert '"rotation_copy":{' in page


def test_the_report_of_a_run_on_swaying_bodies_follows_the_paper(folder):
    write_bvh("sway.bvh", swaying(PERSON, 5))
    assert run("sway.bvh body.json -o out.bvh --report out.html --objective paper")[0] == 0
    assert (folder / "out.html").stat().st_size > 1000
