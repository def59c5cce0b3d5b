"""Target files: a skeleton file in JSON or a BVH file; the content decides which it is."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from distretarget.errors import BvhError, SkeletonFileError
from distretarget.io.bvh import parse_bvh, parse_bvh_skeleton
from distretarget.io.files import read_text
from distretarget.io.skeleton_json import parse_skeleton_json
from distretarget.target import SkeletonEdit, Target, with_bones

CACHED_TARGETS = 4  # parsed BVH targets that are kept for the next clip [files]


def load_target(path: str | Path) -> Target | SkeletonEdit:
    """Return the target in a skeleton file (full or short form) or a BVH file; the content decides which it is.

    `retarget` takes the result as it is; its method `for_source` gives the whole skeleton for a source.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: the file is JSON that breaks the format, or no bone of the body has a length.
        BvhError: the file is anything else than JSON or BVH.
    """
    return parse_target(read_text(path), path)


def parse_target(text: str, path: str | Path) -> Target | SkeletonEdit:
    """Return the target in the text of a file as `load_target` does; `path` is for errors."""
    return parse_skeleton_json(text, path) if is_json(text) else _bvh_target(text, path)


def load_full_target(path: str | Path) -> Target:
    """Return the target in a BVH file or a skeleton file of the full form; errors as in `load_target`.

    Raises:
        SkeletonFileError: also for the short form, which needs a source to be a skeleton.
    """
    return parse_full_target(read_text(path), path)


def parse_full_target(text: str, path: str | Path) -> Target:
    """Return the target in the text of a file as `load_full_target` does; `path` is for errors."""
    target = parse_target(text, path)
    if isinstance(target, SkeletonEdit):
        raise SkeletonFileError(path, "", 'has no "joints"; this short form needs a source to change')
    return target


def is_json(text: str) -> bool:
    """Return whether the text of a file is to be read as JSON; any other text is to be read as BVH."""
    return text.lstrip().startswith(("{", "["))


@lru_cache(maxsize=CACHED_TARGETS)
def _bvh_target(text: str, path: str | Path) -> Target:
    """The target in the text of a BVH file; its MOTION may be missing or invalid."""
    try:
        motion = parse_bvh(text, path)
    except BvhError:
        return Target(with_bones(parse_bvh_skeleton(text, path), path), {}, "")
    return Target(with_bones(motion.rigid_skeleton, path), {}, "", motion if len(motion) else None)
