"""`-`, bytes and file objects in place of files, names of outputs, --quiet, and source and target that are swapped."""

import errno
import io
import json
import os
import re
import subprocess
import sys

import numpy as np
import pybvh
import pytest
from bodies import SAMPLES, other_lengths, person, swaying
from bvh_texts import format_bvh
from characters import character, chunks, packed
from program import command, last_records, refused, run, succeeded
from test_characters import BONES, WALK

from distretarget import DistretargetError, SettingsError, load_target, read_motion, retarget, write_motion
from distretarget.io.json_node import Node
from distretarget.io.skeleton_json import skeleton_to_json

pytestmark = pytest.mark.usefixtures("folder")

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


def test_errors_in_standard_input_say_so():
    cut = refused("-", "body.json", "-o", "out.bvh", given="HIERARCHY\nROOT")
    assert cut.startswith("distretarget: standard input:2: the file ends")
    strange = '{"format": "distretarget-skeleton", "version": 1, "lengths": {"Tail": 2}}'
    error = refused("in.bvh", "-", "-o", "out.bvh", given=strange)
    assert error.startswith('distretarget: standard input: lengths["Tail"]: no such joint')


def test_closed_standard_input_is_an_error(monkeypatch):
    monkeypatch.setattr("distretarget.cli.outputs.sys", type("Closed", (), {"stdin": None}))
    assert run("-", "body.json", "-o", "out.bvh").stderr == "distretarget: standard input: is closed\n"


@pytest.mark.skipif(os.name != "posix", reason="closes streams as POSIX shells do")
@pytest.mark.parametrize("closed", ["1", "12"])
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


def test_joints_that_only_their_namespaces_tell_apart_keep_them(tmp_path):
    (tmp_path / "twins.bvh").write_text(CLIP.replace("LeftHip\n", "a:Hip\n").replace("RightHip\n", "b:Hip\n"))
    assert "joints that cannot be told apart" in refused("skeleton", "export", "twins.bvh", "--strip-namespace")


CLAP = SAMPLES / "clap.bvh"


@pytest.fixture
def hero():
    made = character(BONES)
    made.animate("walk", WALK)
    return made.glb()


@pytest.mark.parametrize("given", [lambda content: content, io.BytesIO])
def test_what_is_read_from_bytes_is_what_the_file_has(tmp_path, hero, given):
    (tmp_path / "hero.glb").write_bytes(hero)
    (tmp_path / "body.json").write_text(skeleton_to_json(person(), "body"))
    np.savez(tmp_path / "clip.npz", positions=swaying(person()).positions, fps=30)
    for path in (CLAP, tmp_path / "hero.glb"):
        same = read_motion(given(path.read_bytes()))
        assert same.positions.tobytes() == read_motion(path).positions.tobytes()
    for path in (CLAP, tmp_path / "hero.glb", tmp_path / "body.json"):
        assert load_target(given(path.read_bytes())).skeleton.keys == load_target(path).skeleton.keys
    arrays = [(tmp_path / name).read_bytes() for name in ("clip.npz", "body.json")]
    assert len(read_motion(given(arrays[0]), skeleton=given(arrays[1]))) == 20


def test_the_name_of_a_file_object_stands_for_it(tmp_path):
    (tmp_path / "bad.bvh").write_text("HIERARCHY\n")
    with (tmp_path / "bad.bvh").open("rb") as file, pytest.raises(DistretargetError, match=r"bad\.bvh:1: "):
        read_motion(file)
    with pytest.raises(DistretargetError, match=r"^bytes:1: the file ends"):
        read_motion(b"HIERARCHY\n")


def test_what_is_written_to_a_file_object_is_what_a_file_gets(tmp_path, hero):
    result = retarget(read_motion(CLAP), load_target(hero))
    (tmp_path / "hero.glb").write_bytes(hero)
    for kind in ("bvh", "npz", "glb", "vrma"):
        written = io.BytesIO()
        write_motion(written, result, hero, kind=kind, name="clap")
        write_motion(tmp_path / f"clap.{kind}", result, tmp_path / "hero.glb")
        assert written.getvalue() == (tmp_path / f"clap.{kind}").read_bytes()


def test_bytes_have_no_files_beside_them(tmp_path, monkeypatch, hero):
    """Whoever sends a file to a service reads no file of the service by it."""
    monkeypatch.chdir(tmp_path)
    document, buffer = chunks(hero)
    document["buffers"][0]["uri"] = "secret.bin"
    (tmp_path / "secret.bin").write_bytes(buffer)
    with pytest.raises(DistretargetError, match=r"there is no file 'secret\.bin' beside it"):
        read_motion(json.dumps(document).encode())
    document["buffers"][0].pop("uri")
    document["images"] = [{"uri": "secret.png"}]
    (tmp_path / "secret.png").write_bytes(b"the secret")
    target = load_target(packed(document, buffer))
    assert target.mesh.file.gltf.image(Node("", "", 0.0)) == b""
    written = io.BytesIO()
    write_motion(written, read_motion(packed(document, buffer)), packed(document, buffer), kind="glb")
    assert b"the secret" not in written.getvalue()


@pytest.mark.parametrize("wrong", [3, None, io.StringIO("HIERARCHY"), ["a.bvh"]])
def test_what_is_no_file_is_refused(wrong):
    for read in (read_motion, load_target):
        with pytest.raises(SettingsError, match="expected a path, bytes, or a file opened as binary"):
            read(wrong)
    with pytest.raises(SettingsError, match="expected a path, or a file opened as binary"):
        write_motion(wrong, swaying(person()), kind="bvh")


def test_a_file_object_needs_a_kind():
    with pytest.raises(SettingsError, match="kind is None; expected one of 'bvh', 'glb'"):
        write_motion(io.BytesIO(), swaying(person()))
