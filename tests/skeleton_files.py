"""Documents of skeleton files, and what is asked of them."""

from pathlib import Path

import pytest
from input_files import file_of
from schemas import validator

from distretarget.io.reading import load_target

HEAD = {"format": "distretarget-skeleton", "version": 1}
HIPS = {"name": "Hips", "parent": None, "offset": [0, 96.4, 0]}
SPINE = {"name": "Spine", "parent": "Hips", "offset": [0, 24, 0]}
HEAD_END = {"name": "Spine_End", "parent": "Spine", "offset": [0, 18, 0], "end": True}
MANUAL = Path(__file__).parent.parent / "docs" / "formats.md"


def full(*joints, **others):
    return HEAD | {"joints": list(joints or (HIPS, SPINE))} | others


def short(**others):
    return HEAD | others


def load_json(text):
    """The skeleton in a text, without a file of its own for each of many."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("distretarget.io.reading.load_file", lambda path: file_of(text, path))
        return load_target("given.json").skeleton


def assert_same(one, other):
    """Identical to the bit, signs of zeros included."""
    assert (one.names, one.channels, one.units, one.up) == (other.names, other.channels, other.units, other.up)
    for name in ("parents", "offsets", "end_sites"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def valid(document):
    return validator("io/skeleton").is_valid(document)
