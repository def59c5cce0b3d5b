"""Text files: read with their faults named, written whole or not at all."""

from __future__ import annotations

import codecs
import contextlib
import errno
import hashlib
import os
import secrets
from collections.abc import Callable
from pathlib import Path

from distretarget.errors import FileError

CTRL_Z = "\x1a"

REASONS = {
    errno.ENOENT: "there is no such file",
    errno.EISDIR: "is a folder",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
}


def read_text(path: str | Path) -> str:
    """The text of a file, without byte order mark and final Ctrl-Z; line ends stay as they are.

    UTF-8, or UTF-16 where a mark says so; bytes that are neither become lone surrogates, which
    `write_whole` turns back into the same bytes.

    Raises:
        FileError: the file is missing, a folder, not readable, empty or binary.
    """
    return text_of(read_bytes(path), path)


def is_folder(path: str | Path) -> bool:
    """Whether a folder can be seen there; False, too, where nobody may look."""
    return os.path.isdir(path)  # noqa: PTH112 - the method raises instead


def read_bytes(path: str | Path) -> bytes:
    """The content of a file.

    Raises:
        FileError: the file is missing, a folder or not readable.
    """
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError) as error:
        raise FileError(path, reason_of(error)) from error


def text_of(content: bytes, path: str | Path) -> str:
    """The text in the content of a file, whose path is for errors; as `read_text`."""
    text = _decoded(path, content)
    if "\0" in text:
        raise FileError(path, f"is no text: it has a NUL as character {text.index(chr(0)) + 1}")
    text = text.removesuffix(CTRL_Z)
    if not text.strip():
        raise FileError(path, "is empty")
    return text


def _decoded(path: str | Path, content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return content.decode("utf-16")
        except UnicodeDecodeError as error:
            raise FileError(path, f"is marked as UTF-16, but is not: {error.reason}") from error
    return content.removeprefix(codecs.BOM_UTF8).decode("utf-8", "surrogateescape")


def hash_of(content: bytes) -> str:
    """The SHA-256 of a content, after the name of the method."""
    return f"sha256:{hashlib.sha256(content).hexdigest()}"


def hash_of_file(path: Path) -> str | None:
    """The hash of what is in a file; None where there is none that can be read."""
    try:
        return hash_of(path.read_bytes())
    except OSError:
        return None


def text_hash(text: str) -> str:
    """The hash of the file that `write_whole` makes of a text."""
    return hash_of(encoded(text))


def encoded(text: str) -> bytes:
    """The content of the file that `write_whole` makes of a text."""
    return text.encode("utf-8", "surrogateescape")


def check_writable(path: str | Path, overwrite: bool = False) -> None:
    """Find out, without writing, whether `write_whole` could write this file.

    Raises:
        FileError: the file exists and may not be replaced, or its folder is missing or not writable.
    """
    try:
        place = Path(path).resolve()
        if place.is_dir():
            raise FileError(path, "is a folder, expected the name of a file")
        if place.exists():
            _check_replaceable(path, place, overwrite)
        if not place.parent.is_dir():
            raise FileError(path, f"there is no folder {str(place.parent)!r}")
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(path, reason_of(error)) from error
    if not os.access(place.parent, os.W_OK | os.X_OK):
        raise FileError(path, f"permission denied to write into the folder {str(place.parent)!r}")


def _check_replaceable(path: str | Path, place: Path, overwrite: bool) -> None:
    if not place.is_file():
        raise FileError(path, "is no regular file")
    if not overwrite:
        raise FileError(path, "exists already; --overwrite replaces it")
    if not os.access(place, os.W_OK):
        raise FileError(path, "permission denied: the file is write-protected")


def write_whole(
    path: str | Path, content: str | bytes, overwrite: bool = False, complete: Callable[[], None] = lambda: None
) -> None:
    """Write a file beside its place and move it there when it is complete; a text as UTF-8, line ends as given.

    `complete` is called when it is complete and on the disk, before it is moved; if it raises, nothing is moved.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written; then nothing changed.
    """
    check_writable(path, overwrite)
    place = Path(path).resolve()
    beside = place.with_name(f".distretarget-{secrets.token_hex(8)}.tmp")
    try:
        _write_to_disk(beside, encoded(content) if isinstance(content, str) else content)
        complete()
        if overwrite:
            beside.replace(place)
        else:
            _move_to_new(beside, place)
    except FileExistsError as error:
        raise FileError(path, "exists already; --overwrite replaces it") from error
    except (OSError, UnicodeEncodeError) as error:
        raise FileError(path, reason_of(error)) from error
    finally:
        with contextlib.suppress(OSError):
            beside.unlink()


def _write_to_disk(path: Path, content: bytes) -> None:
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _move_to_new(beside: Path, place: Path) -> None:
    """Move a file to a place where nothing is, even if another process tries the same.

    Raises: FileExistsError: something came to be there.
    """
    try:
        place.hardlink_to(beside)
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        beside.replace(place)


def reason_of(error: Exception) -> str:
    """Why the operating system or the encoding refused, as a clause."""
    if isinstance(error, UnicodeEncodeError):
        return f"the text has a character that no file can hold: {error.object[error.start]!r}"
    if isinstance(error, OSError):
        return REASONS.get(error.errno or 0, error.strerror or str(error))
    return f"is no file name: {error}"
