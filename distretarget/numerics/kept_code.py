"""What numba keeps of compiled functions in files, where these may be cut, damaged, or not writable."""

from __future__ import annotations

import pickle
import zlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba.core.caching import FunctionCache
from numba.core.serialize import dumps


class KeptCode(FunctionCache):
    """The code of a function in files: made again if damaged, done without if not writable, as on a full disk."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file._dump = _sealed  # type: ignore[method-assign]

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for arguments of these types; None if it is not kept, or damaged."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # damaged bytes may raise anything
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for arguments of these types, if possible."""
        with suppress(Exception):  # a damaged index that cannot be replaced may raise anything, too
            super().save_overload(sig, data)


def _sealed(kept: Any) -> bytes:
    return bytes(dumps(_Sealed(dumps(kept))))


class _Sealed:
    """A pickle that is opened together with the one it is in, and only if it is whole."""

    def __init__(self, content: bytes) -> None:
        self.content = content

    def __reduce__(self) -> tuple[Callable[[bytes, int], Any], tuple[bytes, int]]:
        return _opened, (self.content, zlib.crc32(self.content))


def _opened(content: bytes, checksum: int) -> Any:
    if zlib.crc32(content) != checksum:
        raise pickle.UnpicklingError
    return pickle.loads(content)
