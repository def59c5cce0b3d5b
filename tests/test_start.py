"""The start of the program: help and version wait for nothing slow, and Ctrl-C ends it from its first import."""

import subprocess
import sys

import pytest

from distretarget.cli import COMMANDS, cli

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
