"""`distretarget batch` as a user meets it: folders in and out, exit status, stops, and real workers."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from bodies import CORPUS, SAMPLES, needs_corpus, other_lengths, person, swaying
from bvh_texts import format_bvh
from program import command, last_records, refused, run, run_process, start_process, wait_until

from distretarget import Options, read_bvh, retarget, write_bvh
from distretarget.io.skeleton_json import skeleton_to_json

CLIPS = 6  # of the length LONG
LONG = 250  # frames, which take a moment to convert
LONGER = 2500  # frames, which take longer to convert than all other clips
HANGS = 1800  # after this time a process counts as hanging [s]


def batch(*arguments, **options):
    return run("batch", *arguments, **options)


def tree(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.bvh")}


def statuses(folder):
    return sorted(record["status"] for record in last_records(folder).values())


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with three clips and a target."""
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("a.bvh", "deep/b.bvh", "deep/er/c.bvh")):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        write_bvh(tmp_path / "in" / name, swaying(person(), seed=seed))
    (tmp_path / "body.json").write_text(skeleton_to_json(other_lengths(person()), "body"))
    return tmp_path


def test_a_folder_in_a_folder_out(folder):
    done = batch("in", "body.json", "-o", "out", "--jobs", 2)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("3 clips: 3 converted, 0 done before, 0 failed\n60 frames in ")
    assert tree(folder / "out").keys() == {"a.bvh", "deep/b.bvh", "deep/er/c.bvh"}
    expected = format_bvh(retarget(read_bvh(folder / "in/a.bvh"), other_lengths(person())).motion)
    assert (folder / "out/a.bvh").read_text() == expected
    again = batch("in", "body.json", "-o", "out")
    assert again.stdout == "3 clips: 0 converted, 3 done before, 0 failed\n"
    assert len(last_records(folder / "out")) == 3


def test_one_bad_file_does_not_stop_the_rest(folder):
    (folder / "in" / "bad.bvh").write_text("HIERARCHY\nnonsense")
    done = batch("in", "body.json", "-o", "out")
    assert done.returncode == 1
    assert "4 clips: 3 converted, 0 done before, 1 failed" in done.stdout
    assert "failed:\n  in/bad.bvh:2: " in done.stdout
    assert len(tree(folder / "out")) == 3
    assert statuses(folder / "out") == ["done", "done", "done", "failed"]


@pytest.mark.usefixtures("folder")
def test_a_clip_over_the_time_limit_is_named_and_tried_again():
    once = "in/a.bvh", "body.json", "-o", "out", "--time-limit"
    first = batch(*once, "0.001")
    assert first.returncode == 1
    assert "1 clip: 0 converted, 0 done before, 1 failed" in first.stdout
    assert "failed:\n  in/a.bvh: took longer than the limit of 0.001 s; the next run tries it again" in first.stdout
    assert "1 clip: 1 converted, 0 done before, 0 failed" in batch(*once, "1000").stdout


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_cannot_be_searched_is_reported_and_does_not_stop_the_rest(folder):
    """A script that sees exit status 0 may rely on it that every clip in the folders is converted."""
    os.mkfifo(folder / "in" / "pipe.bvh")
    done = batch("in", "body.json", "-o", "out")
    assert (done.returncode, done.stderr) == (1, "not searched: in/pipe.bvh: is not a regular file\n")
    assert "3 clips: 3 converted, 0 done before, 0 failed" in done.stdout


def test_a_run_with_the_wrong_target_does_not_undo_what_was_done(folder):
    blocks = {"format": "distretarget-skeleton", "version": 1, "joints": [
        {"name": "Block", "parent": None, "offset": [0, 0, 0]}, {"name": "Lid", "parent": "Block", "offset": [0, 1, 0]},
    ]}  # fmt: skip
    (folder / "blocks.json").write_text(json.dumps(blocks))
    counts = []
    for target in ("body.json", "blocks.json", "body.json", "body.json"):
        counts.append(batch("in", target, "-o", "out", "--report", "page.html").stdout.splitlines()[0])
    assert counts == [
        "3 clips: 3 converted, 0 done before, 0 failed",
        "3 clips: 0 converted, 0 done before, 3 failed",
        "3 clips: 0 converted, 3 done before, 0 failed",
        "3 clips: 0 converted, 3 done before, 0 failed",
    ]
    assert statuses(folder / "out") == ["done"] * 3


def test_each_target_gets_a_folder(folder):
    shutil.copy(folder / "body.json", folder / "other.json")
    done = batch("in/a.bvh", "--target", "body.json", "--target", "other.json", "-o", "out")
    assert done.returncode == 0
    assert tree(folder / "out").keys() == {"body/a.bvh", "other/a.bvh"}


def test_options_are_passed_on(folder):
    (folder / "map.json").write_text('{"Head": null}')
    done = batch("in/a.bvh", "body.json", "-o", "out", "--supports", "free", "--root-scale", 3, "--map", "map.json")
    assert done.returncode == 0
    options = last_records(folder / "out")["a.bvh"]["options"]
    assert (options["supports"], options["root_scale"], options["map"]) == ("free", 3.0, {"Head": None})
    body = other_lengths(person())
    made = retarget(
        read_bvh(folder / "in/a.bvh"), body, Options(supports="free", root_scale=3.0), joint_map={"Head": None}
    )
    assert (folder / "out/a.bvh").read_text() == format_bvh(made.motion)


@pytest.mark.parametrize("file", ["-", "list.txt", "list_of_windows.txt"])
def test_clips_are_taken_from_a_list(folder, file):
    text = "in/deep/b.bvh\n\nin/a.bvh\n"
    (folder / "list.txt").write_text(text)
    (folder / "list_of_windows.txt").write_bytes(b"\xef\xbb\xbfin/a.bvh\r\nin/deep/b.bvh\r\nin/a.bvh\r\n")
    done = batch("body.json", "-o", "out", "--input-list", file, given=text)
    assert (done.returncode, tree(folder / "out").keys()) == (0, {"a.bvh", "deep/b.bvh"})


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
@pytest.mark.usefixtures("folder")
def test_a_list_without_end_is_refused():
    line = refused("batch", "body.json", "-o", "out", "--input-list", "/dev/zero", status=2)
    assert "expected one path per line" in line


def test_streams_of_few_characters_take_any_name(folder):
    (folder / "in/a.bvh").rename(folder / "in/\u52d5.bvh")
    narrow = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    for arguments in (
        ("batch", "in/\u52d5.bvh", "body.json", "-o", "out", "--jobs", 1),
        ("skeleton", "show", "body.json"),
    ):
        done = run_process(*arguments, env=narrow, encoding="cp1252")
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.usefixtures("folder")
def test_a_full_standard_output_is_reported():
    with Path("/dev/full").open("w") as full:
        words = command("skeleton", "show", "body.json")
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (1, "distretarget: standard output: the disk is full\n")


def test_a_dry_run_writes_nothing(folder):
    done = batch("in", "body.json", "-o", "out", "--dry-run")
    assert done.returncode == 0
    assert "convert  in/deep/b.bvh -> out/deep/b.bvh\n" in done.stdout
    assert not (folder / "out").exists()
    batch("in/a.bvh", "body.json", "-o", "out")
    (folder / "in/deep/er/c.bvh").write_bytes(b"\0")
    again = batch("in", "body.json", "-o", "out", "--dry-run").stdout
    assert "skip     in/a.bvh -> out/a.bvh\n" in again
    (folder / "mine").mkdir()
    (folder / "mine" / "a.bvh").write_text("mine")
    fails = batch("in", "body.json", "-o", "mine", "--dry-run").stdout
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
        (["in", "body.json", "--time-limit", "2", "--dask", "x"], 2, "give either --time-limit or --dask"),
        (["in", "body.json", "--objective", "paper", "--supports", "hold"], 2, "--supports hold"),
        (["in", "none.json"], 1, "none.json: there is no such file"),
        (["in", "body.json", "--format", "bvh,png"], 2, "found 'png'"),
        (["in/a.bvh", "more/a.bvh", "body.json"], 2, "would be the result of both"),
        (["in", "bad.json"], 1, "bad.json: "),
        (["in", "body.json", "--include", "nothing"], 1, "there are no clips to convert"),
        (["in", "body.json", "--input-list", "none.txt"], 2, "none.txt"),
        (["in", "typo", "body.json"], 2, "typo: there is no such file or folder"),
        (["in", "body.json", "--report", "in/a.bvh", "--overwrite"], 1, "in/a.bvh: is an input"),
        (["in", "body.json", "--report", "body.json", "--overwrite"], 1, "body.json: is an input"),
        (["in", "body.json", "--report", "out/a.bvh", "--overwrite"], 1, "the place of a result"),
        (["in", "body.json", "--report", "out/results.sqlite"], 1, "the place of a result"),
    ],
)
def test_wrong_usage_is_one_line(folder, arguments, status, says):
    (folder / "bad.json").write_text('{"format": "distretarget-skeleton"}')
    shutil.copytree(folder / "in", folder / "more")
    assert says in refused("batch", *arguments, "-o", "out", status=status)


def every_file(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.[bn][vp][hz]")}


def test_several_kinds_of_results_are_the_same_in_every_run(folder):
    """Beside each BVH file its arrays, byte for byte the same again; what is missing is made again."""
    for out in ("out", "again"):
        assert batch("in", "body.json", "-o", out, "--npz", "--jobs", 2).returncode == 0
    files = every_file(folder / "out")
    assert sorted(files) == ["a.bvh", "a.npz", "deep/b.bvh", "deep/b.npz", "deep/er/c.bvh", "deep/er/c.npz"]
    assert files == every_file(folder / "again")
    (folder / "out/a.npz").unlink()
    done = batch("in", "body.json", "-o", "out", "--format", "bvh,npz", "--jobs", 1)
    assert done.stdout.startswith("3 clips: 1 converted, 2 done before")
    assert every_file(folder / "out") == files


def test_another_result_does_not_replace_a_file_of_other_origin(folder):
    (folder / "out").mkdir()
    (folder / "out/a.npz").write_text("mine")
    done = batch("in", "body.json", "-o", "out", "--npz", "--jobs", 1)
    assert done.returncode == 1
    assert "a.npz: exists already" in done.stdout
    assert (folder / "out/a.npz").read_text() == "mine"
    assert not (folder / "out/a.bvh").exists()


def test_the_clips_asked_for_get_reports(folder):
    def pages():
        return {path.relative_to(folder / "out").as_posix() for path in (folder / "out").rglob("*.html")}

    once = ("in", "body.json", "-o", "out", "--report", "out/index.html", "--reports")
    assert batch(*once, "worst:1").returncode == 0
    assert len(pages()) == 2
    (report,) = pages() - {"index.html"}
    assert f'"{report}"' in (folder / "out/index.html").read_text()
    assert '"stage-0"' in (folder / "out/index.html").read_text()
    assert batch(*once, "all").returncode == 0
    assert pages() == {"index.html", *(f"index_reports/{place}.html" for place in ("a", "deep/b", "deep/er/c"))}
    shutil.rmtree(folder / "out")
    assert batch(*once, "all").returncode == 0
    assert len(pages()) == 4
    shutil.rmtree(folder / "out")
    assert batch(*once, "none").returncode == 0
    assert pages() == {"index.html"}
    assert "expected all, none or worst:N" in refused("batch", *once, "worst", status=2)


def test_only_reports_on_the_present_results_are_linked(folder):
    once = ("in/a.bvh", "body.json", "-o", "out", "--report", "out/index.html", "--reports")
    batch(*once, "all")
    report, index = folder / "out/index_reports/a.html", folder / "out/index.html"
    before = report.read_text()
    batch(*once, "none", "--root-scale", 3)
    assert report.read_text() == before
    assert "index_reports/a.html" not in index.read_text()
    batch(*once, "all", "--root-scale", 3)
    assert report.read_text() != before
    assert "index_reports/a.html" in index.read_text()


def test_a_report_that_cannot_be_written_does_not_stop_the_rest(folder):
    (folder / "out/index_reports").mkdir(parents=True)
    (folder / "out/index_reports/a.html").write_text("mine")
    done = batch("in", "body.json", "-o", "out", "--report", "out/index.html", "--reports", "all")
    assert done.returncode == 1
    assert "3 clips: 3 converted" in done.stdout
    assert done.stderr == "no report: out/index_reports/a.html: exists already; --overwrite replaces it\n"
    assert (folder / "out/index_reports/a.html").read_text() == "mine"
    assert (folder / "out/index.html").exists()


# ---- stops


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A folder with clips that take a moment, a target, and in `out` the results of an undisturbed run."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "in").mkdir()
    for seed, name in enumerate(("longer", *range(CLIPS))):
        frames = LONGER if name == "longer" else LONG
        write_bvh(folder / "in" / f"{name}.bvh", swaying(person(), frames=frames, seed=seed))
    (folder / "body.json").write_text(skeleton_to_json(other_lengths(person()), "body"))
    assert batch(folder / "in", folder / "body.json", "-o", folder / "out").returncode == 0
    return folder


def short(folder):
    """The results of all clips but the longest."""
    return {name: content for name, content in tree(folder).items() if name != "longer.bvh"}


def started(work, output, *options, finished=0):
    """A process that converts the clips of a folder, returned when it has finished this many."""
    process = start_process("batch", work / "in", work / "body.json", "-o", output, *options)
    wait_until(lambda: len([*output.glob("*.bvh")]) >= finished, process)
    return process


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs signals as Unix has them")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"])
def test_a_run_that_was_stopped_goes_on(work, tmp_path, tmp_path_factory, monkeypatch, name):
    if signal.getsignal(getattr(signal, name)) is signal.SIG_IGN:
        pytest.skip(f"{name} is ignored here, as under nohup, and the program lets it be")
    temporary = tmp_path_factory.mktemp("temporary")
    monkeypatch.setenv("TMPDIR", str(temporary))
    process = started(work, tmp_path, "--jobs", 2, finished=2)
    if name == "SIGINT":
        os.killpg(process.pid, signal.SIGINT)  # as a terminal sends it
    else:
        process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=HANGS)  # until its last worker has ended, too
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.bvh")}
    assert not list(temporary.iterdir())
    if name == "SIGKILL":
        assert err == ""
    else:
        assert process.returncode == 130
        assert " left" in out.splitlines()[0]
        assert err == "distretarget: interrupted; run this again to go on\n"
        assert not list(tmp_path.glob(".*"))
    assert batch(work / "in", work / "body.json", "-o", tmp_path).returncode == 0
    assert not list(tmp_path.glob(".*"))
    whole = [path for path, time_then in before.items() if path.stat().st_mtime_ns == time_then]
    assert len(whole) == len(before) >= 1
    assert tree(tmp_path) == tree(work / "out")


def test_no_link_leads_out_of_the_folder_of_results(folder):
    (folder / "out").mkdir()
    (folder / "out" / "a.bvh").symlink_to(folder / "elsewhere.bvh")
    (folder / "out" / "deep").symlink_to(folder)
    done = batch("in", "body.json", "-o", "out", "--overwrite")
    assert done.returncode == 1
    assert "3 clips: 0 converted, 0 done before, 3 failed" in done.stdout
    assert done.stdout.count("leads out of the folder 'out'; remove the link") == 3
    assert not (folder / "elsewhere.bvh").exists()
    assert not (folder / "b.bvh").exists()


def test_no_link_leads_out_of_the_folder_of_reports(folder):
    (folder / "elsewhere").mkdir()
    (folder / "out").mkdir()
    (folder / "out" / "index_reports").symlink_to(folder / "elsewhere")
    done = batch("in/a.bvh", "body.json", "-o", "out", "--report", "out/index.html", "--reports", "all")
    assert done.returncode == 1
    assert done.stderr.startswith("no report: out/index_reports/a.html: leads out of the folder 'out'")
    assert not list((folder / "elsewhere").iterdir())


def test_two_runs_may_write_into_one_folder(work, tmp_path):
    processes = [started(work, tmp_path, "--exclude", "longer.bvh") for _ in range(2)]
    assert [process.communicate(timeout=HANGS) and process.returncode for process in processes] == [0, 0]
    assert tree(tmp_path) == short(work / "out")
    rows = (work / "out/metrics.csv").read_text().splitlines()
    assert (tmp_path / "metrics.csv").read_text().splitlines() == [row for row in rows if "longer" not in row]
    assert {path.name for path in tmp_path.iterdir()} - tree(tmp_path).keys() == {"metrics.csv", "results.sqlite"}


# ---- workers


def test_a_long_clip_converted_in_pieces_is_the_same(folder):
    write_bvh(folder / "long.bvh", swaying(person(), frames=3000))
    assert (folder / "long.bvh").stat().st_size > 1 << 20  # so that it is cut
    one = batch("long.bvh", "body.json", "-o", "one", "--jobs", 1)
    two = batch("long.bvh", "body.json", "-o", "two", "--jobs", 2)
    assert (one.returncode, two.returncode) == (0, 0)
    assert tree(folder / "one") == tree(folder / "two")


def test_dask_gives_the_same_results_and_survives_a_dying_worker(work, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        options = ("--exclude", "longer.bvh", "--dask", cluster.scheduler_address)
        killed = started(work, tmp_path, *options, finished=1)
        os.kill(cluster.workers[0].process.process.pid, signal.SIGKILL)
        killed.communicate(timeout=HANGS)
        assert killed.returncode == 0
        assert tree(tmp_path) == short(work / "out")


@pytest.mark.usefixtures("folder")
def test_a_scheduler_that_does_not_answer_gives_one_line(monkeypatch):
    pytest.importorskip("distributed", reason="needs distributed")
    monkeypatch.setattr("distretarget.batch.workers.CONNECT_TIMEOUT", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as silent:  # accepts connections, and says nothing
        silent_address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        for address in ("tcp://127.0.0.1:9", silent_address, "", "nonsense", "foo://1:2", "tcp://127.0.0.1:port"):
            line = refused("batch", "in", "body.json", "-o", "out", "--dask", address)
            assert line.startswith(f"distretarget: no Dask scheduler answers at {address!r}")


def test_workers_run_the_same_program(folder):
    (folder / "distretarget" / "batch").mkdir(parents=True)
    for module in ("__init__.py", "batch/__init__.py", "batch/workers.py"):
        (folder / "distretarget" / module).write_text("open('imported', 'a').close()")
    program = shutil.which("distretarget", path=Path(sys.executable).parent)
    if not program:
        pytest.skip("needs the installed command")
    done = subprocess.run([program, "batch", "in", "body.json", "-o", "out"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert not (folder / "imported").exists()


# ---- real folders


@needs_corpus
def test_every_clip_of_the_corpus_is_converted_or_has_a_reason(tmp_path):
    done = batch(CORPUS, SAMPLES / "rigs" / "mixamo_t.json", "-o", tmp_path)
    assert done.returncode == 1
    total = sum(path.suffix.lower() == ".bvh" for path in CORPUS.rglob("*"))
    counts = statuses(tmp_path)
    assert len(counts) == total
    assert counts.count("done") == len(tree(tmp_path))
    assert all(each["error"] for each in last_records(tmp_path).values() if each["status"] == "failed")
