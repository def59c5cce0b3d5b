"""The contacts that are found in a clip, as entries of a contact file that a user can edit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from types import NoneType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import RootScale, find_root_scale
from distretarget.body.build import capsules_by_build
from distretarget.checks import check_kind
from distretarget.contact_entries import Contact, ContactList, Entry, Plant
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.time_series import spans_of
from distretarget.objectives.activation import DEFAULT_SETTINGS, ContactSettings
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.clip import Clip
from distretarget.objectives.constraints import centimetres, frames_of
from distretarget.objectives.contact_pairs import ContactSearch
from distretarget.objectives.supports import RESTS, Supports
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.performer import Performer, Transfer, match_performer
from distretarget.pipeline.result import Baseline, Match, RetargetResult
from distretarget.skeleton import JointMap, Skeleton
from distretarget.skin.balls import segment_gaps
from distretarget.target import AnyTarget, SkeletonEdit, Target

LISTED = 0.5  # a contact whose activation never reaches this is not listed
TOUCHING = 1.0  # skins with a smaller gap touch [cm]
FAR_APART = 0.3  # larger gaps are not measured [body units]
SHORTEST = 0.1  # shorter spans are not listed [s]


def find_contacts(
    motion: Motion,
    target: AnyTarget | None = None,
    *,
    joint_map: JointMap | None = None,
    settings: ContactSettings = DEFAULT_SETTINGS,
) -> ContactList:
    """Return the contacts that `retarget` finds in a motion: parts of the body that touch, and parts that rest.

    An unedited entry keeps the contact as it is found, and changes nothing.

    Args:
        motion: the source.
        target: the body to retarget to; entries name its parts. By default the source's own body.
        joint_map: as in `retarget`.
        settings: as in `retarget`.

    Raises:
        DistretargetError: the motion cannot be retargeted to the target.
    """
    check_kind("motion", motion, Motion)
    check_kind("target", target, Motion, Skeleton, Target, SkeletonEdit, NoneType)
    check_kind("settings", settings, ContactSettings)
    goal = motion if target is None else target
    return _found(match_performer(Transfer(motion, goal, Options(skin="none"), joint_map)), settings)


def _found(match: Match, settings: ContactSettings = DEFAULT_SETTINGS) -> ContactList:
    performer = Performer.of(match, RootScale.even(find_root_scale(match.matching)))
    performer = performer.with_supports(DEFAULT_OPTIONS, settings)
    touching = _touching(match.matching, performer.clip, performer.supports, settings)
    entries, supports, clip = [*touching], performer.supports, performer.clip
    rests: NDArray[np.bool_] = np.asarray(supports.weights >= RESTS)
    for region in np.unique(supports.regions).tolist():
        for first, end in spans_of(np.asarray(rests[:, supports.regions == region].any(axis=1))).tolist():
            if (end - first) * clip.frame_time >= SHORTEST:
                entries.append(Plant(plant=clip.regions.names[region], frames=(first, end - 1), found="planted"))
    return ContactList(tuple(sorted(entries, key=lambda entry: entry.frames or (0, 0))))


@dataclass(frozen=True)
class MarkedContact:
    """A contact of a clip, as an entry with frames: found, or dropped or added by the user."""

    entry: Entry
    mark: Literal["found", "dropped", "added"]


def contacts_of(baseline: Baseline) -> ContactList:
    """Return the contacts that are found in the source of a baseline."""
    return _found(Match(baseline.match.world, baseline.match.matching))


def marked_contacts(result: RetargetResult, found: ContactList | None = None) -> tuple[MarkedContact, ...]:
    """Return contacts `found` in the source of a result (`contacts_of`), and those that the user dropped and added."""
    clip = Clip.of(result.matching, RootScale.even(result.root_scale))
    entries = [(each, frames_of(result.contact_list, clip, each)) for each in result.contact_list if each.has_effect]
    marked = []
    for entry, on in entries:
        if getattr(entry, "keep", True):
            marked += [MarkedContact(each, "added") for each in _spans(entry, on)]
    for entry in contacts_of(result.baseline) if found is None else found:
        on = np.zeros(len(clip), bool)
        on[slice(int(entry.frames[0]), int(entry.frames[1]) + 1) if entry.frames else slice(None)] = True
        drops = (
            at
            for each, at in entries
            if type(each) is type(entry) and each.parts == entry.parts and not getattr(each, "keep", True)
        )
        dropped = on & np.any([~on & on, *drops], axis=0)
        marked += [MarkedContact(each, "dropped") for each in _spans(entry, dropped)]
        marked += [MarkedContact(each, "found") for each in _spans(entry, on & ~dropped)]
    return tuple(sorted(marked, key=lambda each: each.entry.frames or (0, 0)))


def _spans(entry: Entry, on: NDArray[np.bool_]) -> Iterator[Entry]:
    """Copies of an entry, one for each span of the frames `on`."""
    for first, end in spans_of(on).tolist():
        yield replace(entry, frames=(first, end - 1), seconds=None)


def _touching(matching: Matching, clip: Clip, supports: Supports, settings: ContactSettings) -> Iterator[Entry]:
    """Entries for the spans in which two regions touch."""
    names, of_joint = clip.regions.names, clip.regions.of_joint
    contacts = ContactSearch.of(clip, replace(settings, blend=0.0))
    f = {pair: np.zeros(len(clip)) for pair in combinations(range(len(names)), 2)}
    for block in blocks_of(len(clip)):
        near = contacts.near(block, supports[block])
        ends = np.sort(np.stack([of_joint[near.a], of_joint[near.b]], axis=1), axis=1)
        for column, (a, b) in enumerate(ends.tolist()):
            np.maximum(f[a, b][block], near.f[:, column], out=f[a, b][block])
    gap_of = _skin_gaps(matching, clip)
    for (a, b), each in f.items():
        for first, end in spans_of(np.asarray(each > 0.0)).tolist():
            if each[first:end].max() >= LISTED and (end - first) * clip.frame_time >= SHORTEST:
                on = first + np.flatnonzero(each[first:end] >= LISTED)
                found = gap_of(a, b, on)
                yield Contact(between=(names[a], names[b]), frames=(first, end - 1), found=found)


def _skin_gaps(matching: Matching, clip: Clip) -> Callable[[int, int, NDArray[np.intp]], str]:
    """A function for the median gap in words, or "", of two regions of an average body with the source's bones."""
    body = matching.source
    capsules, cm = capsules_by_build(body), centimetres(body.unit) * body.unit
    if not len(capsules):
        return lambda _a, _b, _frames: ""
    skin = BodySkin.of(body, capsules)
    driving = [(joint, driver) for joint, driver in enumerate(matching.drivers) if driver >= 0]
    regions = {int(skin.of_joint[driver]): int(clip.regions.of_joint[joint]) for joint, driver in driving}  # by segment

    def gap_of(a: int, b: int, frames: NDArray[np.intp]) -> str:
        pairs = skin.balls.pairs.tolist()
        on = [column for column, pair in enumerate(pairs) if {regions.get(one) for one in pair} == {a, b}]
        if not on:
            return ""
        posed = skin.posed(clip.source[frames[:: max(len(frames) // 30, 1)]])
        gap = float(np.median(segment_gaps(skin.balls, posed, FAR_APART)[:, on].min(axis=1)))
        return "" if gap >= FAR_APART else "touching" if gap * cm < TOUCHING else f"{gap * cm:.1f} cm apart"

    return gap_of
