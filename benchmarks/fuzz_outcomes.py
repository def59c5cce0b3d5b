"""The outcome of a generated input of the program, and its memory."""

from __future__ import annotations

import signal
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from distretarget import DistretargetError

RIGHT, REFUSED, TRACEBACK = "written right", "refused in one line", "traceback"
HANG, MEMORY, UNREADABLE = "no end within 10 s", "too much memory", "not finite or not read back"
OUTCOMES = (RIGHT, REFUSED, TRACEBACK, HANG, MEMORY, UNREADABLE)
LIMIT = 10  # time after which an input counts as one that hangs [s]
MOST_MEMORY = 2 * 2**30  # of an input [bytes]
LONGEST_LINE = 1000  # characters of an error


class NotReadBackError(Exception):
    """An output is not finite, or differs when it is read back."""


class TooLongError(Exception):
    """No end within the limit."""


class Memory:
    """The peak memory of this process since the start of the measurement; Linux only."""

    def __init__(self) -> None:
        Path("/proc/self/clear_refs").write_text("5")
        self._before = self._status("VmRSS")

    @staticmethod
    def _status(key: str) -> int:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key))

    def check(self, most: int) -> None:
        """Raise a MemoryError if the memory grew by more than this [bytes]."""
        if (used := self._status("VmHWM") - self._before) > most:
            raise MemoryError(f"{used / 2**20:.0f} MB")


def _late(_number: int, _frame: object) -> None:
    raise TooLongError


def outcome_of(action: Callable[[Any], str | None], case: Any) -> tuple[str, str]:
    """Return the outcome of an action on an input, and the details of a failure."""
    before = signal.signal(signal.SIGALRM, _late)
    signal.alarm(LIMIT)
    memory = Memory()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # a user would see it
            warnings.simplefilter("ignore", UserWarning)
            outcome = action(case) or RIGHT
        memory.check(MOST_MEMORY)
        return outcome, ""
    except DistretargetError as error:
        fault = no_line(str(error))
        return (TRACEBACK, fault) if fault else (REFUSED, "")
    except TooLongError as error:
        return HANG, "".join(traceback.format_exception(error)[-6:])
    except MemoryError as error:
        return MEMORY, str(error)
    except NotReadBackError as error:
        return UNREADABLE, str(error)
    except Exception as error:  # a user would see a traceback
        return TRACEBACK, "".join(traceback.format_exception(error)[-4:])
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def no_line(text: str) -> str:
    """Why a text is not a line that a user can read; empty if it is."""
    if text.isprintable() and len(text) <= LONGEST_LINE:
        return ""
    return f"no line for a user, {len(text)} characters: {text[:300]!r}"


def read_back(reading: Callable[[], Any]) -> Any:
    """Read an output of the program; turn its errors into a NotReadBackError."""
    try:
        return reading()
    except DistretargetError as error:
        raise NotReadBackError(str(error)) from error


def check_close(values: np.ndarray, others: np.ndarray, off: float, what: str) -> None:
    """Check that values and those read back are finite, and differ by at most `off`."""
    if values.shape != others.shape:
        raise NotReadBackError(f"{what}: {others.shape} of {values.shape}")
    if not (np.isfinite(values).all() and np.isfinite(others).all()):
        raise NotReadBackError(f"{what} are not finite")
    if (most := np.abs(values - others).max(initial=0.0)) > off:
        raise NotReadBackError(f"{what} are off by {most:g}")
