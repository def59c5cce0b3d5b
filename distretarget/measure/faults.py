"""The kinds of faults of a clip, and what is found of them.

Each is one number with a limit; lengths are in leg lengths of the body, so that units do not matter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of fault.

    Attributes:
        meaning: what its number says.
        unit: of the number.
        limit: a clip has the fault if the number is above this.
        plain: whether the number is only 1 if the clip has the fault, and 0 if not.
    """

    meaning: str
    unit: str = ""
    limit: float = 0.0
    plain: bool = False


KINDS: Mapping[str, Kind] = {
    "unreadable": Kind(meaning="the file cannot be read, or has no motion", plain=True),
    "first_pose": Kind(meaning="frames of another pose, such as a T-pose, before the motion begins", unit="frames"),
    "cuts": Kind(meaning="cuts, at which all joints jump"),
    "jumps": Kind(meaning="frames to which a joint jumps, or in which it leaps out and back", unit="frames"),
    "flips": Kind(meaning="frames to which a joint turns by more than 90 degrees at once", unit="frames"),
    "frozen": Kind(meaning="the longest time for which a moving body stops dead", unit="s", limit=0.1),
    "repeated": Kind(meaning="frames that repeat the one before in the middle of a movement", unit="%", limit=1.0),
    "skating": Kind(meaning="the time for which a standing foot moves along the floor", unit="s", limit=0.3),
    "below_floor": Kind(meaning="how deep joints go below the floor on which feet rest", unit="% of leg", limit=8.0),
    "off_floor": Kind(meaning="how far the lowest joint is from height 0", unit="legs", limit=3.0),
    "stretching": Kind(meaning="how much the length of a bone changes", unit="% of leg", limit=2.0),
    "up_axis": Kind(
        meaning="the axis up is another than that of the skeleton, or of most clips of its rig", plain=True
    ),
    "sides": Kind(meaning="joints named left are on the right", plain=True),
    "unit": Kind(
        meaning="how many times larger or smaller the body is than in most clips of its rig", unit="times", limit=1.5
    ),
    "frame_time": Kind(
        meaning="how much the frame time differs from that of most clips of its rig", unit="%", limit=1.0
    ),
    "duplicate": Kind(meaning="another clip has the same motion", plain=True),
}


@dataclass(frozen=True)
class Finding:
    """The number of a kind of fault in a clip, and where it is worst."""

    value: float
    frame: int | None = None
    where: str = ""  # the joint, or the other clip


Findings = dict[str, Finding]
