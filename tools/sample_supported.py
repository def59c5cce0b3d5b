"""The sample clips with known supports, each made by a function that returns clip and supports."""

from __future__ import annotations

from collections.abc import Callable

from sample_cartwheel import cartwheel
from sample_push_up import push_up
from sample_supports import Sample

SUPPORTED: dict[str, Callable[[], Sample]] = {clip.__name__: clip for clip in (cartwheel, push_up)}
