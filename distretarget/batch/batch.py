"""Run a batch: retarget the clips that are not done, record the outcome of each, and make pages on them."""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path, PurePath
from types import NoneType

from distretarget.batch.pages import Pages
from distretarget.batch.plan import PlannedClip, find_clips, plan
from distretarget.batch.results import BatchRecord, Results, new_record
from distretarget.batch.summary import Tally, spread_warnings
from distretarget.batch.workers import TIME_LIMITS, Job, Output, Processes, Result, Workers, convert_all
from distretarget.character.nodes import Animation
from distretarget.checks import check_choice, check_kind, check_number, check_path
from distretarget.contact_entries import NO_CONTACTS
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.contacts_file import SUFFIX as CONTACTS_SUFFIX
from distretarget.io.contacts_file import load_contacts
from distretarget.io.files import hash_of_file, read_bytes
from distretarget.io.gltf_writer import Parts
from distretarget.io.input_file import ARRAYS, OUTPUT_FORMATS, InputFile, load_file, with_files_beside
from distretarget.io.motion_writer import with_animations
from distretarget.io.reading import CharacterTarget, TargetFile
from distretarget.numerics.parallel import cores
from distretarget.pipeline.performer import target_capsules
from distretarget.pipeline.retargeting import DEFAULT_RECIPE, Recipe
from distretarget.report.diff_document import About

SPLIT_SIZE = 1 << 20  # clips larger than this get several threads if one worker would finish them last [bytes]
BESIDE = Path("beside")  # stands for the contact files beside clips

Show = Callable[[BatchRecord | None], object]


@dataclass(frozen=True)
class Batch:
    """Clips to retarget, and how; errors as in `load_contacts` if the contact file for all clips cannot be read."""

    clips: Sequence[PlannedClip]
    pages: Pages
    recipe: Recipe
    contacts: Path | None = None  # a contact file for all clips, or `BESIDE` for one beside each clip
    skeleton: InputFile | None = None  # the skeleton of clips that are arrays
    time_limit: float | None = None  # per clip [s]
    fail_fast: bool = False  # whether to stop at the first failure

    def __post_init__(self) -> None:
        if self.contacts not in (None, BESIDE):
            load_contacts(self.contacts)

    @property
    def results(self) -> Results:
        """The folder of results."""
        return self.pages.results

    def record_of(self, clip: PlannedClip, input_hash: str = "") -> BatchRecord:
        """Return the record of a clip before it is retargeted; `input_hash` is that of its file."""
        settings = {**self._recipe(clip).settings}
        if (path := self._contacts_path(clip)) and (contacts_hash := hash_of_file(path)):
            settings["contacts"] = contacts_hash
        if self.skeleton and clip.path.suffix.lower() in ARRAYS.others:
            settings["skeleton"] = self.skeleton.hash
        return new_record(clip, settings, input_hash)

    def _recipe(self, clip: PlannedClip) -> Recipe:
        """The recipe of a clip, with its animation if the file has several."""
        return replace(self.recipe, clip=clip.animation) if clip.animation else self.recipe

    def _contacts_path(self, clip: PlannedClip) -> Path | None:
        if self.contacts != BESIDE:
            return self.contacts
        beside = clip.path.with_suffix(CONTACTS_SUFFIX)
        return beside if beside.exists() else None

    @cached_property
    def _targets(self) -> dict[str, TargetFile]:
        """The targets by the paths of their files."""
        return {str(clip.target.path): clip.target for clip in self.clips}

    @cached_property
    def _packed(self) -> dict[str, bytes]:
        """The targets pickled for workers, by path: without the file, but with a character's capsules if needed."""
        options, packed = self.recipe.options, {}
        unused = options.skin == "none" or options.objective == "paper" or self.recipe.builds.target is not None
        for path, file in self._targets.items():
            target = file.target
            if isinstance(target, CharacterTarget) and not unused:
                target = replace(target, capsules=target_capsules(target))
            packed[path] = pickle.dumps(replace(file, target=target, file=None))
        return packed

    @property
    def _records(self) -> list[BatchRecord]:
        """The newest record of each clip, if any, sorted by output."""
        outputs = {clip.output for clip in self.clips}
        records = (record for record in self.results.database.latest() if record["output"] in outputs)
        return sorted(records, key=lambda record: record["output"])

    def check(self) -> None:
        """Raise a BatchError or FileError, before any work, if there are no clips or pages cannot be written."""
        if not self.clips:
            raise BatchError("there are no clips to convert")
        self.pages.check(self.clips, self.recipe.map_file.path)

    def convert(self, workers: Workers, tally: Tally, show: Show = lambda _record: None) -> None:
        """Retarget the clips that are not done, count them, and write the pages; `show` gets each clip's record, or
        None for one done before. A BatchError if the workers are gone or `fail_fast` stops it, a FileError if a page
        cannot be written.
        """

        def count(record: BatchRecord | None) -> None:
            tally.add(record)
            show(record)

        started, tally.workers = time.perf_counter(), workers.count
        with closing(self.results.database):
            try:
                for result in convert_all(workers, self._jobs(workers.count, count)):
                    self._finish(result, count)
                records = self._records
                tally.alignments = [*spread_warnings(records)]
                for result in convert_all(workers, self._report_jobs(records)):
                    self.pages.write_report(result.record, result.report)
                self.pages.write(records)
            except BaseException:
                with suppress(FileError):
                    self.pages.write(self._records)
                raise
            finally:
                tally.seconds = time.perf_counter() - started - workers.start_seconds

    def _jobs(self, workers: int, show: Show) -> Iterator[Job]:
        """The jobs of clips that are not done; clips claimed by another run come last, as it may have been killed."""
        remaining, claimed = sum(clip.size for clip in self.clips), list[PlannedClip]()
        for clip in self.clips:
            threads = cores() if clip.size > max(SPLIT_SIZE, remaining / workers) else None
            remaining -= clip.size
            for job in self._unless_done(clip, show, claimed):
                yield replace(job, threads=threads)
        for clip in claimed:
            yield from self._unless_done(clip, show)

    def _unless_done(self, clip: PlannedClip, show: Show, claimed: list[PlannedClip] | None = None) -> Iterator[Job]:
        """The job of a clip that is not done; a clip that another run has claimed is added to `claimed`, if given."""
        record = self.record_of(clip)
        try:
            source = InputFile(read_bytes(clip.path), clip.path)
            record["input_hash"] = source.hash
            known = self.results.known(record, clip.outputs)
            if not known and claimed is not None:
                if not self.results.database.claim(clip.output):
                    claimed.append(clip)
                    return
                known = self.results.known(record, clip.outputs)  # another run may have just done it
            if known:
                show(None)
                return
            job = self._job(source, clip, record)
        except DistretargetError as error:
            self._finish(Result({**record, "error": str(error)}), show)
            return
        at_once = self.pages.index and self.pages.reports is None  # all clips get a report
        yield replace(job, about=self.pages.about(clip.path, PurePath(clip.output)) if at_once else None)

    def _report_jobs(self, records: Sequence[BatchRecord]) -> Iterator[Job]:
        """The jobs of clips that still need a report on their present output."""
        by_output, missing = {record["output"]: record for record in records}, {*self.pages.without_report(records)}
        for clip in self.clips:
            if clip.output in missing:
                with suppress(DistretargetError):
                    job = self._job(InputFile(read_bytes(clip.path), clip.path), clip, by_output[clip.output])
                    yield replace(job, about=self.pages.about(clip.path, PurePath(clip.output)))

    def _job(self, source: InputFile, clip: PlannedClip, record: BatchRecord) -> Job:
        """The job of a clip; an error if a file cannot be read."""
        contacts_path = self._contacts_path(clip)
        return Job(
            replace(with_files_beside(source), skeleton=self.skeleton),
            self._packed[str(clip.target.path)],
            self._recipe(clip),
            record,
            clip.outputs,
            contacts=load_contacts(contacts_path) if contacts_path else NO_CONTACTS,
            time_limit=self.time_limit,
        )

    def _finish(self, result: Result, show: Show) -> None:
        """Write the results of a clip, record its outcome, and write its report."""
        record = result.record
        try:
            if record["status"] == "done":
                contents = {name: self._parts(name, output, record) for name, output in result.outputs.items()}
                record = self.results.put(record, contents)
        except DistretargetError as error:
            record = {**record, "status": "failed", "error": str(error)}
        try:
            if record["status"] == "failed":
                self.results.add(record, [record["output"], *result.outputs])
            self.results.database.release(record["output"])
        except FileError as error:
            record = {**record, "error": f"{record['error']} ({error})"}
        show(record)
        if record["status"] == "failed" and self.fail_fast:
            raise BatchError(f"stopped at the first failure: {record['error']}")
        if record["status"] == "done":
            self.pages.write_report(record, result.report)

    def _parts(self, name: str, output: Output, record: BatchRecord) -> Parts:
        """The content of a result's file, in parts."""
        if not isinstance(output, Animation):
            return [output]
        target = self._targets[record["target"]]
        return with_animations(self.results.folder / name, target, [output], self.recipe.writing.animations)


def convert_folder(
    sources: str | Path | Sequence[str | Path],
    targets: str | Path | Sequence[str | Path],
    folder: str | Path,
    *,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    recipe: Recipe = DEFAULT_RECIPE,
    formats: Sequence[str] = (),
    contacts: str | Path | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    fail_fast: bool = False,
    time_limit: float | None = None,
    report: str | Path | None = None,
    reports: int | None = 10,
    table: str | Path | None = None,
    skeleton: str | Path | None = None,
) -> Tally:
    """Retarget motion files and folders of them to one or several targets, as `distretarget batch` does.

    Clips that are done and unchanged are skipped, so an interrupted call continues where it stopped. A script that
    calls this needs `if __name__ == "__main__":`, since worker processes may import it.

    Args:
        sources: BVH, glTF, VRM animation and FBX files, and folders.
        targets: characters, skeleton files or BVH files; with several targets each gets its own folder in `folder`.
        folder: for the results; gets the same tree as the sources.
        include: shell patterns for names or paths of files in folders; only files that match one are retargeted.
        exclude: shell patterns for files to leave out.
        recipe: how each clip is read, retargeted and written.
        formats: of the results, such as ("bvh", "npz"), one file each; "own", the default, is the target's if it is
            glTF, else "bvh".
        contacts: a contact file for all clips; or "beside" for files beside clips, such as `walk.contacts.json`.
        jobs: the number of processes; by default one for each core.
        overwrite: whether to retarget everything again, and to replace files that no batch made.
        fail_fast: whether to stop at the first clip that fails.
        time_limit: per clip [s]; one that takes longer fails, and the next call tries it again.
        report: the path of an HTML page about all clips.
        reports: how many clips, the worst first, get a report beside that page; None for all.
        table: the path of a table, .csv or .parquet, with a row for each clip.
        skeleton: the file with the skeleton of clips that are arrays, which are then also searched for in folders; see
            `read_motion`.

    Returns:
        The numbers of clips converted, skipped and failed, and `lines` to print.

    Raises:
        BatchError: there are no clips, results would replace clips, or `fail_fast` stopped the batch.
        DistretargetError: a target or the folder of results cannot be used.
        SettingsError: an argument has the wrong type, or is out of bounds.
    """
    check_kind("recipe", recipe, Recipe)
    for name, words in (("include", include), ("exclude", exclude), ("formats", formats)):
        check_kind(name, words, Sequence)
    for each in formats:
        check_choice("formats", each, OUTPUT_FORMATS)
    for name, number, least in (("jobs", jobs, 1), ("reports", reports, 0)):
        check_kind(name, number, int, NoneType)
        check_number(name, least if number is None else number, least, sys.maxsize)
    if time_limit is not None:
        check_number("time_limit", time_limit, *TIME_LIMITS)
    check_path("folder", folder)
    paths = _listed("sources", sources)
    found, unread = find_clips(paths, (), include, exclude, arrays=skeleton is not None)
    if unread:
        raise unread[0]
    files = [TargetFile.of(load_file(path)) for path in _listed("targets", targets)]
    clips = plan(found, files, Path(folder), paths, formats, recipe.clip)
    batch = Batch(
        clips,
        Pages(
            Results(Path(folder), overwrite),
            lambda clip, result: About(a=clip.name, b=result.name),
            Path(report) if report else None,
            reports,
            Path(table) if table else None,
        ),
        recipe,
        None if contacts is None else Path(contacts),
        load_file(skeleton) if skeleton else None,
        time_limit,
        fail_fast,
    )
    batch.check()
    tally = Tally(clips=len(clips))
    with closing(Processes(jobs or cores())) as workers:
        batch.convert(workers, tally)
    return tally


def _listed(name: str, paths: str | Path | Sequence[str | Path]) -> list[Path]:
    """The paths in an argument that is one path or several."""
    several = paths if isinstance(paths, Sequence) and not isinstance(paths, str) else [paths]
    for path in several:
        check_path(name, path)
    return [Path(path) for path in several]
