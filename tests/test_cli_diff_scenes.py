"""`distretarget diff` of two scenes, as a user meets it."""

import csv
import io
import json

import pytest
from bodies import SAMPLES
from pages import settle
from program import refused, run, succeeded
from sample_scenes import SCENES
from schemas import validator

from distretarget import write_bvh

HANDSHAKE = SAMPLES / "scenes" / "handshake"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The folders of results of two sample scenes."""
    folder = tmp_path_factory.mktemp("results")
    for name in ("handshake", "staff"):
        succeeded("scene", SAMPLES / "scenes" / name, "-o", folder / name)
    return folder


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_result_is_measured_against_its_scene_file(results, folder):
    done = run("diff", HANDSHAKE / "scene.json", results / "handshake", "--json", "d.json", "--csv", "d.csv")
    assert (done.returncode, done.stderr) == (0, "")
    assert "performers: one, other" in done.stdout
    metrics = json.loads((folder / "d.json").read_text())
    validator("report/scene_diff").validate(metrics)
    (gaps,) = metrics["gaps"]
    between, line = "one's right hand - other's right hand", done.stdout.splitlines()[-1]
    numbers = [f"{gaps[key]:.1f}" for key in ("gap_a", "gap_b", "gap_worst", "gap_error")]
    assert line.startswith(between)
    assert line.removeprefix(between).split() == [str(gaps["frames"]), *numbers, str(gaps["worst_frame"])]
    rows = list(csv.DictReader(io.StringIO((folder / "d.csv").read_text())))
    assert [row["performer"] for row in rows] == ["one"] * 157 + ["other"] * 157
    assert float(rows[0]["jerk"]) == metrics["performers"]["one"]["frames"][0]["jerk"]


@pytest.mark.usefixtures("folder")
def test_results_are_matched_by_the_maps_of_their_scene_file(results, folder):
    scene = json.loads((HANDSHAKE / "scene.json").read_text())
    for performer in scene["performers"]:
        performer |= {key: str(HANDSHAKE / performer[key]) for key in ("source", "target")}
    scene["performers"][0]["map"] = "map.json"
    (folder / "scene.json").write_text(json.dumps(scene))
    (folder / "map.json").write_text(json.dumps({"LeftWrist": None, "LeftWrist_End": None}))
    succeeded("diff", "scene.json", results / "handshake", "--json", "d.json")
    performers = json.loads((folder / "d.json").read_text())["performers"]
    assert "LeftWrist" in performers["one"]["unmatched_b"]
    assert "LeftWrist" not in performers["other"]["unmatched_b"]
    (folder / "none.json").write_text("{}")
    succeeded("diff", "scene.json", results / "handshake", "--map", "none.json", "--json", "e.json")
    assert "LeftWrist" not in json.loads((folder / "e.json").read_text())["performers"]["one"]["unmatched_b"]


def test_a_folder_with_a_scene_file_is_that_scene_and_props_are_followed(results):
    done = run("diff", SAMPLES / "scenes" / "staff", results / "staff", "--fail-over", "gap_error=1")
    assert (done.returncode, done.stderr) == (0, "")
    assert "props: staff" in done.stdout
    assert "performer's left hand - staff " in done.stdout


def test_folders_without_a_scene_file_are_scenes_too(results):
    done = run("diff", results / "staff", results / "staff", *("--fail-over", "gap_error=0"))
    assert (done.returncode, done.stderr) == (0, "")
    assert "props: staff" in done.stdout
    assert "a mean error of 0.0; 1 unit of A's world is 1 units of B's" in done.stdout


def test_who_never_meets_touches_nothing(folder):
    for name in ("a", "b"):
        (folder / name).mkdir()
        write_bvh(folder / name / "one.bvh", next(iter(SCENES["handshake"]().performers.values())))
    done = succeeded("diff", "a", "b", "--json", "d.json", "--fail-over", "gap_error=0")
    assert "no contacts between performers and props in A" in done.stdout
    validator("report/scene_diff").validate(json.loads((folder / "d.json").read_text()))


@pytest.mark.usefixtures("folder")
def test_metrics_over_their_limits_fail(results):
    limits = ("--fail-over", "gap_error=0.001", "--fail-over", "direction_error=0.1")
    done = run("diff", HANDSHAKE, results / "handshake", *limits)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    for words in ("handshake: gap_error is ", "over 0.001", "one's direction_error is ", "other's direction_error is "):
        assert words in done.stderr


def test_scenes_that_cannot_be_compared_are_refused(results, folder):
    (folder / "empty").mkdir()
    scene, result = HANDSHAKE / "scene.json", results / "handshake"
    for arguments, status, words in (
        ((result, results / "staff"), 1, f"{results / 'staff'}: lacks 'one', 'other', in {str(result)!r}"),
        ((results / "staff", result), 1, f"{result}: lacks 'performer', 'staff', in "),
        ((result, "empty"), 1, "empty: has no motion file and no scene.json in it"),
        ((result / "one.bvh", result), 1, f"{result / 'one.bvh'}: is not a scene, but {str(result)!r} is"),
        ((scene, result / "one.bvh"), 1, "name two scenes or two clips"),
        ((scene, "missing.json"), 1, "missing.json: there is no such file"),
        ((scene, result, "-o", result / "one.bvh", "--overwrite"), 1, "is an input"),
        ((scene, result, "--json", "d", "--csv", "d"), 1, "another output"),
        ((scene, result, "--world-scale", "0"), 2, "expected a number above 0"),
        ((result / "one.bvh", result / "other.bvh", "--world-scale", "1"), 2, "--world-scale is for scenes"),
        ((result / "one.bvh",) * 2 + ("--fail-over", "gap_error=1"), 2, "--fail-over gap_error is for scenes"),
    ):
        assert words in refused("diff", *arguments, status=status), arguments


def test_the_report_plays_in_a_browser(results, folder, open_player):
    assert run("diff", HANDSHAKE, results / "handshake", "-o", "d.html", "--json", "d.json", "-q").stdout == ""
    (gaps,) = json.loads((folder / "d.json").read_text())["gaps"]
    tab = open_player(folder / "d.html")
    assert tab.locator("#labels > div").count() == 2
    touch, metrics = tab.locator("#tables table").all()
    assert touch.locator("tbody tr").count() == 1
    assert metrics.locator("thead th").all_inner_texts() == ["metric", "one A", "one B", "other A", "other B"]
    touch.get_by_role("button").click()
    settle(tab)
    assert tab.locator("#now").inner_text().startswith(f"{gaps['worst_frame']} / 156")
