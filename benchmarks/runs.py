"""Work shared among several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TypeVar

from clips import PROCESSES

Made = TypeVar("Made")


def in_processes(function: Callable[..., Made], tasks: Iterable[tuple[object, ...]]) -> list[Made]:
    """What a function makes of the arguments of each task, by several processes."""
    with ProcessPoolExecutor(PROCESSES) as pool:
        return list(pool.map(function, *zip(*tasks, strict=True)))


def clip_name(clip: Path) -> str:
    """The name of a clip, with its folder."""
    return f"{clip.parent.name}/{clip.stem}"
