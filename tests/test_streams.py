"""`-` for standard input and output, names of outputs, --quiet, and source and target that are swapped."""

import errno
import os
import re
import subprocess
import sys

import pybvh
import pytest
from bodies import other_lengths, person, swaying
from bvh_texts import format_bvh
from program import command, last_records, refused, run, succeeded

from distretarget.io.skeleton_json import skeleton_to_json

CLIP = format_bvh(swaying(person()))
BODY = skeleton_to_json(other_lengths(person()), "body")


@pytest.fixture
def converted(folder):
    """The text of the clip on the target."""
    run("in.bvh", "body.json", "-o", "out.bvh")
    return (folder / "out.bvh").read_text()


def test_source_and_target_are_read_from_standard_input(folder, converted):
    for source, target, given in (("-", "body.json", CLIP), ("in.bvh", "-", BODY)):
        succeeded(source, target, "-o", "again.bvh", "--overwrite", given=given)
        assert (folder / "again.bvh").read_text() == converted


def test_with_standard_output_as_output_the_summary_goes_to_standard_error(converted):
    done = run("in.bvh", "body.json", "-o", "-")
    assert done.stdout == converted
    assert done.stderr.startswith("20 frames in ")


def test_diff_reads_standard_input_and_writes_standard_output(converted):
    read = succeeded("diff", "in.bvh", "-", given=converted)
    assert "B: standard input, 22 joints" in read.stdout
    written = run("diff", "in.bvh", "out.bvh", "--csv", "-")
    assert written.stdout.startswith("frame,")
    assert "worst frames by" in written.stderr


@pytest.mark.usefixtures("folder")
def test_skeletons_are_read_from_standard_input_and_written_to_standard_output():
    assert run("skeleton", "show", "-", given=CLIP).stdout == run("skeleton", "show", "in.bvh").stdout
    exported = run("skeleton", "export", "-", given=CLIP).stdout
    assert exported == run("skeleton", "export", "in.bvh", "-o", "-").stdout.replace('"in"', '"standard input"')
    edited = run("skeleton", "edit", "-", "--scale", "1", "-o", "-", given=exported)
    assert edited.stdout == exported
    assert edited.stderr.startswith("0 bones changed")
    matched = run("skeleton", "match", "in.bvh", "-", "-o", "-", given=exported)
    assert matched.stdout.startswith('{\n  "Hips": "Hips"')
    assert "matched: " in matched.stderr


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-", "-", "-o", "out.bvh"), "standard input, which can be one file only"),
        (("in.bvh", "body.json", "-o", "-", "--json", "-"), "standard output, which can be one file only"),
        (("batch", "-", "body.json", "-o", "out"), "standard input has no name"),
    ],
)
def test_a_stream_stands_for_one_file(arguments, words):
    assert words in refused(*arguments, status=2)


@pytest.mark.usefixtures("folder")
def test_errors_in_standard_input_say_so():
    cut = refused("-", "body.json", "-o", "out.bvh", given="HIERARCHY\nROOT")
    assert cut.startswith("distretarget: standard input:2: the file ends")
    strange = '{"format": "distretarget-skeleton", "version": 1, "lengths": {"Tail": 2}}'
    error = refused("in.bvh", "-", "-o", "out.bvh", given=strange)
    assert error.startswith('distretarget: standard input: lengths["Tail"]: no such joint')


@pytest.mark.usefixtures("folder")
def test_closed_standard_input_is_an_error(monkeypatch):
    monkeypatch.setattr("distretarget.cli.outputs.sys", type("Closed", (), {"stdin": None}))
    assert run("-", "body.json", "-o", "out.bvh").stderr == "distretarget: standard input: is closed\n"


@pytest.mark.skipif(os.name != "posix", reason="closes streams as POSIX shells do")
@pytest.mark.parametrize("closed", ["1", "2", "12"])
def test_closed_output_streams_are_as_if_led_to_nowhere(folder, closed):
    streams = " ".join(f"{number}>&-" for number in closed)
    for arguments in (("in.bvh", "body.json", "-o", "out.bvh"), ("--help",)):
        done = subprocess.run(["sh", "-c", f'exec "$@" {streams}', "sh", *command(*arguments)], capture_output=True)
        assert (done.returncode, done.stderr) == (0, b"")
        assert bool(done.stdout) == ("1" not in closed)
    assert (folder / "out.bvh").read_text().startswith("HIERARCHY\n")


@pytest.mark.skipif(os.name != "posix", reason="names that other systems refuse")
def test_names_reach_the_terminal_escaped_and_shortened(folder):
    """Escape codes could rewrite what a terminal shows, and marks of direction could hide an ending."""
    strange = "\x1b[2J\u202e\n\x9b腰　b"
    names = CLIP.replace("Head", f"{strange[:6]}{'x' * 200_000}").replace("LeftHip", strange[:6])
    (folder / f"{strange}.bvh").write_text(names)
    runs = [
        (f"{strange}.bvh", "none.json", "-o", "o.bvh"),
        (f"{strange}none.bvh", "body.json", "-o", "o.bvh"),
        (f"{strange}.bvh", "body.json", "-o", "o.bvh"),
        ("batch", f"{strange}.bvh", "body.json", "-o", "o", "--dry-run"),
        ("skeleton", "show", f"{strange}.bvh"),
        ("skeleton", "match", f"{strange}.bvh", "body.json"),
        ("--fps", strange, "in.bvh", "body.json", "-o", "o.bvh"),
    ]
    for arguments in runs:
        done = run(*arguments)
        lines = (done.stdout + done.stderr).splitlines()
        assert lines
        assert not set("\x1b\u202e\x9b").intersection(done.stdout + done.stderr)
        assert max(map(len, lines)) < 3000
    assert run(*runs[1]).stderr == ("distretarget: \\x1b[2J\\u202e \\x9b腰　bnone.bvh: there is no such file\n")


@pytest.mark.parametrize(
    ("number", "line"),
    [
        (errno.EMFILE, "too many files are open; allow more, for example with ulimit -n 256"),
        (errno.ENOSPC, "standard output: the disk is full"),
    ],
)
def test_an_error_of_the_system_names_standard_output_only_where_it_is_to_blame(monkeypatch, number, line):
    def fail(**_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("distretarget.cli.cli.main", fail)
    monkeypatch.setattr("distretarget.cli.sys.stdout", sys.stdout)
    assert run().stderr == f"distretarget: {line}\n"


def test_a_file_may_be_called_minus(folder, converted):
    (folder / "-").write_text(CLIP)
    run("./-", "body.json", "-o", "again.bvh")
    assert (folder / "again.bvh").read_text() == converted


@pytest.mark.parametrize(
    ("arguments", "better"),
    [
        (("in.bvh", "body.json", "-o", "y.txt"), "'y.bvh'"),
        (("in.bvh", "body.json", "-o", "y"), "'y.bvh'"),
        (("skeleton", "export", "in.bvh", "-o", "y.bvh"), "'y.json'"),
        (("skeleton", "edit", "in.bvh", "--scale", "2", "-o", "y.bvh"), "'y.json'"),
        (("skeleton", "match", "in.bvh", "body.json", "-o", "y.txt"), "'y.json'"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_an_output_with_the_name_of_another_format_is_refused(arguments, better):
    assert better in refused(*arguments)


def test_quiet_prints_nothing_but_errors(folder):
    tail = BODY.replace("\n  ]", ',\n    {"name": "Tail", "parent": "Hips", "offset": [0, 0, -1]}\n  ]')
    (folder / "tail.json").write_text(tail)
    for arguments in (
        ("in.bvh", "tail.json", "-o", "out.bvh"),
        ("diff", "in.bvh", "out.bvh"),
        ("skeleton", "match", "in.bvh", "body.json", "-o", "map.json"),
        ("batch", "in.bvh", "tail.json", "-o", "folder", "--jobs", "1"),
    ):
        done = run(*arguments, "-q")
        assert (done.returncode, done.stdout, done.stderr) == (0, "", ""), arguments
    assert run("none.bvh", "body.json", "-o", "o.bvh", "-q").stderr == "distretarget: none.bvh: there is no such file\n"
    (folder / "broken.bvh").write_text("HIERARCHY")
    failed = run("batch", "broken.bvh", "body.json", "-o", "folder", "--jobs", "1", "-q")
    assert (failed.returncode, failed.stdout) == (1, "")
    assert failed.stderr == "failed:\n  broken.bvh:1: the file ends, expected ROOT\n"


@pytest.mark.usefixtures("folder")
def test_a_source_without_frames_and_a_target_with_frames_are_swapped(tmp_path):
    hierarchy = CLIP[: CLIP.index("MOTION")]
    (tmp_path / "body.bvh").write_text(hierarchy)
    done = run("body.bvh", "in.bvh", "-o", "out.bvh")
    assert done.stderr.endswith("if it is the target, it comes last: distretarget in.bvh body.bvh -o OUT.bvh\n")
    (tmp_path / "cut.bvh").write_text(CLIP[: len(CLIP) // 2])
    assert "comes last" not in run("cut.bvh", "in.bvh", "-o", "out.bvh").stderr


def test_namespaces_are_left_out_where_that_is_asked_for(folder):
    names = BODY.replace('"name": "', '"name": "mixamorig:').replace('"parent": "', '"parent": "mixamorig:')
    (folder / "rig.json").write_text(names.replace("mixamorig:body", "body"))
    told = run("in.bvh", "rig.json", "-o", "named.bvh")
    assert (
        "three.js cannot play joints with names like 'mixamorig:Hips'; --strip-namespace writes 'Hips'" in told.stderr
    )
    plain = run("in.bvh", "rig.json", "-o", "plain.bvh", "--strip-namespace")
    assert "three.js" not in plain.stderr
    named = (folder / "named.bvh").read_text()
    assert "ROOT mixamorig:Hips\n" in named
    assert (folder / "plain.bvh").read_text() == named.replace("mixamorig:", "")
    assert run("skeleton", "export", "rig.json", "--strip-namespace").stdout == BODY


def test_readers_that_cannot_read_a_result_are_named(folder):
    """The target's file has the joints so, and its results keep them."""
    odd = CLIP.replace("JOINT LeftHip\n", "JOINT H\udcfcfte\n").split("MOTION")[0]
    odd = re.sub(r"(JOINT Head\s*{\s*OFFSET.*\s*)CHANNELS.*", r"\1CHANNELS 0", odd)
    (folder / "odd.bvh").write_bytes(odd.encode("utf-8", "surrogateescape"))
    assert "pybvh" not in run("in.bvh", "odd.bvh", "-o", "quiet.bvh").stderr
    told = run("in.bvh", "odd.bvh", "-o", "out.bvh", "-v")
    assert "bvhio and pybvh cannot read names that are not UTF-8, as 'H\\udcfcfte'; rename" in told.stderr
    assert "positions of the root alone, and 'Head' has 0 channels" in told.stderr
    assert "pybvh" not in run("scene", "in.bvh", "-t", "odd.bvh", "-o", "out").stderr
    run("batch", "in.bvh", "odd.bvh", "-o", "many", "--jobs", "1")
    notes = last_records(folder / "many")["in.bvh"]["notes"]
    assert [note.partition(" ")[0] for note in notes[-2:]] == ["bvhio", "pybvh"]
    with pytest.raises(UnicodeDecodeError):
        pybvh.read_bvh_file(folder / "out.bvh")


@pytest.mark.usefixtures("folder")
def test_joints_that_only_their_namespaces_tell_apart_keep_them(tmp_path):
    (tmp_path / "twins.bvh").write_text(CLIP.replace("LeftHip\n", "a:Hip\n").replace("RightHip\n", "b:Hip\n"))
    assert "joints that cannot be told apart" in refused("skeleton", "export", "twins.bvh", "--strip-namespace")
