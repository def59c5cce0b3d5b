"""A whole batch: retarget clips, write and record the results, and make pages on them."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path, PurePath
from types import NoneType

from distretarget.batch.alignment_spread import spread_warnings
from distretarget.batch.keep import Condition
from distretarget.batch.manifest import VERSION, Manifest, ManifestRecord, Tally, new_record, options_of, worst
from distretarget.batch.metric_table import check_table, is_table
from distretarget.batch.metric_table import table as table_of
from distretarget.batch.plan import Clip, check_page, find_clips, plan
from distretarget.batch.time_limit import TIME_LIMITS
from distretarget.batch.workers import DEFAULT_READING, Job, Processes, Reading, Result, Workers, convert_all
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.character.nodes import Animation
from distretarget.checks import check_choice, check_kind, check_number, check_path
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.contacts_file import SUFFIX as CONTACTS_SUFFIX
from distretarget.io.contacts_file import load_contacts
from distretarget.io.files import (
    check_inside,
    check_writable,
    hash_of,
    hash_of_file,
    is_folder,
    make_folder,
    read_bytes,
    write_whole,
)
from distretarget.io.gltf_writer import Parts
from distretarget.io.input_file import ARRAY_SUFFIXES, InputFile, load_file, with_files_beside
from distretarget.io.map_json import MapFile, load_map
from distretarget.io.motion_writer import DEFAULT_OUTPUT, FORMATS, OutputSettings, with_animations
from distretarget.io.target_file import CharacterTarget, TargetFile
from distretarget.measure.metrics import METRICS
from distretarget.numerics.parallel import cores
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.performer import target_capsules
from distretarget.report.diff_document import About
from distretarget.report.index_page import index_page
from distretarget.target import LoadedTarget

SPLIT_SIZE = 1 << 20  # smallest clip that is split into chunks if it would keep one worker busy at the end [bytes]
MARK = '<meta name="generator" content="distretarget">'
OF = '<meta name="output" content="{}">'  # the hash of the output that a report is on
HEAD = 4096  # characters at the beginning of a page that may have MARK and OF

BESIDE = Path("beside")  # stands for the contact file beside each clip
Show = Callable[[ManifestRecord | None], object]


@dataclass(frozen=True)
class Batch:
    """Clips to retarget, and how."""

    clips: Sequence[Clip]
    folder: Path  # of results
    options: Options
    map_file: MapFile
    about: Callable[[PurePath, PurePath], About]  # what a report says of a clip, from its path and that of its result
    index: Path | None = None  # the page over all clips; None for no pages
    reports: int | None = None  # how many clips get a report beside it, the worst first; None for all
    overwrite: bool = False  # retarget again what is done, and replace files that this program did not write
    fail_fast: bool = False  # end with the first failure
    reading: Reading = DEFAULT_READING
    writing: OutputSettings = DEFAULT_OUTPUT
    builds: Builds = OWN_BUILDS
    table: Path | None = None  # the table of all clips
    keep: Condition | None = None  # clips that fail it are left out
    time_limit: float | None = None  # of a clip [s]
    contacts: Path | None = None  # a contact file for all clips, or `BESIDE`, for the one beside each clip
    joints: InputFile | None = None  # the skeleton for clips that are arrays
    problems: dict[Path, FileError] = field(default_factory=dict)  # why a report could not be written, by its path

    def record_of(self, clip: Clip) -> ManifestRecord:
        """Return the line of a clip that is not done."""
        usual = asdict(DEFAULT_READING) | asdict(DEFAULT_OUTPUT)
        given = asdict(self._reading(clip)) | asdict(self.writing)
        settings = {key: value for key, value in given.items() if value != usual[key]}
        if (path := self._contacts_path(clip)) and (contacts_hash := hash_of_file(path)):
            settings["contacts"] = contacts_hash
        if self.joints and clip.path.suffix.lower() in ARRAY_SUFFIXES:
            settings["joints"] = self.joints.hash
        return new_record(clip, options_of(self.options, self.map_file, self.builds) | settings)

    def _contacts_path(self, clip: Clip) -> Path | None:
        """The path of a clip's contact file, which may be missing if it is that beside the clip; None for none."""
        return clip.path.with_suffix(CONTACTS_SUFFIX) if self.contacts == BESIDE else self.contacts

    def _contacts(self, clip: Clip) -> ContactList:
        """What is said of the contacts of a clip."""
        path = self._contacts_path(clip)
        return load_contacts(path) if path and (self.contacts != BESIDE or path.exists()) else NO_CONTACTS

    def _source(self, file: InputFile) -> InputFile:
        """A clip's file with those that belong to it."""
        return replace(with_files_beside(file), joints=self.joints)

    def _reading(self, clip: Clip) -> Reading:
        """How a clip is read."""
        return replace(self.reading, clip=clip.animation) if clip.animation else self.reading

    @cached_property
    def _characters(self) -> dict[str, TargetFile]:
        """The targets, by the paths of their files."""
        return {str(clip.target.path): clip.target for clip in self.clips}

    @cached_property
    def _prepared(self) -> dict[str, TargetFile]:
        """The targets as workers get them: with the capsules of a character, and without its file."""
        return {
            path: replace(file, target=self._with_capsules(file), file=None) for path, file in self._characters.items()
        }

    def _with_capsules(self, file: TargetFile) -> LoadedTarget:
        """The target in a file, with its capsules if its mesh shows them and they are needed."""
        target = file.target
        known = self.options.skin == "none" or self.options.objective == "paper" or self.builds.target is not None
        if known or not isinstance(target, CharacterTarget):
            return target
        return replace(target, capsules=target_capsules(target))

    @cached_property
    def manifest(self) -> Manifest:
        """The manifest of the folder of results; the first use makes both."""
        return Manifest(self.folder)

    @property
    def kept_clips(self) -> list[Clip]:
        """The clips that are not left out."""
        left_out = {record["output"] for record in self.manifest.latest(self.clips) if "left_out" in record}
        return [clip for clip in self.clips if clip.place.as_posix() not in left_out]

    def check(self) -> None:
        """Raise a BatchError or FileError, before any work, if there are no clips or the page cannot be written."""
        if not self.clips:
            raise BatchError("there are no clips to convert")
        if self.table:
            check_table(self.table)
        for path in filter(None, (self.index, self.table)):
            check_page(path, self.clips, self.folder, self.map_file.path)
            above = next(each for each in (path, *path.absolute().parents) if os.path.lexists(each))
            if above == path:
                check_writable(path, self._is_replaceable(path))
            elif not is_folder(above) or not os.access(above, os.W_OK | os.X_OK):
                raise FileError(path, f"nothing can be written to {str(above)!r}")

    def convert(self, workers: Workers, tally: Tally, show: Show = lambda _record: None) -> None:
        """Retarget the clips that are not done, count them, and write the pages.

        `show` is called with each clip's line of the manifest, or None for a clip that was done before.

        Raises:
            BatchError: the workers are gone, or a clip failed and `fail_fast` is set.
            FileError: the page over all clips cannot be written.
        """

        def count(record: ManifestRecord | None) -> None:
            tally.add(record)
            show(record)

        started, tally.workers = time.perf_counter(), workers.count
        try:
            for result in convert_all(workers, self._jobs(workers.count, count)):
                self._finish(result, count)
            tally.alignments = [*spread_warnings(self.manifest.latest(self.clips))]
            if self.table:
                self._write_page(self.table, table_of(self.table, self.manifest.latest(self.clips), VERSION))
            if self.index:
                self._write_pages(self.index, workers)
        finally:
            self.manifest.release()
            tally.seconds = time.perf_counter() - started - workers.start_seconds

    def _write_pages(self, index: Path, workers: Workers) -> None:
        """Make the reports that are missing, and write the page over all clips."""
        records = {record["output"]: record for record in self.manifest.latest(self.clips)}
        for result in convert_all(workers, self._report_jobs(records)):
            self._write_report(result)
        paths = {name: self._report_path(name) for name, record in records.items() if self._has_report(record)}
        links = {name: Path(os.path.relpath(path, index.parent)).as_posix() for name, path in paths.items()}
        title = f"{len(records)} clips in {self.folder.resolve().name}"
        self._write_page(index, index_page(list(records.values()), links, title, VERSION))

    def _jobs(self, workers: int, show: Show) -> Iterator[Job]:
        """The clips that are not done; last those that another run is at work on, if that does not finish them."""
        left, others = sum(clip.size for clip in self.clips), list[Clip]()
        for clip in self.clips:
            split = clip.size > max(SPLIT_SIZE, left / workers)
            left -= clip.size
            if self.manifest.claim(clip.place.as_posix()):
                yield from self._unless_done(clip, split, show)
            else:
                others.append(clip)
        for clip in others:
            self.manifest.claim(clip.place.as_posix())
            yield from self._unless_done(clip, False, show)

    def _unless_done(self, clip: Clip, split: bool, show: Show) -> Iterator[Job]:
        """The job of a clip that is not done."""
        record = self.record_of(clip)
        try:
            content = read_bytes(clip.path)
            record["input_hash"] = hash_of(content)
            if known := self.known(clip, record, self.manifest):
                show(self._again(known))
                self.manifest.release(record["output"])
                return
            source, contacts = self._source(InputFile(content, clip.path)), self._contacts(clip)
        except DistretargetError as error:
            self._finish(Result(record | {"error": str(error)}), show)
            return
        about = self.about(clip.path, clip.place) if self.index and self.reports is None else None
        yield self._job(source, clip, record, about, contacts, split)

    def known(self, clip: Clip, record: ManifestRecord, manifest: Manifest) -> ManifestRecord | None:
        """The line of a clip that needs no work: it is done, or was left out and would be again; None for others."""
        if self.overwrite:
            return None
        output_hash = hash_of_file(self.folder / clip.place)
        if output_hash and (made := manifest.made(record, output_hash, self._hashes_of_others(clip))):
            return made
        left_out = manifest.left_out(record)
        return left_out if left_out and self.keep and self.keep.fault(left_out) else None

    def _again(self, known: ManifestRecord) -> ManifestRecord | None:
        """What to show of a clip that needs no work; None if it is done."""
        if self.keep and (fault := self.keep.fault(known)):
            return self._leave_out(known, fault)
        self.manifest.confirm(known["output"], known["output_hash"] or "")
        return None

    def _leave_out(self, record: ManifestRecord, fault: str) -> ManifestRecord:
        """Say in the manifest that a clip is left out, and remove results of it that a batch has made."""
        if record.get("left_out") == fault:
            return record
        names, reason = (record["output"], *record.get("others", {})), f"left out: {fault}"
        gone: ManifestRecord = {**record, "status": "failed", "error": reason, "left_out": fault, "output_hash": None}
        for key in ("alignment", "others"):
            gone.pop(key, None)  # type: ignore[misc]
        with self.manifest.locked():
            for path, name in ((self.folder / name, name) for name in names):
                check_inside(path, self.folder)
                if self.manifest.has_made(name, hash_of_file(path)):
                    path.unlink(missing_ok=True)
            self.manifest.add(gone)
        return gone

    def _hashes_of_others(self, clip: Clip) -> dict[str, str | None]:
        """The hashes of the other results of a clip, by their paths in the folder of results; None if missing."""
        return {place.as_posix(): hash_of_file(self.folder / place) for place in clip.others}

    def _report_jobs(self, records: dict[str, ManifestRecord]) -> Iterator[Job]:
        """The clips that need a report on their present output."""
        done = [record for record in records.values() if record["status"] == "done"]
        chosen = {record["output"]: record for record in worst(done, METRICS[0])[: self.reports]}
        for clip in self.clips:
            record = chosen.get(clip.place.as_posix())
            if record and not self._has_report(record) and self._report_path(record["output"]) not in self.problems:
                with suppress(DistretargetError):
                    source = self._source(InputFile(read_bytes(clip.path), clip.path))
                    about = self.about(clip.path, clip.place)
                    yield self._job(source, clip, record, about, self._contacts(clip))

    def _job(
        self,
        source: InputFile,
        clip: Clip,
        record: ManifestRecord,
        about: About | None,
        contacts: ContactList,
        split: bool = False,
    ) -> Job:
        target = self._prepared[str(clip.target.path)]
        ways = self.map_file, self.options, record, about, split, self._reading(clip), self.writing, self.builds
        others = tuple(place.as_posix() for place in clip.others)
        return Job(source, target, *ways, others=others, time_limit=self.time_limit, contacts=contacts)

    def _finish(self, result: Result, show: Show) -> None:
        """Write the output of a clip, its line of the manifest, and its report."""
        record = result.record
        if record["status"] == "done" and self.keep and (fault := self.keep.fault(record)):
            others = dict.fromkeys(result.others, "")
            self.manifest.release(record["output"])
            show(self._leave_out({**record, "others": others}, fault))
            return
        try:
            if record["status"] == "done":
                self._put(result)
        except DistretargetError as error:
            record |= {"status": "failed", "output_hash": None, "error": str(error)}
        if record["status"] == "failed":
            try:
                self.manifest.add(record)
            except FileError as error:
                record["error"] = f"{record['error']} ({error})"
        self.manifest.release(record["output"])
        show(record)
        if record["status"] == "failed" and self.fail_fast:
            raise BatchError(f"stopped at the first failure: {record['error']}")
        if record["status"] == "done":
            self._write_report(result)

    def _put(self, result: Result) -> None:
        """Write an output; its line of the manifest comes just before the output is put in place."""
        record, path = result.record, self.folder / result.record["output"]
        check_inside(path, self.folder)
        parts = self._parts(path, result)
        if isinstance(result.output, Animation):
            record["output_hash"] = hash_of(*parts)
        others = {
            name: self._parts(self.folder / name, replace(result, output=each)) for name, each in result.others.items()
        }
        if others:
            record["others"] = {name: hash_of(*each) for name, each in others.items()}
        make_folder(path.parent)
        with self.manifest.locked():
            for name, each in others.items():
                self._put_beside(name, each, record)
            output_hash = hash_of_file(path)
            if output_hash == record["output_hash"]:
                self.manifest.add(record)  # another run was faster
                return
            if not self.overwrite:
                self.manifest.check_replaceable(record, path, output_hash)
            replaces = self.overwrite or output_hash is not None
            write_whole(path, parts, replaces, lambda: self.manifest.add(record))

    def _parts(self, path: Path, result: Result) -> Parts:
        """The content of the file of a result, in parts."""
        if isinstance(result.output, bytes):
            return [result.output]
        character = self._characters[result.record["target"]]
        return with_animations(path, character, [result.output], self.writing.animations)

    def _put_beside(self, name: str, parts: Parts, record: ManifestRecord) -> None:
        """Write another output of a clip, before its first one, unless it is there already."""
        path = self.folder / name
        check_inside(path, self.folder)
        output_hash = hash_of_file(path)
        if output_hash == record["others"][name]:
            return
        if not self.overwrite:
            self.manifest.check_replaceable(record, path, output_hash, name)
        write_whole(path, parts, self.overwrite or output_hash is not None)

    def _write_report(self, result: Result) -> None:
        """Write the report on a clip, if any, or remember why that failed."""
        path = self._report_path(result.record["output"])
        try:
            if result.report and self.index:
                check_inside(path, self.index.parent)
                mark = MARK + OF.format(result.record["output_hash"])
                self._write_page(path, result.report.replace(MARK, mark, 1))
        except FileError as error:
            self.problems[path] = error

    def _report_path(self, output: str) -> Path:
        index = self.index or Path()
        return index.parent / f"{index.stem}_reports" / PurePath(output).with_suffix(".html")

    def _has_report(self, record: ManifestRecord) -> bool:
        """Whether a clip has a report on its present output, not on an earlier one."""
        return OF.format(record["output_hash"]) in _head(self._report_path(record["output"]))

    def _write_page(self, path: Path, content: str | bytes) -> None:
        make_folder(path.parent)
        with self.manifest.locked():
            write_whole(path, content, self._is_replaceable(path))

    def _is_replaceable(self, page: Path) -> bool:
        """Whether a page may be replaced, because this program wrote it or `overwrite` is set."""
        return self.overwrite or (is_table(page) if page == self.table else MARK in _head(page))


def _head(path: Path) -> str:
    """The beginning of a page; empty if it cannot be read, which writing it will report."""
    with suppress(OSError):
        if path.is_file():
            with path.open(encoding="utf-8", errors="replace") as file:
                return file.read(HEAD)
    return ""


def convert_folder(
    sources: str | Path | Sequence[str | Path],
    targets: str | Path | Sequence[str | Path],
    folder: str | Path,
    *,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    map_file: str | Path | None = None,
    rest: str | Path | None = None,
    clip: str | None = None,
    fps: float | None = None,
    formats: Sequence[str] = (),
    writing: OutputSettings = DEFAULT_OUTPUT,
    options: Options = DEFAULT_OPTIONS,
    builds: Builds = OWN_BUILDS,
    contacts: str | Path | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    fail_fast: bool = False,
    time_limit: float | None = None,
    report: str | Path | None = None,
    reports: int | None = 10,
    table: str | Path | None = None,
    keep: str | None = None,
    joints: str | Path | None = None,
) -> Tally:
    """Retarget motion files and folders of them to one target or several, as `distretarget batch` does.

    Clips that are done and unchanged are skipped, so an interrupted call continues where it stopped. A script that
    calls this needs `if __name__ == "__main__":`, since worker processes may import it.

    Args:
        sources: BVH, glTF, VRM animation and FBX files, and folders.
        targets: characters, skeleton files or BVH files; with several targets each gets its own folder in `folder`.
        folder: the folder of results, which has the same tree as the sources.
        include: shell patterns for names or paths of files in folders, of which one must match.
        exclude: shell patterns for files to leave out.
        map_file: a map file, as `--map` takes it.
        rest: a file of the clips' rig whose first frame is a standing pose, as `--rest` takes it.
        clip: the animation to read of files that have several.
        fps: the frame rate to sample animations at [frames/s]; their own keys by default.
        formats: of the results, such as ("bvh", "npz"): files of each clip, named alike; by default, and for "own",
            that of the target if it is glTF, else "bvh".
        writing: how motions are put into the files of characters.
        options: how to retarget.
        builds: how thick the bodies are, if other files say it than their own.
        contacts: a contact file for all clips; or "beside", for the file beside each clip that has one, such as
            `walk.contacts.json`.
        jobs: the number of processes; one for each core if not given.
        overwrite: whether to retarget everything again, and to replace files that no batch made.
        fail_fast: whether to stop at the first clip that fails.
        time_limit: the longest time for a clip [s]; one that takes longer fails, and the next call tries it again.
        report: an HTML page on all clips to write.
        reports: how many clips get a report beside it, the worst first; None for all.
        table: a table to write with a row for each clip, .csv or .parquet.
        keep: a condition on metrics, such as "pop == 0"; clips that fail it are left out.
        joints: the skeleton for clips that are arrays, which folders are searched for then; see `read_motion`.

    Returns:
        The numbers of clips converted, skipped, failed and left out, and `lines` to print.

    Raises:
        BatchError: there are no clips, results would replace clips, or `fail_fast` stopped the batch.
        DistretargetError: a target, the map or the folder of results cannot be used.
        SettingsError: an argument has the wrong type, or is out of bounds.
    """
    check_kind("options", options, Options)
    check_kind("builds", builds, Builds)
    check_kind("include", include, Sequence)
    check_kind("exclude", exclude, Sequence)
    check_kind("keep", keep, str, NoneType)
    check_kind("formats", formats, Sequence)
    for each in [formats] if isinstance(formats, str) else formats:
        check_choice("formats", each, FORMATS)
    for name, number, least in (("jobs", jobs, 1), ("reports", reports, 0)):
        check_kind(name, number, int, NoneType)
        check_number(name, least if number is None else number, least, sys.maxsize)
    if time_limit is not None:
        check_number("time_limit", time_limit, *TIME_LIMITS)
    check_path("folder", folder)
    paths = _listed("sources", sources)
    found, unread = find_clips(paths, (), include, exclude, arrays=joints is not None)
    if unread:
        raise unread[0]
    clips = plan(found, load_targets(_listed("targets", targets)), Path(folder), paths, formats, clip)
    index, pairs = Path(report) if report else None, load_map(map_file, rest)
    of_all = Path(table) if table else None

    def about(clip: PurePath, result: PurePath) -> About:
        return About(a=clip.name, b=result.name)

    ways = options, pairs, about, index, reports, overwrite, fail_fast
    condition = Condition(keep) if keep else None
    asked = None if contacts is None else checked_contacts(Path(contacts))
    skeleton = load_file(joints) if joints else None
    how = Reading(clip, fps), writing, builds, of_all, condition, time_limit, asked
    batch = Batch(clips, Path(folder), *ways, *how, skeleton)
    batch.check()
    tally = Tally(clips=len(batch.clips))
    with closing(Processes(jobs or cores(), options.objective)) as workers:
        batch.convert(workers, tally)
    return tally


def checked_contacts(path: Path) -> Path:
    """Return the path of a contact file that can be read, or `BESIDE`; errors as in `load_contacts`."""
    if path != BESIDE:
        load_contacts(path)
    return path


def load_targets(paths: Sequence[Path]) -> list[TargetFile]:
    """Read the files of targets."""
    return [TargetFile.of(load_file(path)) for path in paths]


def _listed(name: str, paths: str | Path | Sequence[str | Path]) -> list[Path]:
    """The paths in an argument of one path or several."""
    several = paths if isinstance(paths, Sequence) and not isinstance(paths, str) else [paths]
    for path in several:
        check_path(name, path)
    return [Path(path) for path in several]
