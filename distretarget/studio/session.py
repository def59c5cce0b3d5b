"""A session of the studio: the dropped files and the results of the last orders, in memory."""

from __future__ import annotations

import io
import json
import threading
import uuid
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Sequence
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
from distretarget.io.input_file import FBX, OUTPUT_FORMATS, OUTPUTS, InputFile
from distretarget.io.motion_writer import content_of, output_kind, suffix_of
from distretarget.io.reading import CharacterTarget, TargetFile, animations_in, parse_motion
from distretarget.measure.verdict import Remark
from distretarget.pipeline.found_contacts import MarkedContact, contacts_of, marked_contacts
from distretarget.pipeline.retargeting import Conversion, Converted
from distretarget.report.clip_page import Meshes, meshes_of, run_axes, run_motions, run_page, run_timeline
from distretarget.report.diff_document import About
from distretarget.skeleton import Skeleton
from distretarget.studio.order import Names, Order, project_to_json

MOST = 2_000_000_000  # of all dropped files [bytes]


class SupersededError(Exception):
    """A later order has replaced this one."""


@dataclass(frozen=True, eq=False)
class FinishedOrder:
    """An order and its result."""

    order: Order
    conversion: Conversion  # shared by orders that differ in contacts and format only
    found: ContactList  # the contacts detected in the clip
    meshes: Meshes  # of clip and character, for the player
    converted: Converted
    format: str

    @cached_property
    def contacts(self) -> tuple[MarkedContact, ...]:
        """The contacts of the clip: found, dropped and added."""
        return marked_contacts(self.converted.result, self.found)

    @cached_property
    def motions(self) -> dict[str, object]:
        """The motions and bodies for the player."""
        return run_motions(self.converted.result, self.meshes)

    @cached_property
    def as_data(self) -> dict[str, object]:
        """The other data that the page shows."""
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
            "source_joints": _joint_keys(result.source.skeleton),
            "target_joints": _joint_keys(result.motion.skeleton),
            "axes": run_axes(result),
            "frame_time": result.motion.frame_time,
            "formats": formats_of(self.conversion.target),
            "format": self.format,
            "command": self.names.command(self.order),
            "merges": OUTPUTS[f".{self.format}"] == "character",
        }

    @property
    def names(self) -> Names:
        """The names of its files."""
        animation = self.order.recipe.clip or ""
        return Names(str(self.conversion.source.path), str(self._character.path), self.format, animation)

    @property
    def _character(self) -> InputFile:
        assert self.conversion.target.file
        return self.conversion.target.file

    def file(self, kind: str, names: Names | None = None) -> tuple[str, bytes]:
        """Return the name and the content of a file to download: the motion, whose kind is the order's format, or the
        "contacts", "map", "project" or "report". By default the files have the order's own `names`.
        """
        names = names or self.names
        match kind:
            case "contacts":
                return names.of_kind("contacts.json"), contacts_to_json(self.order.contacts).encode()
            case "map":
                return names.of_kind("map.json"), self.order.map_json.encode()
            case "project":
                files = {self.order.clip: self.conversion.source, self.order.character: self._character}
                return names.of_kind("project.json"), project_to_json([self.order], self.format, files).encode()
            case "report":
                about = About(a=str(self.conversion.source.path), b=str(self.conversion.target.path))
                page = run_page(self.converted.result, about, self.conversion.target.target, self.conversion.source)
                return f"{PurePath(names.result).stem}.html", page.encode()
        if kind != self.format:
            raise SettingsError(f"kind is {kind!r:.40}; expected {self.format}, the format of the order")
        return names.result, self.motion(names.result)

    def motion(self, name: str, before: bytes | None = None) -> bytes:
        """Return the content of a file of this name with the motion, added to the content `before` if given."""
        onto = None if before is None else InputFile(before, name, has_folder=False)
        content = content_of(name, self.converted.clip, self.conversion.target, self.order.recipe.writing, onto)
        return b"".join(encoded_parts(content))

    def inputs(self, names: Names) -> dict[str, bytes]:
        """Return the files that its command line needs, and its project, by name."""
        kinds = ["project", *["contacts"] * bool(self.order.contacts.entries), *["map"] * self.order.has_map]
        inputs = {names.clip: self.conversion.source.content, names.character: self._character.content}
        return inputs | dict(self.file(kind, names) for kind in kinds)


def _remark(remark: Remark, body: Body) -> dict[str, object]:
    """A remark, its frame, and the keys of the joints of its parts of the body."""
    joints = [joint for part in remark.parts if (joint := body.joint_of(part)) is not None]
    return {"text": remark, "frame": remark.frame, "joints": [body.skeleton.keys[joint] for joint in joints]}


def _joint_keys(skeleton: Skeleton) -> list[str]:
    """The key of each joint, for End Sites that of the parent."""
    ends = zip(skeleton.parents.tolist(), skeleton.end_sites, strict=True)
    return [skeleton.keys[max(parent, 0) if end else joint] for joint, (parent, end) in enumerate(ends)]


def formats_of(target: TargetFile) -> list[str]:
    """Return the formats in which a result on a target can be written, the default first."""
    is_fbx, body = target.file is not None and target.file.format is FBX, target.target
    has_mesh = is_fbx and isinstance(body, CharacterTarget) and body.mesh() is not None
    default = "glb" if is_fbx else suffix_of(target).removeprefix(".")
    formats = []
    for kind in dict.fromkeys((default, *OUTPUT_FORMATS[1:])):
        with suppress(DistretargetError):
            if output_kind(f"out.{kind}", target.file) != "character" or not is_fbx or has_mesh:
                formats.append(kind)
    return formats


class Session:
    """The dropped files and the last finished orders, in memory."""

    def __init__(self) -> None:
        self.dropped: list[dict[str, object]] = []  # a description of each file, in the order in which they came
        self._known: dict[tuple[str, str], dict[str, object]] = {}  # the same by original name and hash
        self._files: dict[str, InputFile] = {}  # by id
        self._targets: dict[str, TargetFile] = {}  # of files that are characters, by id
        # The last order, and the one before if that has the same conversion, so that undo is instant; by their keys.
        self._finished: OrderedDict[str, FinishedOrder] = OrderedDict()
        self._latest: dict[str, object] = {}  # a token for the latest order of each tab
        self._lock = threading.Lock()
        self._solving = threading.Lock()  # orders are carried out one at a time

    def add(self, name: str, content: bytes) -> dict[str, object]:
        """Add a file, and return its description, with its "id"; a DistretargetError if it is neither a clip nor a
        character. A file that is there already is not added again; another one of the same name gets a number in it.
        """
        plain = PurePath(name.replace("\\", "/").replace("\0", "")).name
        file = InputFile(content, plain if plain.strip(".") else "file", has_folder=False)
        key = str(file.path), file.hash
        if key in self._known:
            return self._known[key]
        size = sum(len(each.content) for each in self._files.values())
        if size + len(content) > MOST:
            raise FileError(file.path, f"does not fit: the files on the page may have {MOST:,} bytes; start it anew")
        file_id = uuid.uuid4().hex
        names = animations_in(file)
        about: dict[str, object] = {"id": file_id, "name": str(file.path), "hash": file.hash, "animations": list(names)}
        errors = []
        try:
            self._targets[file_id] = TargetFile.of(file)
            about["character"] = True
        except DistretargetError as error:
            errors.append(error)
        try:
            if len(names) > 1:
                about["clip"] = True
            else:
                motion, lost = parse_motion(file, None, None)
                about |= {"clip": len(motion) > 0, "frames": len(motion), "notes": list(lost)}
                about["seconds"] = max(len(motion) - 1, 0) * motion.frame_time
        except DistretargetError as error:
            errors.append(error)
        if len(errors) == 2:
            raise errors[0]
        taken, place = {str(known["name"]).casefold() for known in self.dropped}, PurePath(file.path)
        numbered = (str(place.with_stem(f"{place.stem}{number or ''}")) for number in count())
        free = next(each for each in numbered if each.casefold() not in taken)
        if free != str(file.path):
            self._known[key] = self.add(free, content)
            return self._known[key]
        self._files[file_id] = file
        self._known[key] = about
        self.dropped.append(about)
        return about

    def carry_out(self, order: Order, tab: str = "") -> FinishedOrder:
        """Retarget as an order says, or return the cached result; a `SupersededError` if a later order of the same tab
        of the browser comes meanwhile, or the session ends.
        """
        with self._lock:
            token = self._latest[tab] = object()
            finished = self._finished.get(order.key)

        def check(_frames: int) -> None:
            if self._latest.get(tab) is not token:
                raise SupersededError

        if finished is None:
            with self._solving:
                check(0)  # a later order may have come while this one waited
                finished = self._carried_out(order, check)
        with self._lock:
            self._finished[order.key] = finished
            self._finished.move_to_end(order.key)
        return finished

    def names_of(self, orders: Sequence[Order], merged: bool) -> list[Names]:
        """Return the names of the files of several orders, all different, but for that of a `merged` result."""
        taken, found = frozenset(str(each["name"]).casefold() for each in self.dropped), list[Names]()
        for order in orders:
            clip, character = self._file(order.clip), self._target(order.character)
            form, animation = order.format or formats_of(character)[0], order.recipe.clip or ""
            if merged and OUTPUTS.get(f".{form}") != "character":
                raise SettingsError(f"a .{form} file holds one motion; take all clips as glb, or in files of their own")
            others = taken if len(orders) > 1 else frozenset()
            found.append(Names(str(clip.path), str(character.path), form, animation, others, merged))
            taken |= found[-1].all
        return found

    def command(self, orders: Sequence[Order], merged: bool) -> str:
        """Return the command line that makes the results of several orders, in one file each or `merged`."""
        each = enumerate(zip(self.names_of(orders, merged), orders, strict=True))
        return " && ".join(names.command(order, add=merged and number > 0) for number, (names, order) in each)

    def project(self, orders: Sequence[Order]) -> tuple[str, bytes]:
        """Return the name and the content of a project file of orders, the first of which is shown on the page."""
        (names,) = self.names_of(orders[:1], merged=False)
        return names.of_kind("project.json"), project_to_json(orders, names.output, self._files).encode()

    def bundle(
        self, orders: Sequence[Order], merged: bool = False, with_files: bool = False, tab: str = ""
    ) -> tuple[str, bytes]:
        """Return the name and the content of a file with the results of several orders: a zip of them or, `merged`, one
        result with all animations. `with_files` makes a zip that also has the inputs, in a folder.
        """
        results, inputs = dict[str, bytes](), dict[str, bytes]()
        for order, names in zip(orders, self.names_of(orders, merged), strict=True):
            finished = self.carry_out(order, tab)
            results[names.result] = finished.motion(names.result, results.get(names.result))
            inputs |= finished.inputs(names) if with_files else {}
        if merged and len(results) == 1 and not with_files:
            return results.popitem()
        if with_files:
            inputs["command.txt"] = f"{self.command(orders, merged)}\n".encode()
        name = "clips" if len(results) > 1 else PurePath(next(iter(results))).stem
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            for path, data in (results | {f"made_from/{each}": data for each, data in inputs.items()}).items():
                archive.writestr(path, data)
        return f"{name}.zip", content.getvalue()

    def end(self) -> None:
        """Make orders that are being carried out stop soon."""
        self._latest.clear()

    def _carried_out(self, order: Order, check: Callable[[int], None]) -> FinishedOrder:
        """The result of an order; `check` is called now and then, and may raise an error to stop."""
        source, target = self._file(order.clip), self._target(order.character)
        formats, recipe = formats_of(target), order.recipe
        form = order.format or formats[0]
        if form not in formats:
            raise SettingsError(f"format is {form!r:.40}; expected one of {', '.join(formats)}")
        similar = next((one for one in self._finished.values() if one.order.preparation == order.preparation), None)
        while len(self._finished) > (similar is not None):  # before the next result takes memory
            self._finished.popitem(last=False)
        name, kinds = recipe.name_of(source), (OUTPUTS[f".{form}"],)
        if similar:
            converted = similar.conversion.converted(name, kinds, order.contacts, check)
            return replace(similar, order=order, converted=converted, format=form)
        motion, _ = recipe.read(source)
        check(0)
        ready = Conversion.of(motion, source, target, recipe)
        conversion = replace(ready, prepared=ready.prepared.once_solved(check))
        converted = conversion.converted(name, kinds, order.contacts, check)
        found, meshes = contacts_of(converted.result.baseline), meshes_of(converted.result, target.target, source)
        return FinishedOrder(order, conversion, found, meshes, converted, form)

    def _target(self, file_id: str) -> TargetFile:
        if file_id not in self._targets:
            raise FileError(self._file(file_id).path, "has no character; drop one as TARGET")
        return self._targets[file_id]

    def _file(self, file_id: str) -> InputFile:
        if file_id not in self._files:
            raise FileError("file", "was not dropped here; drop it again")
        return self._files[file_id]
