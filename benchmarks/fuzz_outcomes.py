"""How a generated input of the program ends, and how much memory it takes."""

from __future__ import annotations

from pathlib import Path

RIGHT, REFUSED, TRACEBACK = "written right", "refused in one line", "traceback"
HANG, UNREADABLE = "no end within 10 s", "not finite or not read back"
LIMIT = 10  # time after which an input counts as one that hangs [s]
LONGEST_LINE = 1000  # characters of an error, without the file's name


class NotReadBackError(Exception):
    """What was written is not finite, or differs when it is read back."""


class TooLongError(Exception):
    """No end within the limit."""


class Memory:
    """The most memory that this process holds since the beginning [bytes]; Linux only."""

    def __init__(self) -> None:
        Path("/proc/self/clear_refs").write_text("5")
        self._before = self._status("VmRSS")

    @staticmethod
    def _status(key: str) -> int:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key))

    def peak(self) -> int:
        return self._status("VmHWM") - self._before


def late(_number: int, _frame: object) -> None:
    """Handle an alarm."""
    raise TooLongError
