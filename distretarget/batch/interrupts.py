"""Ctrl-C and requests to end, where they must wait, and where they would get lost."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """Let Ctrl-C and requests to end wait, in this process and in those that it starts meanwhile."""
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
    """Raise an interruption that gets lost in the block at its end.

    While code is compiled or loaded, LLVM calls Python back. From there no exception comes through: Python prints it as
    ignored, and goes on, or fails because what the call was for is not done.
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
