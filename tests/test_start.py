"""The start of the program: help and version wait for nothing slow, and Ctrl-C ends it from its first import."""

import subprocess
import sys

import pytest
from bodies import SAMPLES

from distretarget.cli import COMMANDS, cli

SLOW = {"numpy", "scipy", "numba", "tqdm", "bvhio", "jsonschema", "distributed"}

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


@pytest.mark.parametrize(
    "arguments",
    [
        ["skeleton", "show", SAMPLES / "walk.bvh"],
        ["skeleton", "show", SAMPLES.parent / "sample_characters" / "hero.glb"],
        ["skeleton", "match", SAMPLES / "walk.bvh", SAMPLES / "rigs" / "mixamo_t.json"],
        ["batch", SAMPLES, SAMPLES / "child.json", "-o", "none", "--dry-run"],
        ["skeleton", "edit", "--help"],
    ],
    ids=lambda words: " ".join(str(getattr(word, "name", word)) for word in words),
)
def test_what_needs_no_compiled_code_imports_no_numba(arguments):
    done = run_python(MODULES_AFTER.format(arguments=[*map(str, arguments)]))
    assert done.returncode == 0
    assert "numba" not in done.stderr.split()


def test_what_runs_as_python_says_the_same(tmp_path):
    numba = "import numba\n" + MODULES_AFTER
    words = ["skeleton", "match", str(SAMPLES / "walk.bvh"), str(SAMPLES / "rigs" / "mixamo_t.json"), "-o"]
    texts = []
    for program in (MODULES_AFTER, numba):
        path = tmp_path / f"{len(texts)}.json"
        done = run_python(program.format(arguments=[*words, str(path)]))
        texts.append((done.stdout.replace(str(path), ""), path.read_text()))
    assert texts[0] == texts[1]


@pytest.mark.parametrize("module", ["click", "distretarget.cli.skeleton", "numpy", "scipy.spatial"])
def test_ctrl_c_while_a_module_is_imported_ends_in_one_line(module):
    done = run_python(INTERRUPTED_AT.format(module=module))
    assert (done.returncode, done.stdout, done.stderr.strip()) == (130, "", "distretarget: interrupted")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_the_group_says_of_a_command_what_the_command_says(name):
    command = cli.commands[name]
    assert command.command.name == name
    assert command.short_help == command.command.get_short_help_str(limit=100)
