"""Interruptions that must wait."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from distretarget.batch.workers import interrupts_held

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


STUCK = """
import threading
from multiprocessing.util import get_temp_dir
from distretarget import cli
get_temp_dir()
threading.Thread(target=threading.Event().wait).start()
cli.THREAD_TIMEOUT = 0.1
cli._leave(3)
"""


def test_a_program_with_a_thread_that_never_ends_leaves_with_its_status_and_no_temporary_files(tmp_path):
    places = {**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(tmp_path))}
    assert subprocess.run([sys.executable, "-c", STUCK], env=places, timeout=60).returncode == 3
    assert not list(tmp_path.iterdir())
