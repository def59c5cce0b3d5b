"""Read files with errors that name the cause; write files completely or not at all."""

from __future__ import annotations

import codecs
import contextlib
import errno
import hashlib
import os
import re
import secrets
import stat
from collections.abc import Iterable
from pathlib import Path

from distretarget.checks import check_path
from distretarget.errors import FileError

# Motion formats that other programs convert to BVH, by suffix.
OTHER_FORMATS = {".c3d": "C3D", ".dae": "Collada", ".blend": "Blender"}
Content = str | bytes | Iterable[str] | Iterable[bytes | memoryview]  # of a file to write; may be in parts

UNSAFE = frozenset('/\\:*?"<>|')  # characters that some system does not allow in file names
DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])( *\..*)?", re.IGNORECASE)  # on Windows
CTRL_Z = "\x1a"
NONBLOCKING = getattr(os, "O_NONBLOCK", 0)  # opening a pipe must not wait for its writer
STANDARD_INPUT = Path("standard input")  # its name in errors

REASONS = {
    errno.ENOENT: "there is no such file",
    errno.EISDIR: "is a folder",
    errno.ENXIO: "is not a regular file",  # a socket
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EMFILE: "too many files are open; allow more, for example with ulimit -n 256",
    errno.ENFILE: "too many files are open on this machine; close other programs",
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "is larger than files may be here; raise the limit, for example with ulimit -f unlimited",
}


def read_text(path: str | Path) -> str:
    """Return the text of a file, UTF-8, or UTF-16 with a byte order mark, without the mark and a final Ctrl-Z. Invalid
    bytes become lone surrogates, which `write_whole` turns back. A FileError if the file is empty or binary.
    """
    return text_of(read_bytes(path), path)


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file; a FileError if it cannot be read or is not regular: a pipe may never end."""
    check_path("path", path)
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | NONBLOCKING)) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise FileError(path, "is not a regular file")
            return file.read()
    except (OSError, ValueError) as error:
        raise FileError(path, reason_of(error)) from error


def check_known(path: str | Path) -> None:
    """Raise a FileError if the name has the suffix of a format that other programs have to convert first."""
    if other := OTHER_FORMATS.get(Path(path).suffix.lower()):
        advice = "convert it first, for example with Blender: File > Import, then File > Export > glTF (.glb)"
        raise FileError(path, f"is {other}, expected BVH, glTF, VRM or FBX; {advice}")


def text_of(content: bytes, path: str | Path) -> str:
    """Return the text in the content of a file as `read_text` does; `path` is for errors."""
    check_known(path)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            text = content.decode("utf-16")
        except UnicodeDecodeError as error:
            raise FileError(path, f"begins with a UTF-16 mark, but is not valid UTF-16: {error.reason}") from error
    else:
        text = content.removeprefix(codecs.BOM_UTF8).decode("utf-8", "surrogateescape")
    if "\0" in text:
        raise FileError(path, f"is not a text file: character {text.index(chr(0)) + 1} is NUL")
    text = text.removesuffix(CTRL_Z)
    if not text or text.isspace():
        raise FileError(path, "is empty")
    return text


def hash_of(*content: bytes | memoryview) -> str:
    """Return the SHA-256 of content, which may be in parts, as "sha256:" and hexadecimal digits."""
    digest = hashlib.sha256()
    for part in content:
        digest.update(part)
    return f"sha256:{digest.hexdigest()}"


def hash_of_file(path: Path) -> str | None:
    """Return the hash of a file's content; None if the file does not exist or cannot be read."""
    with contextlib.suppress(FileError):
        return hash_of(read_bytes(path))
    return None


def safe_file_name(name: str) -> str:
    """Return a name, without suffix, changed so that every system allows it for a file; may be empty."""
    plain = "".join("_" if each in UNSAFE or not each.isprintable() else each for each in name).strip(". ")
    return f"_{plain}" if DEVICES.fullmatch(plain) else plain


def is_folder(path: str | Path) -> bool:
    """Return whether a path leads to a folder; False also where permissions hide it."""
    return os.path.isdir(path)  # noqa: PTH112 - the method raises instead


def is_inside(path: Path, folder: Path) -> bool:
    """Return whether a path is inside a folder once links and `..` are resolved; False if links form a loop."""
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):
        return False


def check_inside(path: Path, folder: Path) -> None:
    """Raise a FileError if a path in a folder leads out of the folder, by links or `..`."""
    if not is_inside(path, folder):
        raise FileError(path, f"leads out of the folder {str(folder)!r}; remove the link")


def make_folder(folder: Path) -> None:
    """Make a folder and its parents unless they exist; raise a FileError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise FileError(folder, "is a file or inside one, expected a folder") from error
    except (OSError, ValueError) as error:
        raise FileError(folder, f"the folder cannot be made: {reason_of(error)}") from error


def check_writable(path: str | Path, overwrite: bool = False) -> None:
    """Raise a FileError if `write_whole` could not write this file; nothing is written."""
    check_path("path", path)
    try:
        place = Path(path).resolve()
        if place.is_dir():
            raise FileError(path, "is a folder, expected the name of a file")
        if place.exists() and not place.is_file():
            raise FileError(path, "is not a regular file")
        if place.exists() and not overwrite:
            raise FileError(path, "exists already; --overwrite replaces it")
        if place.exists() and not os.access(place, os.W_OK):
            raise FileError(path, "permission denied: the file is write-protected")
        if not place.exists() and Path(path).is_symlink():
            raise FileError(path, f"is a link to {str(place)!r}, which does not exist; remove the link")
        if not place.parent.is_dir():
            raise FileError(path, f"there is no folder {str(place.parent)!r}")
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(path, reason_of(error)) from error
    if not os.access(place.parent, os.W_OK | os.X_OK):
        raise FileError(path, f"permission denied to write into the folder {str(place.parent)!r}")


def write_whole(path: str | Path, content: Content, overwrite: bool = False) -> None:
    """Write a file under a temporary name in its folder and rename it when it is complete. `content` may be in parts;
    text is written as UTF-8. A replaced file's permissions stay and, where the system allows it, its owner. A FileError
    if the file exists and `overwrite` is false, or cannot be written; then nothing has changed.
    """
    check_writable(path, overwrite)
    place = Path(path).resolve()
    temporary = place.with_name(f".distretarget-{secrets.token_hex(8)}.tmp")
    try:
        with temporary.open("xb") as file:
            if overwrite and place.exists():
                status = place.stat()
                if hasattr(os, "chown"):
                    with contextlib.suppress(PermissionError):
                        os.chown(temporary, status.st_uid, status.st_gid)
                temporary.chmod(stat.S_IMODE(status.st_mode))
            file.writelines(encoded_parts(content))
            file.flush()
            os.fsync(file.fileno())
        if not overwrite:
            try:  # fails if another process has just made the file
                place.hardlink_to(temporary)
                return
            except FileExistsError:
                raise
            except OSError:  # a file system without hard links
                pass
        temporary.replace(place)
    except FileExistsError as error:
        raise FileError(path, "exists already; --overwrite replaces it") from error
    except (OSError, UnicodeEncodeError) as error:
        raise FileError(path, reason_of(error)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def encoded_parts(content: Content) -> Iterable[bytes | memoryview]:
    """Return the bytes that `write_whole` writes for a content, in parts."""
    parts = [content] if isinstance(content, str | bytes) else content
    return (part.encode("utf-8", "surrogateescape") if isinstance(part, str) else part for part in parts)


def reason_of(error: Exception) -> str:
    """Return the cause of an error of the operating system or the encoding, as a clause for a message."""
    if isinstance(error, UnicodeEncodeError):
        return f"the text has a character that UTF-8 cannot encode: {error.object[error.start]!r}"
    if isinstance(error, OSError):
        return REASONS.get(error.errno or 0, error.strerror or str(error))
    return f"is not a valid file name: {error}"
