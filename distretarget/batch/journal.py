"""A file of lines to which several runs may add at the same time; each line is there whole, or is not used."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from distretarget.errors import FileError
from distretarget.io.files import reason_of


class Journal:
    """The lines of a file, of which only the places are kept in memory: there may be a million.

    Attributes:
        path: of the file, which may be missing.
        broken: the numbers of the lines, from 1, that say nothing and are not used.
    """

    def __init__(self, path: Path, lock: AbstractContextManager[object], note: Callable[[bytes, int], bool]) -> None:
        """`lock` is held while lines are read or added, and may be held already. `note` is called with each line and
        its beginning [bytes]; it returns whether the line says anything.
        """
        self.path, self.broken = path, list[int]()
        self._lock, self._note = lock, note
        self._size = self._lines = 0  # how much of the file has been read [bytes], [lines]
        self._ends_whole = True

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs from adding lines; raise a FileError if that fails."""
        with self.named_errors(), self._lock:
            yield

    @contextmanager
    def named_errors(self) -> Iterator[None]:
        """Raise an error of the operating system as one of the file."""
        try:
            yield
        except OSError as error:
            raise FileError(self.path, reason_of(error)) from error

    def catch_up(self) -> None:
        """Note the lines that this run and others have added since the last call."""
        with self.named_errors():
            if not self.path.exists() or self.path.stat().st_size == self._size:
                return
            with self._lock, self.path.open("rb") as file:
                file.seek(self._size)
                for line in file:
                    self._lines += 1
                    if not self._note(line, self._size) and line.strip():
                        self.broken.append(self._lines)
                    self._size += len(line)
                    self._ends_whole = line.endswith(b"\n")

    def add(self, *lines: bytes, flush: bool = True) -> None:
        """Add lines, while the file is locked, and flush them to the disk; if that fails, raise a FileError and leave
        the file as it was.
        """
        self.catch_up()
        text = b"".join([b"" if self._ends_whole else b"\n", *(line + b"\n" for line in lines)])
        with self.named_errors(), self.path.open("ab", buffering=0) as file:
            try:
                while text:
                    text = text[file.write(text) :]
                if flush:
                    os.fsync(file.fileno())
            except OSError:
                file.truncate(self._size)
                raise
        self.catch_up()

    def lines_at(self, starts: Iterable[int]) -> Iterator[bytes]:
        """Yield the lines that begin at these places [bytes]."""
        with self.named_errors(), self.path.open("rb") as file:
            for start in starts:
                file.seek(start)
                yield file.readline()
