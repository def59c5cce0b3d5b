"""The sample clips with known supports, each made by a function that returns clip and supports."""

from __future__ import annotations

from collections.abc import Callable

from sample_cartwheel import cartwheel
from sample_crawl import crawl
from sample_kneel import kneel
from sample_ladder import climb_ladder
from sample_push_up import push_up
from sample_sit import sit
from sample_supports import Sample
from sample_wall import hand_on_wall

SUPPORTED: dict[str, Callable[[], Sample]] = {
    clip.__name__: clip for clip in (cartwheel, climb_ladder, crawl, hand_on_wall, kneel, push_up, sit)
}
