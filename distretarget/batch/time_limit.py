"""A limit of the time that a clip may take."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager

TIME_LIMITS = (0.001, 1e6)  # the shortest and the longest [s]


class OverTime(BaseException):
    """Raised wherever the work on a clip is when its time is over; no `except Exception` keeps it."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise `OverTime` in this thread if the block takes longer than this; None for no limit.

    A compiled function that runs then, or a wait for another process, ends first: they are short parts of a clip.
    """
    if seconds is None:
        yield
        return
    thread, lock, is_over = threading.get_ident(), threading.Lock(), False

    def stop() -> None:
        with lock:
            if not is_over:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(OverTime))

    timer = threading.Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            is_over = True
        timer.cancel()
        timer.join()
