"""How the program starts, with nothing slow imported, and how it ends when it is interrupted."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from distretarget.batch.workers import interrupts_held
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
