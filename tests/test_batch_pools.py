"""Workers start undisturbed: a request to end the program waits until they have."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from distretarget.batch.pools import _interrupts_held

pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs signals as Unix has them")


@pytest.fixture
def _heard():
    """Interrupts are heard, also where they are ignored, as in processes that shells start in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_heard")
def test_an_interrupt_waits_and_is_not_lost():
    done = []

    def interrupted():
        with _interrupts_held():
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()
            subprocess.run([sys.executable, "-c", ""], check=True)
            done.append("started")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["started"]


def test_processes_started_meanwhile_do_not_see_it():
    with _interrupts_held():
        held = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"]
        assert subprocess.run(held, capture_output=True, text=True).stdout == "alive\n"
