"""`distretarget batch` as a user meets it: folders in and out, exit status, stops, and real workers."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bodies import CORPUS, SAMPLES, needs_corpus, other_lengths, person, swaying
from click.testing import CliRunner

from distretarget import read_bvh, retarget, write_bvh
from distretarget.cli import cli
from distretarget.errors import BatchError
from distretarget.io.bvh import format_bvh
from distretarget.io.skeleton_json import skeleton_to_json

LONG = 600  # frames that take a moment
LONGER = 6000  # frames that are under way while clips of LONG are done
TINY = 150  # clips of one frame


def command(*arguments):
    return [sys.executable, "-m", "distretarget", "batch", *map(str, arguments)]


def run(*arguments, cwd=None, **others):
    return subprocess.run(command(*arguments), capture_output=True, text=True, cwd=cwd, timeout=120, **others)


def lines(folder):
    return [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]


def tree(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.bvh")}


@pytest.fixture
def folder(tmp_path):
    for seed, name in enumerate(("a.bvh", "deep/b.bvh", "deep/er/c.bvh")):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        write_bvh(tmp_path / "in" / name, swaying(person(), seed=seed))
    (tmp_path / "body.json").write_text(skeleton_to_json(other_lengths(person()), "body"))
    return tmp_path


def test_a_folder_in_a_folder_out(folder):
    done = run("in", "body.json", "-o", "out", "--jobs", 2, cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("3 clips: 3 converted, 0 done before, 0 failed\n60 frames in ")
    assert tree(folder / "out").keys() == {"a.bvh", "deep/b.bvh", "deep/er/c.bvh"}
    expected = format_bvh(retarget(read_bvh(folder / "in/a.bvh"), other_lengths(person())).motion)
    assert (folder / "out/a.bvh").read_text() == expected
    again = run("in", "body.json", "-o", "out", cwd=folder)
    assert again.stdout == "3 clips: 0 converted, 3 done before, 0 failed\n"
    assert len(lines(folder / "out")) == 3


def test_one_bad_file_does_not_stop_the_rest(folder):
    (folder / "in" / "bad.bvh").write_text("HIERARCHY\nnonsense")
    done = run("in", "body.json", "-o", "out", cwd=folder)
    assert done.returncode == 1
    assert "4 clips: 3 converted, 0 done before, 1 failed" in done.stdout
    assert "failed:\n  in/bad.bvh:2: " in done.stdout
    assert len(tree(folder / "out")) == 3
    assert sorted(line["status"] for line in lines(folder / "out")) == ["done", "done", "done", "failed"]


def test_several_targets(folder):
    shutil.copy(folder / "body.json", folder / "other.json")
    done = run("in/a.bvh", "--target", "body.json", "--target", "other.json", "-o", "out", cwd=folder)
    assert done.returncode == 0
    assert tree(folder / "out").keys() == {"body/a.bvh", "other/a.bvh"}


def test_options_pass_through(folder):
    (folder / "map.json").write_text('{"Head": null}')
    done = run(
        "in/a.bvh", "body.json", "-o", "out", "--feet", "free", "--root-scale", 3, "--map", "map.json", cwd=folder
    )
    assert done.returncode == 0
    (line,) = lines(folder / "out")
    assert (line["options"]["hold_feet"], line["options"]["root_scale"]) == (False, 3.0)
    assert line["options"]["map"] == {"Head": None}
    body = other_lengths(person())
    made = retarget(read_bvh(folder / "in/a.bvh"), body, hold_feet=False, root_scale=3.0, joint_map={"Head": None})
    assert (folder / "out/a.bvh").read_text() == format_bvh(made.motion)


@pytest.mark.parametrize("from_stdin", [True, False])
def test_lists_of_files(folder, from_stdin):
    text = "in/deep/b.bvh\n\nin/a.bvh\n"
    (folder / "list.txt").write_text(text)
    others = {"input": text} if from_stdin else {}
    done = run("body.json", "-o", "out", "--input-list", "-" if from_stdin else "list.txt", cwd=folder, **others)
    assert done.returncode == 0
    assert tree(folder / "out").keys() == {"a.bvh", "deep/b.bvh"}


def test_lists_of_any_tool(folder):
    (folder / "list.txt").write_bytes(b"\xef\xbb\xbfin/a.bvh\r\nin/deep/b.bvh\r\nin/a.bvh\r\n")
    done = run("body.json", "-o", "out", "--input-list", "list.txt", cwd=folder)
    assert (done.returncode, tree(folder / "out").keys()) == (0, {"a.bvh", "deep/b.bvh"})


def test_streams_that_hold_few_characters(folder):
    (folder / "in/a.bvh").rename(folder / "in/\u52d5.bvh")
    narrow = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    done = run("in", "body.json", "-o", "out", cwd=folder, env=narrow)
    assert (done.returncode, done.stderr) == (0, "")
    shown = subprocess.run(
        [sys.executable, "-m", "distretarget", "skeleton", "show", "body.json"],
        capture_output=True,
        env=narrow,
        cwd=folder,
    )
    assert (shown.returncode, shown.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_standard_output_is_told(folder):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "distretarget", "skeleton", "show", "body.json"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=folder)
    assert (done.returncode, done.stderr) == (1, "distretarget: standard output: the disk is full\n")


def test_a_dry_run_writes_nothing(folder):
    done = run("in", "body.json", "-o", "out", "--dry-run", cwd=folder)
    assert done.returncode == 0
    assert "convert  in/deep/b.bvh -> out/deep/b.bvh\n" in done.stdout
    assert not (folder / "out").exists()
    run("in/a.bvh", "body.json", "-o", "out", cwd=folder)
    (folder / "in/deep/er/c.bvh").write_bytes(b"\0")
    again = run("in", "body.json", "-o", "out", "--dry-run", cwd=folder).stdout
    assert "skip     in/a.bvh -> out/a.bvh\n" in again
    (folder / "mine").mkdir()
    (folder / "mine" / "a.bvh").write_text("mine")
    fails = run("in", "body.json", "-o", "mine", "--dry-run", cwd=folder).stdout
    assert "fail     mine/a.bvh: exists already" in fails
    assert [path.name for path in (folder / "mine").iterdir()] == ["a.bvh"]
    assert "convert  in/deep/b.bvh" in again
    assert tree(folder / "out").keys() == {"a.bvh"}


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        ([], 2, "expected SOURCES... TARGET"),
        (["body.json"], 2, "no sources"),
        (["in", "body.json", "in"], 2, "in is a folder; the last argument is the target"),
        (["in", "body.json", "--jobs", "0"], 2, "--jobs"),
        (["in", "body.json", "--jobs", "2", "--dask", "x"], 2, "give either --jobs or --dask"),
        (["in", "body.json", "--objective", "paper", "--feet", "hold"], 2, "--feet hold"),
        (["in", "none.json"], 1, "none.json: there is no such file"),
        (["in/a.bvh", "more/a.bvh", "body.json"], 2, "would be the result of both"),
        (["in", "bad.json"], 1, "bad.json: "),
        (["in", "body.json", "--include", "nothing"], 1, "there are no clips to convert"),
        (["in", "body.json", "--input-list", "none.txt"], 2, "none.txt"),
        (["in", "typo", "body.json"], 2, "typo: there is no such file or folder"),
        (["in", "body.json", "--report", "in/a.bvh", "--overwrite"], 1, "in/a.bvh: is an input"),
        (["in", "body.json", "--report", "body.json", "--overwrite"], 1, "body.json: is an input"),
        (["in", "body.json", "--report", "out/a.bvh", "--overwrite"], 1, "the place of a result"),
        (["in", "body.json", "--report", "out/manifest.jsonl"], 1, "the place of a result"),
    ],
)
def test_wrong_usage_is_one_line(folder, arguments, status, says):
    (folder / "bad.json").write_text('{"format": "distretarget-skeleton"}')
    shutil.copytree(folder / "in", folder / "more")
    done = run(*arguments, "-o", "out", cwd=folder)
    assert done.returncode == status
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (folder / "out").exists()


def test_results_inside_the_source_are_refused(folder):
    done = run("in", "body.json", "-o", "in/out", cwd=folder)
    assert (done.returncode, "is inside in" in done.stderr) == (2, True)
    assert not (folder / "in/out").exists()


def test_pages(folder):
    def pages():
        return {path.relative_to(folder / "out").as_posix() for path in (folder / "out").rglob("*.html")}

    once = ("in", "body.json", "-o", "out", "--report", "out/index.html", "--reports")
    assert run(*once, "worst:1", cwd=folder).returncode == 0
    assert len(pages()) == 2
    (report,) = pages() - {"index.html"}
    assert f'"{report}"' in (folder / "out/index.html").read_text()
    assert run(*once, "all", cwd=folder).returncode == 0
    assert pages() == {"index.html", *(f"index_reports/{place}.html" for place in ("a", "deep/b", "deep/er/c"))}
    shutil.rmtree(folder / "out")
    assert run(*once, "all", cwd=folder).returncode == 0
    assert len(pages()) == 4
    shutil.rmtree(folder / "out")
    assert run(*once, "none", cwd=folder).returncode == 0
    assert pages() == {"index.html"}
    wrong = run(*once, "worst", cwd=folder)
    assert (wrong.returncode, "expected worst:N" in wrong.stderr) == (2, True)


def test_only_reports_on_the_present_results_are_linked(folder):
    once = ("in/a.bvh", "body.json", "-o", "out", "--report", "out/index.html", "--reports")
    run(*once, "all", cwd=folder)
    report, index = folder / "out/index_reports/a.html", folder / "out/index.html"
    before = report.read_text()
    run(*once, "none", "--root-scale", 3, cwd=folder)
    assert report.read_text() == before
    assert "index_reports/a.html" not in index.read_text()
    run(*once, "all", "--root-scale", 3, cwd=folder)
    assert report.read_text() != before
    assert "index_reports/a.html" in index.read_text()


def test_a_report_that_cannot_be_written_does_not_stop_the_rest(folder):
    (folder / "out/index_reports").mkdir(parents=True)
    (folder / "out/index_reports/a.html").write_text("mine")
    done = run("in", "body.json", "-o", "out", "--report", "out/index.html", "--reports", "all", cwd=folder)
    assert done.returncode == 1
    assert "3 clips: 3 converted" in done.stdout
    assert done.stderr == "no report: out/index_reports/a.html: exists already; --overwrite replaces it\n"
    assert (folder / "out/index.html").exists()


def test_a_page_of_somebody_else_is_left_alone(folder):
    (folder / "page.html").write_text("my own")
    done = run("in", "body.json", "-o", "out", "--report", "page.html", cwd=folder)
    assert done.returncode == 1
    assert done.stderr == "distretarget: page.html: exists already; --overwrite replaces it\n"
    assert not (folder / "out").exists()


# ---- stops


def long_clips(folder, *frames):
    shutil.rmtree(folder / "in")
    (folder / "in").mkdir()
    for seed, count in enumerate(frames):
        write_bvh(folder / "in" / f"{seed}.bvh", swaying(person(), frames=count, seed=seed))


def started(folder, at_least):
    """A run that has finished so many clips, in a group of its own."""
    process = subprocess.Popen(
        command("in", "body.json", "-o", "out", "--jobs", 2),
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    manifest = folder / "out" / "manifest.jsonl"
    while process.poll() is None and not (manifest.exists() and manifest.read_bytes().count(b"\n") >= at_least):
        time.sleep(0.01)
    return process


def workers_of(group):
    """The processes of a group that are still there."""
    found = subprocess.run(["ps", "-o", "pid=,stat=", "--sid", str(group)], capture_output=True, text=True).stdout
    return [line for line in found.splitlines() if "Z" not in line.split()[1]]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL") or not shutil.which("ps"), reason="needs signals and ps")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_a_run_that_was_stopped_goes_on(folder, name):
    long_clips(folder, LONGER, *[LONG] * 5)
    process = started(folder, at_least=2)
    if name == "SIGINT":
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    else:
        process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=30)
    before = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*.bvh")}
    if name != "SIGKILL":
        assert process.returncode == 130
        assert " left" in out.splitlines()[0]
        assert err == "distretarget: interrupted; run this again to go on\n"
        assert not list((folder / "out").glob(".*"))
    deadline = time.monotonic() + 20
    while workers_of(process.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not workers_of(process.pid)
    done = run("in", "body.json", "-o", "out", cwd=folder)
    assert done.returncode == 0
    assert not list((folder / "out").glob(".*"))
    whole = [path for path, time_then in before.items() if path.stat().st_mtime_ns == time_then]
    assert len(whole) == len(before) >= 1
    shutil.move(folder / "out", folder / "stopped")
    run("in", "body.json", "-o", "out", cwd=folder)
    assert tree(folder / "stopped") == tree(folder / "out")


def test_two_runs_into_one_folder(folder):
    long_clips(folder, *[LONG] * 3)
    processes = [started(folder, 0) for _ in range(2)]
    assert [process.communicate(timeout=60) and process.returncode for process in processes] == [0, 0]
    assert {line["status"] for line in lines(folder / "out")} == {"done"}
    shutil.move(folder / "out", folder / "both")
    run("in", "body.json", "-o", "out", cwd=folder)
    assert tree(folder / "both") == tree(folder / "out")


# ---- workers


def test_one_long_clip_in_pieces_is_the_same(folder):
    write_bvh(folder / "long.bvh", swaying(person(), frames=3000))
    assert (folder / "long.bvh").stat().st_size > 1 << 20  # so that it is cut
    one = run("long.bvh", "body.json", "-o", "one", "--jobs", 1, cwd=folder)
    two = run("long.bvh", "body.json", "-o", "two", "--jobs", 2, cwd=folder)
    assert (one.returncode, two.returncode) == (0, 0)
    assert tree(folder / "one") == tree(folder / "two")


def test_dask_gives_the_same_and_survives_a_dying_worker(folder):
    distributed = pytest.importorskip("distributed", reason="needs distributed")
    long_clips(folder, *[LONG] * 6)
    local = run("in", "body.json", "-o", "local", "--jobs", 2, cwd=folder)
    assert local.returncode == 0
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        plain = run("in", "body.json", "-o", "dask", "--dask", address, cwd=folder)
        assert (plain.returncode, plain.stderr) == (0, "")
        assert tree(folder / "dask") == tree(folder / "local")
        process = subprocess.Popen(
            command("in", "body.json", "-o", "killed", "--dask", address), cwd=folder, stdout=subprocess.PIPE, text=True
        )
        manifest = folder / "killed" / "manifest.jsonl"
        while process.poll() is None and not (manifest.exists() and manifest.stat().st_size):
            time.sleep(0.01)
        os.kill(cluster.workers[0].process.process.pid, signal.SIGKILL)
        process.communicate(timeout=60)
        assert process.returncode == 0
        assert tree(folder / "killed") == tree(folder / "local")


def test_a_scheduler_that_is_not_there(folder, monkeypatch):
    pytest.importorskip("distributed", reason="needs distributed")
    monkeypatch.setattr("distretarget.batch.pools.CONNECT_TIMEOUT", "1s")
    monkeypatch.chdir(folder)
    arguments = ["batch", "in", "body.json", "-o", "out", "--dask", "tcp://127.0.0.1:9"]
    error = CliRunner().invoke(cli, arguments).exception
    assert isinstance(error, BatchError)
    assert str(error).startswith("no Dask scheduler answers at tcp://127.0.0.1:9: ")
    assert "\n" not in str(error)
    assert not (folder / "out").exists()


def test_workers_run_the_same_program(folder):
    (folder / "distretarget" / "batch").mkdir(parents=True)
    for module in ("__init__.py", "batch/__init__.py", "batch/warmed.py"):
        (folder / "distretarget" / module).write_text("open('imported', 'a').close()")
    program = shutil.which("distretarget", path=Path(sys.executable).parent)
    if not program:
        pytest.skip("needs the installed command")
    arguments = ["batch", "in", "body.json", "-o", "out"]
    done = subprocess.run([program, *arguments], capture_output=True, text=True, cwd=folder, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert not (folder / "imported").exists()


# ---- real folders


def test_many_tiny_clips(folder):
    shutil.rmtree(folder / "in")
    (folder / "in").mkdir()
    text = format_bvh(swaying(person(), frames=1))
    for number in range(TINY):
        (folder / "in" / f"{number}.bvh").write_text(text)
    done = run("in", "body.json", "-o", "out", cwd=folder)
    assert done.returncode == 0
    assert done.stdout.startswith(f"{TINY} clips: {TINY} converted")
    assert len(set(tree(folder / "out").values())) == 1


@needs_corpus
def test_the_corpus_adds_up(tmp_path):
    done = run(CORPUS, SAMPLES / "rigs" / "mixamo_t.json", "-o", tmp_path)
    assert done.returncode == 1
    total = sum(path.suffix.lower() == ".bvh" for path in CORPUS.rglob("*"))
    counts = [line["status"] for line in lines(tmp_path)]
    assert len(counts) == total
    assert counts.count("done") == len(tree(tmp_path))
    assert all(line["error"] for line in lines(tmp_path) if line["status"] == "failed")
