"""What the studio works on: the files that were dropped, and how a clip is to be on a character."""

from __future__ import annotations

import io
import json
import threading
import uuid
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from pathlib import PurePath

from distretarget.body.body import Body
from distretarget.contact_entries import ContactList
from distretarget.errors import DistretargetError, FileError, SettingsError
from distretarget.io.contacts_file import contacts_to_json, entry_to_json
from distretarget.io.files import encoded_parts
from distretarget.io.formats import FBX, OUTPUT_FORMATS, OUTPUTS
from distretarget.io.input_file import InputFile
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import content_of, output_kind, suffix_of
from distretarget.io.target_file import CharacterTarget, TargetFile, animations_in
from distretarget.measure.verdict import Remark
from distretarget.motion import Motion
from distretarget.pipeline.conversion import Conversion, Converted, Recipe
from distretarget.pipeline.found_contacts import MarkedContact, contacts_of, marked_contacts
from distretarget.report.clip_page import Meshes, meshes_of, run_axes, run_motions, run_page, run_timeline
from distretarget.report.diff_document import About
from distretarget.skeleton import Skeleton
from distretarget.studio.order import Names, Order, project_to_json

MOST = 2_000_000_000  # of all files that were dropped [bytes]
KEPT = 2  # so many results are kept, so that undo shows the one before at once


class OvertakenError(Exception):
    """A later order took the place of this one."""


@dataclass(frozen=True, eq=False)
class Done:
    """An order that was carried out."""

    order: Order
    conversion: Conversion  # that orders with other contacts begin with
    found: ContactList  # in the clip
    meshes: Meshes  # that clip and character are shown in
    converted: Converted
    format: str

    @property
    def source(self) -> InputFile:
        """The clip."""
        return self.conversion.source

    @property
    def target(self) -> TargetFile:
        """The character."""
        return self.conversion.target

    @property
    def report(self) -> str:
        """The HTML of its report."""
        about = About(a=str(self.source.path), b=str(self.target.path))
        return run_page(self.converted.result, about, self.target.target, self.source)

    @cached_property
    def contacts(self) -> tuple[MarkedContact, ...]:
        """The contacts of the clip: found, dropped and added."""
        return marked_contacts(self.converted.result, self.found)

    @cached_property
    def motions(self) -> dict[str, object]:
        """What the player shows of it in motion."""
        return run_motions(self.converted.result, self.meshes)

    @cached_property
    def as_data(self) -> dict[str, object]:
        """What else the page shows of it."""
        result = self.converted.result
        regions = result.matching.target.regions.names
        return {
            "timeline": run_timeline(result, self.contacts),
            "verdict": [_remark(each, result.matching.target) for each in result.remarks],
            "warnings": [_remark(each, result.matching.target) for each in result.warnings],
            "frames": len(result.motion),
            "seconds": (len(result.motion) - 1) * result.motion.frame_time,
            "contacts": [
                {"mark": each.mark, "entry": json.loads(entry_to_json(each.entry)), "parts": list(each.entry.parts)}
                for each in self.contacts
            ],
            "parts": sorted(regions),
            "pairs": [
                [result.motion.skeleton.keys[joint], result.source.skeleton.keys[driver] if driver >= 0 else None]
                for joint, driver in enumerate(result.drivers.tolist())
                if not result.motion.skeleton.end_sites[joint]
            ],
            "drivers": _turning(result.source.skeleton),
            "anchors": _turning(result.motion.skeleton),
            "axes": run_axes(result),
            "frame_time": result.motion.frame_time,
            "formats": formats_of(self.target),
            "format": self.format,
            "command": self.names.command(self.order),
            "merges": OUTPUTS[f".{self.format}"] == "character",
        }

    @property
    def names(self) -> Names:
        """What its files are called."""
        return Names(str(self.source.path), str(self._character.path), self.format, self.order.animation or "")

    @property
    def _character(self) -> InputFile:
        assert self.target.file
        return self.target.file

    def file(self, kind: str, called: Names | None = None) -> tuple[str, bytes]:
        """Return the name and the content of a file to take away: the motion in its format, the "contacts", the "map",
        the "project" or the "report"; by other names if they are given.
        """
        names = called or self.names
        match kind:
            case "contacts":
                return names.of_kind("contacts.json"), contacts_to_json(self.order.contacts).encode()
            case "map":
                return names.of_kind("map.json"), self.order.map_json.encode()
            case "project":
                hashes = (self.source.hash, self._character.hash)
                return names.of_kind("project.json"), project_to_json(self.order, names, hashes).encode()
            case "report":
                return f"{PurePath(names.result).stem}.html", self.report.encode()
        if kind != self.format:
            raise SettingsError(f"kind is {kind!r:.40}; expected {self.format}, the format of the order")
        return names.result, self.motion(names.result)

    def motion(self, name: str, before: bytes | None = None) -> bytes:
        """Return the content of a file of this name with the motion; added to what was made `before`."""
        onto = None if before is None else InputFile(before, name, has_folder=False)
        content = content_of(name, self.converted.clip, self.target, self.order.recipe.writing, onto)
        return b"".join(encoded_parts(content))

    def made_from(self, names: Names) -> dict[str, bytes]:
        """Return the files that its command needs, and its project, by their names."""
        kinds = ["project", *["contacts"] * bool(self.order.contacts.entries), *["map"] * self.order.has_map]
        inputs = {names.clip: self.source.content, names.character: self._character.content}
        return inputs | dict(self.file(kind, names) for kind in kinds)


def _remark(remark: Remark, body: Body) -> dict[str, object]:
    """A remark, its frame, and the keys of the joints where its parts are on a body."""
    joints = [joint for part in remark.parts if (joint := body.joint_of(part)) is not None]
    return {"text": remark, "frame": remark.frame, "joints": [body.skeleton.keys[joint] for joint in joints]}


def _turning(skeleton: Skeleton) -> list[str]:
    """The key of each joint; of an end, that of the joint which turns it."""
    ends = zip(skeleton.parents.tolist(), skeleton.end_sites, strict=True)
    return [skeleton.keys[max(parent, 0) if end else joint] for joint, (parent, end) in enumerate(ends)]


def _numbered(name: str) -> Iterator[str]:
    """The name of a file, and then others with a number."""
    path = PurePath(name)
    return (str(path.with_stem(f"{path.stem}{number or ''}")) for number in count())


def formats_of(target: TargetFile) -> list[str]:
    """Return the endings of the files that a result on a target can be written as, the usual one first."""
    own, body = target.file is not None and target.file.format is FBX, target.target
    has_mesh = own and isinstance(body, CharacterTarget) and body.mesh() is not None
    usual = "glb" if own else suffix_of(target).removeprefix(".")
    can = []
    for kind in dict.fromkeys((usual, *OUTPUT_FORMATS[1:])):
        with suppress(DistretargetError):
            if output_kind(f"out.{kind}", target.file) != "character" or not own or has_mesh:
                can.append(kind)
    return can


class Bench:
    """The files that were dropped, in memory, and the orders that were carried out last."""

    def __init__(self) -> None:
        self.dropped: list[dict[str, object]] = []  # what each file is, in their order
        self._known: dict[tuple[str, str], dict[str, object]] = {}  # the same, by their first names and hashes
        self._files: dict[str, InputFile] = {}
        self._targets: dict[str, TargetFile] = {}
        self._motions: OrderedDict[str, tuple[Motion, tuple[str, ...]]] = OrderedDict()
        self._done: OrderedDict[str, Done] = OrderedDict()
        self._turns: dict[str, object] = {}  # the last order of each tab
        self._lock = threading.Lock()
        self._solving = threading.Lock()  # one order is carried out at a time

    def add(self, name: str, content: bytes) -> dict[str, object]:
        """Take a file, and return its number and what it is; a DistretargetError where it is nothing to use. The same
        file again is the one that is there; another file with the name of one gets a number in its own.
        """
        plain = PurePath(name.replace("\\", "/").replace("\0", "")).name
        file = InputFile(content, plain if plain.strip(".") else "file", has_folder=False)
        called = str(file.path), file.hash
        if called in self._known:
            return self._known[called]
        held = sum(len(each.content) for each in self._files.values())
        if held + len(content) > MOST:
            raise FileError(file.path, f"does not fit: the files on the page may have {MOST:,} bytes; start it anew")
        number = uuid.uuid4().hex
        names = animations_in(file)
        about: dict[str, object] = {"id": number, "name": str(file.path), "hash": file.hash, "animations": list(names)}
        faults = []
        try:
            target = TargetFile.of(file)
            self._targets[number] = target
            about["character"] = True
        except DistretargetError as error:
            faults.append(error)
        try:
            if len(names) > 1:
                about["clip"] = True
            else:
                motion, lost = parse_motion(file, None, None)
                about |= {"clip": len(motion) > 0, "frames": len(motion), "notes": list(lost)}
                about["seconds"] = max(len(motion) - 1, 0) * motion.frame_time
        except DistretargetError as error:
            faults.append(error)
        if len(faults) == 2:
            raise faults[0]
        taken = {str(known["name"]).casefold() for known in self.dropped}
        free = next(each for each in _numbered(str(file.path)) if each.casefold() not in taken)
        if free != str(file.path):
            self._known[called] = self.add(free, content)
            return self._known[called]
        self._files[number] = file
        self._known[called] = about
        self.dropped.append(about)
        return about

    def carry_out(self, order: Order, tab: str = "") -> Done:
        """Retarget as an order says, unless that was done; an `OvertakenError` if a later order of the same tab of the
        browser comes in between, or the end.
        """
        with self._lock:
            turn = self._turns[tab] = object()
            done = self._done.get(order.key)

        def go_on(_frames: int) -> None:
            if self._turns.get(tab) is not turn:
                raise OvertakenError

        if done is None:
            with self._solving:
                go_on(0)  # it may have been overtaken as it waited
                done = self._carried_out(order, go_on)
        with self._lock:
            self._done[order.key] = done
            self._done.move_to_end(order.key)
            while len(self._done) > KEPT:
                self._done.popitem(last=False)
        return done

    def names_of(self, orders: Sequence[Order], merged: bool) -> list[Names]:
        """Return what the files of several orders are called, each otherwise than those of the others; but all results
        the same if they are `merged`.
        """
        taken, found = frozenset(str(each["name"]).casefold() for each in self.dropped), list[Names]()
        for order in orders:
            clip, character = self._file(order.clip), self._target(order.character)
            files, form = (str(clip.path), str(character.path)), order.format or formats_of(character)[0]
            if merged and OUTPUTS.get(f".{form}") != "character":
                raise SettingsError(f"a .{form} file holds one motion; take all clips as glb, or in files of their own")
            found.append(Names(*files, form, order.animation or "", taken if len(orders) > 1 else frozenset(), merged))
            taken |= found[-1].all
        return found

    def command(self, orders: Sequence[Order], merged: bool) -> str:
        """Return the command line that makes the results of several orders, in files of their own or all in one."""
        each = enumerate(zip(self.names_of(orders, merged), orders, strict=True))
        return " && ".join(names.command(order, add=merged and number > 0) for number, (names, order) in each)

    def together(
        self, orders: Sequence[Order], merged: bool = False, with_files: bool = False, tab: str = ""
    ) -> tuple[str, bytes]:
        """Return the name and the content of a file with the results of several orders: a zip of them or, `merged`, one
        result with all animations. With the files that they are made from, in a folder, it is a zip in any case.
        """
        results, needed = dict[str, bytes](), dict[str, bytes]()
        for order, names in zip(orders, self.names_of(orders, merged), strict=True):
            done = self.carry_out(order, tab)
            results[names.result] = done.motion(names.result, results.get(names.result))
            needed |= done.made_from(names) if with_files else {}
        if merged and len(results) == 1 and not with_files:
            return results.popitem()
        if with_files:
            needed["command.txt"] = f"{self.command(orders, merged)}\n".encode()
        name = "clips" if len(results) > 1 else PurePath(next(iter(results))).stem
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            for path, data in (results | {f"made_from/{each}": data for each, data in needed.items()}).items():
                archive.writestr(path, data)
        return f"{name}.zip", content.getvalue()

    def end(self) -> None:
        """End what is carried out now as soon as may be."""
        self._turns.clear()

    def _carried_out(self, order: Order, go_on: Callable[[int], None]) -> Done:
        source, target = self._file(order.clip), self._target(order.character)
        formats, recipe = formats_of(target), order.recipe
        form = order.format or formats[0]
        if form not in formats:
            raise SettingsError(f"format is {form!r:.40}; expected one of {', '.join(formats)}")
        before = next((done for done in self._done.values() if done.order.preparation == order.preparation), None)
        conversion = before.conversion if before else self._conversion(source, target, recipe, go_on)
        converted = conversion.converted(
            recipe.name_of(source), (OUTPUTS[f".{form}"],), contacts=order.contacts, progress=go_on
        )
        if before:
            return replace(before, order=order, converted=converted, format=form)
        found, meshes = contacts_of(converted.result.baseline), meshes_of(converted.result, target.target, source)
        return Done(order, conversion, found, meshes, converted, form)

    @staticmethod
    def _conversion(source: InputFile, target: TargetFile, recipe: Recipe, go_on: Callable[[int], None]) -> Conversion:
        motion, _ = recipe.read(source)
        go_on(0)
        ready = Conversion.of(motion, source, target, recipe)
        return replace(ready, prepared=ready.prepared.once_solved(go_on))

    def _target(self, number: str) -> TargetFile:
        if number not in self._targets:
            raise FileError(self._file(number).path, "has no character; drop one as TARGET")
        return self._targets[number]

    def _file(self, number: str) -> InputFile:
        if number not in self._files:
            raise FileError("file", "was not dropped here; drop it again")
        return self._files[number]
