"""Ctrl-C and requests to end, where they must wait or would be lost."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C and requests to end, in this process and in those that it starts in the block."""
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: signal.signal(number, lambda caught, _frame: received.append(caught)) for number in numbers}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)  # for started processes; other threads are not masked
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if received:
            signal.raise_signal(received[0])


@contextlib.contextmanager
def interrupts_kept() -> Iterator[None]:
    """Raise an interruption that is lost in the block when the block ends.

    LLVM calls Python back while it compiles or loads code. An exception cannot leave such a call: Python prints that it
    is ignored and goes on, or fails because the work of the call is not done.
    """
    lost: list[Any] = []
    hook = sys.unraisablehook

    def keep(ignored: sys.UnraisableHookArgs) -> None:
        if issubclass(ignored.exc_type, KeyboardInterrupt):
            lost.append(ignored.exc_type)
        else:
            hook(ignored)

    sys.unraisablehook = keep
    try:
        yield
    except Exception:
        if not lost:
            raise
    finally:
        sys.unraisablehook = hook
    if lost:
        raise KeyboardInterrupt
