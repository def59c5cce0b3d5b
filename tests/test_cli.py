"""The command line as a user meets it: start and end, exit status, one line per error, nothing lost."""

import json
import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from bodies import other_lengths, person, swaying
from program import refused, run, run_process, succeeded

from distretarget import read_bvh, write_bvh
from distretarget.batch.workers import interrupts_held
from distretarget.cli import COMMANDS, cli


def lengths_of(skeleton):
    return dict(zip(skeleton.keys, skeleton.lengths, strict=True))


def between_hips(motion):
    """(frames, 3), the middle of the hip joints, whose path the root scale multiplies."""
    joints = [motion.skeleton.index(f"{side}Hip") for side in ("Left", "Right")]
    return motion.positions[:, joints].mean(axis=1)


def test_a_clip_is_retargeted_and_its_metrics_are_written(folder):
    done = run_process("in.bvh", "body.json", "-o", "out.bvh", "--json", "out.json")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("20 frames in ")
    assert done.stdout.count("\n") == 1
    motion = read_bvh(folder / "out.bvh")
    assert len(motion) == 20
    assert lengths_of(motion.skeleton) == pytest.approx(lengths_of(other_lengths(person())), rel=1e-9)
    metrics = json.loads((folder / "out.json").read_text())
    assert {len(values) for values in metrics["frames"].values()} == {20}
    worst = np.argmax(metrics["frames"]["stress"])
    told = run("in.bvh", "body.json", "-o", "again.bvh", "-v")
    assert f"most stress in frame {worst} " in told.stdout + told.stderr


def test_the_command_may_be_named_options_may_come_first_and_overwrite_replaces_an_output(folder):
    runs = [
        run(*named, "in.bvh", "body.json", "-o", f"{number}.bvh") for number, named in enumerate([(), ("retarget",)])
    ]
    assert [done.returncode for done in runs] == [0, 0]
    assert (folder / "0.bvh").read_bytes() == (folder / "1.bvh").read_bytes()
    succeeded("-o", "out.bvh", "in.bvh", "body.json")
    (folder / "out.bvh").write_text("old")
    succeeded("in.bvh", "body.json", "-o", "out.bvh", "--overwrite")
    assert len(read_bvh(folder / "out.bvh")) == 20


BLOCKS = """{"format": "distretarget-skeleton", "version": 1, "joints": [
  {"name": "Block", "parent": null, "offset": [0, 0, 0]}, {"name": "Lid", "parent": "Block", "offset": [0, 1, 0]}]}"""

BAD = {
    "missing source": (["none.bvh", "body.json", "-o", "out.bvh"], 1, "none.bvh"),
    "missing target": (["in.bvh", "none.json", "-o", "out.bvh"], 1, "none.json"),
    "folder as source": (["sub", "body.json", "-o", "out.bvh"], 2, "sub is a folder; 'distretarget batch'"),
    "empty file": (["empty.bvh", "body.json", "-o", "out.bvh"], 1, "empty.bvh"),
    "binary file": (["binary.bvh", "body.json", "-o", "out.bvh"], 1, "binary.bvh"),
    "typo in a key": (["in.bvh", "typo.json", "-o", "out.bvh"], 1, "ofset"),
    "output in no folder": (["in.bvh", "body.json", "-o", "no/out.bvh"], 1, "no"),
    "output equal to input": (["in.bvh", "body.json", "-o", "in.bvh", "--overwrite"], 1, "in.bvh"),
    "output equal to target": (["in.bvh", "body.json", "-o", "./body.json", "--overwrite"], 1, "body.json"),
    "metrics over the output": (["in.bvh", "body.json", "-o", "o.bvh", "--json", "o.bvh"], 1, "another output"),
    "existing output": (["in.bvh", "body.json", "-o", "there.bvh"], 1, "--overwrite"),
    "existing metrics": (["in.bvh", "body.json", "-o", "out.bvh", "--json", "there.bvh"], 1, "--overwrite"),
    "truncated source": (["short.bvh", "body.json", "-o", "out.bvh"], 1, "short.bvh:"),
    "no output": (["in.bvh", "body.json"], 2, "--output"),
    "unknown option": (["in.bvh", "body.json", "-o", "out.bvh", "--fast"], 2, "--fast"),
    "zero root scale": (["in.bvh", "body.json", "-o", "out.bvh", "--root-scale", "0"], 2, "--root-scale"),
    "root scale no number": (["in.bvh", "body.json", "-o", "out.bvh", "--root-scale", "nan"], 2, "--root-scale"),
    "frame rate too high": (["in.bvh", "body.json", "-o", "o.bvh", "--fps", "100001"], 2, "from 0.001 to 100000"),
    "unknown axis": (["in.bvh", "body.json", "-o", "out.bvh", "--source-up", "W"], 2, "--source-up"),
    "missing map": (["in.bvh", "body.json", "-o", "out.bvh", "--map", "none.json"], 1, "none.json"),
    "output equal to the map": (["in.bvh", "body.json", "-o", "o", "--map", "o"], 1, "o: is an input"),
    "nothing in common": (
        ["in.bvh", "blocks.json", "-o", "o.bvh"],
        1,
        "`distretarget skeleton match in.bvh blocks.json -o",
    ),
    "supports for the paper": (
        ["in.bvh", "body.json", "-o", "o", "--supports", "hold", "--objective", "paper"],
        2,
        "--supports hold",
    ),
    "a misspelt command": (["bacth", "in.bvh", "body.json", "-o", "out"], 2, "did you mean 'batch'?"),
    "another misspelt command": (["skelton", "show", "in.bvh"], 2, "did you mean 'skeleton'?"),
    "source and target swapped": (
        ["body.json", "in.bvh", "-o", "out.bvh"],
        1,
        "if it is the target, it comes last: distretarget in.bvh body.json -o OUT.bvh",
    ),
    "another format as source": (["walk.fbx", "body.json", "-o", "out.bvh"], 1, "walk.fbx: is not a valid FBX file"),
    "another format as target": (["in.bvh", "body.glb", "-o", "out.bvh"], 1, "body.glb: is no glTF"),
    "no frames": (["still.bvh", "body.json", "-o", "out.bvh"], 1, "still.bvh"),
    "one argument": (["in.bvh", "-o", "out.bvh"], 2, "TARGET"),
    "show a missing file": (["skeleton", "show", "none.bvh"], 1, "none.bvh"),
    "export over the input": (["skeleton", "export", "in.bvh", "-o", "in.bvh", "--overwrite"], 1, "in.bvh"),
    "a file for a batch": (
        ["batch", "in.bvh", "body.json", "-o", "all.glb"],
        2,
        "results go into a folder; with --merge",
    ),
    "unknown subcommand": (["skeleton", "shew", "in.bvh"], 2, "shew"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gives_one_line(folder, case):
    (folder / "sub").mkdir()
    (folder / "empty.bvh").touch()
    (folder / "binary.bvh").write_bytes(bytes(range(256)))
    (folder / "there.bvh").write_text("precious")
    for name in ("walk.fbx", "body.glb"):
        (folder / name).write_bytes(b"\0")
    text = (folder / "in.bvh").read_text()
    (folder / "short.bvh").write_text(text[: len(text) // 2])
    motion = swaying(person(), frames=1)
    write_bvh(folder / "still.bvh", motion[:0])
    body = (folder / "body.json").read_text()
    (folder / "typo.json").write_text(body.replace("offset", "ofset", 1))
    (folder / "blocks.json").write_text(BLOCKS)
    arguments, status, words = BAD[case]
    assert words in refused(*arguments, status=status)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("case", ["no output"])
def test_a_process_ends_with_the_same_status_and_line(case):
    arguments, *_ = BAD[case]
    alone, here = run_process(*arguments), run(*arguments)
    assert (alone.returncode, alone.stdout, alone.stderr) == (here.returncode, here.stdout, here.stderr)


@pytest.mark.skipif(not hasattr(os, "link"), reason="no hard links here")
def test_an_input_under_another_name_is_not_overwritten(folder):
    os.link(folder / "in.bvh", folder / "alias.bvh")
    assert "is an input as well" in refused("in.bvh", "body.json", "-o", "alias.bvh", "--overwrite")


def test_joints_that_follow_their_parents_are_reported(folder):
    body = json.loads((folder / "body.json").read_text())
    tail = [{"name": f"Tail{n}", "parent": "Hips", "offset": [0, 0, -n]} for n in range(1, 15)]
    warnings = {
        0: "",
        1: "1 other joint of the target follows its parent: 'Tail1'; see -v\n",
        14: "14 other joints of the target follow their parents: 'Tail1', 'Tail2', 'Tail3' and 11 more; see -v\n",
    }
    for count, warning in warnings.items():
        (folder / "tail.json").write_text(json.dumps(body | {"joints": body["joints"] + tail[:count]}))
        done = run("in.bvh", "tail.json", "-o", "out.bvh", "--overwrite")
        assert (done.returncode, done.stderr) == (0, warning)
    told = run("in.bvh", "tail.json", "-o", "out.bvh", "--overwrite", "-v")
    assert "joints of the target that follow their parents: 'Tail1', " in told.stderr
    assert "'Tail12' and 2 more\n" in told.stderr
    assert "warning" not in told.stderr


@pytest.mark.usefixtures("folder")
def test_verbose_says_what_was_matched_with_what():
    done = run("in.bvh", "body.json", "-o", "out.bvh", "--root-scale", "1.5", "-v")
    *lines, metrics = done.stderr.splitlines()
    assert metrics.startswith("rotation copy / result: contact error ")
    assert lines == [
        "source: joints named as in Xsens MVN",
        "target: joints named as in Xsens MVN",
        "matched: 22 of the target's 22 joints (22 by equal name)",
        "joints of the target that follow their parents: none",
        "joints of the source not used: none",
        "up: Y in the source, the same in the target",
        "the source's root has OFFSET 0, so replacing it and adding to it are the same",
        "root scale: 1.5 target units per source unit",
    ]
    assert done.stdout.startswith("20 frames in ")


def test_the_axes_are_passed_on(folder):
    axes = ["--source-up", "Y", "--target-up", "-Z"]
    done = run("in.bvh", "body.json", "-o", "out.bvh", "--root-scale", "1", *axes, "-v")
    assert "up: Y in the source, -Z in the target: the world is turned\n" in done.stderr
    source, result = (read_bvh(folder / name) for name in ("in.bvh", "out.bvh"))
    x, y, z = between_hips(source).T
    np.testing.assert_allclose(between_hips(result), np.stack([x, z, -y], axis=1), atol=1e-5)


def test_the_root_offset_is_passed_on(folder):
    text = (folder / "in.bvh").read_text()
    (folder / "raised.bvh").write_text(text.replace("OFFSET 0.000000 0.000000 0.000000", "OFFSET 1 2 3", 1))
    paths = {}
    for meaning, says in (
        ("replaced", "replaces it; --root-offset added"),
        ("added", "is added to it; --root-offset rep"),
    ):
        options = ["-v", "--root-scale", "1", "--root-offset", meaning]
        done = run("raised.bvh", "body.json", "-o", f"{meaning}.bvh", *options)
        assert f"the source's root has OFFSET 1 2 3: its position {says}" in done.stderr
        paths[meaning] = read_bvh(folder / f"{meaning}.bvh").root_positions
    np.testing.assert_allclose(paths["added"] - paths["replaced"], [[1, 2, 3]] * 20, atol=1e-5)


@pytest.mark.usefixtures("folder")
def test_show_prints_the_tree():
    shown = run("skeleton", "show", "in.bvh").stdout.splitlines()
    assert shown[0].startswith("22 joints, 5 End Sites; height ")
    assert shown[0].endswith("; joints named as in Xsens MVN")
    assert [line.startswith("thickness") for line in shown].index(True) == 1 + 27
    assert any(line.split()[-2:] == ["LeftElbow", "0.2730"] for line in shown)


def test_an_exported_skeleton_is_the_same_target(folder):
    succeeded("skeleton", "export", "in.bvh", "-o", "own.json")
    assert run("skeleton", "export", "in.bvh").stdout == (folder / "own.json").read_text()
    for target in ("in.bvh", "own.json"):
        run("in.bvh", target, "-o", f"to_{target}.bvh")
    assert (folder / "to_in.bvh.bvh").read_bytes() == (folder / "to_own.json.bvh").read_bytes()


def test_help_and_version():
    assert "walk.bvh hero.glb -o hero_walk.glb" in run("--help").stdout
    assert run("--version").stdout.startswith("distretarget, version ")
    assert run().returncode == 2


SLOW = {"numpy", "scipy", "tqdm", "bvhio", "jsonschema", "distributed"}

MODULES_AFTER = """
import sys
from distretarget.__main__ import main
sys.argv[1:] = {arguments!r}
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""

INTERRUPTED_AT = """
import sys
class Interruption:
    def find_spec(name, path, target=None):
        if name == {module!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interruption)
from distretarget.__main__ import main
sys.argv[1:] = ["skeleton", "show", "none.bvh"]
main()
"""


def run_python(text):
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version_import_nothing_slow(option):
    done = run_python(MODULES_AFTER.format(arguments=[option]))
    assert done.returncode == 0
    assert "distretarget" in done.stdout
    imported = set(done.stderr.split())
    assert "click" in imported
    assert not imported & SLOW


@pytest.mark.parametrize("module", ["click", "distretarget.cli.skeleton", "numpy", "scipy.spatial"])
def test_ctrl_c_while_a_module_is_imported_ends_in_one_line(module):
    done = run_python(INTERRUPTED_AT.format(module=module))
    assert (done.returncode, done.stdout, done.stderr.strip()) == (130, "", "distretarget: interrupted")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_the_group_says_of_a_command_what_the_command_says(name):
    command = cli.commands[name]
    assert command.command.name == name
    assert command.short_help == command.command.get_short_help_str(limit=100)


ON_UNIX = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs signals as Unix has them")


@pytest.fixture
def _heard():
    """Interrupts are heard, also where they are ignored, as in processes that shells start in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@ON_UNIX
@pytest.mark.usefixtures("_heard")
def test_an_interrupt_waits_and_is_not_lost():
    done = []

    def interrupted():
        with interrupts_held():
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()
            subprocess.run([sys.executable, "-c", ""], check=True)
            done.append("started")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["started"]


@ON_UNIX
def test_processes_started_meanwhile_do_not_see_it():
    with interrupts_held():
        held = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"]
        assert subprocess.run(held, capture_output=True, text=True).stdout == "alive\n"
