"""A whole batch: retarget the clips that are not done, record what became of each, and make pages on them."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path, PurePath

from distretarget.batch.alignment_spread import spread_warnings
from distretarget.batch.job import Job, Output, Recipe, Result
from distretarget.batch.pages import Pages
from distretarget.batch.plan import Clip
from distretarget.batch.record import ManifestRecord, new_record
from distretarget.batch.results import Results
from distretarget.batch.tally import Tally
from distretarget.batch.workers import Workers, convert_all
from distretarget.character.nodes import Animation
from distretarget.contact_entries import NO_CONTACTS
from distretarget.errors import BatchError, DistretargetError, FileError
from distretarget.io.contacts_file import SUFFIX as CONTACTS_SUFFIX
from distretarget.io.contacts_file import load_contacts
from distretarget.io.files import hash_of_file, read_bytes
from distretarget.io.gltf_writer import Parts
from distretarget.io.input_file import ARRAY_SUFFIXES, InputFile, with_files_beside
from distretarget.io.motion_writer import with_animations
from distretarget.io.target_file import CharacterTarget, TargetFile
from distretarget.numerics.parallel import cores
from distretarget.pipeline.performer import target_capsules

SPLIT_SIZE = 1 << 20  # smallest clip that gets several threads if it would keep one worker busy at the end [bytes]
BESIDE = Path("beside")  # stands for the contact file beside each clip

Show = Callable[[ManifestRecord | None], object]


@dataclass(frozen=True)
class Batch:
    """Clips to retarget, and how; an error as in `load_contacts` if the contact file for all of them cannot be read."""

    clips: Sequence[Clip]
    results: Results
    recipe: Recipe
    pages: Pages
    contacts: Path | None = None  # a contact file for all clips, or `BESIDE`, for the one beside each clip
    joints: InputFile | None = None  # the skeleton for clips that are arrays
    time_limit: float | None = None  # of a clip [s]
    fail_fast: bool = False  # whether to end with the first failure

    def __post_init__(self) -> None:
        if self.contacts not in (None, BESIDE):
            load_contacts(self.contacts)

    def record_of(self, clip: Clip, input_hash: str = "") -> ManifestRecord:
        """Return the record of a clip that is not done, whose file has this hash."""
        settings = self._recipe(clip).settings
        if (path := self._contacts_path(clip)) and (contacts_hash := hash_of_file(path)):
            settings["contacts"] = contacts_hash
        if self.joints and clip.path.suffix.lower() in ARRAY_SUFFIXES:
            settings["joints"] = self.joints.hash
        return new_record(clip, settings, input_hash)

    def _recipe(self, clip: Clip) -> Recipe:
        """How a clip is retargeted, which may be one of several animations of its file."""
        return replace(self.recipe, clip=clip.animation or self.recipe.clip)

    def _contacts_path(self, clip: Clip) -> Path | None:
        """The path of a clip's contact file; None if it has none."""
        beside = clip.path.with_suffix(CONTACTS_SUFFIX)
        return self.contacts if self.contacts != BESIDE else beside if beside.exists() else None

    @cached_property
    def _targets(self) -> dict[str, TargetFile]:
        """The targets, by the paths of their files."""
        return {str(clip.target.path): clip.target for clip in self.clips}

    @cached_property
    def _packed(self) -> dict[str, bytes]:
        """The targets as workers get them: with the capsules of a character if they are needed, without its file."""
        return {path: pickle.dumps(replace(self._prepared(file), file=None)) for path, file in self._targets.items()}

    def _prepared(self, file: TargetFile) -> TargetFile:
        """The target in a file, with its capsules if its mesh shows them and they are needed."""
        target, options = file.target, self.recipe.options
        known = options.skin == "none" or options.objective == "paper" or self.recipe.builds.target is not None
        if known or not isinstance(target, CharacterTarget):
            return file
        return replace(file, target=replace(target, capsules=target_capsules(target)))

    @property
    def kept_clips(self) -> list[Clip]:
        """The clips that are not left out."""
        left_out = {record["output"] for record in self._records if record["left_out"]}
        return [clip for clip in self.clips if clip.output not in left_out]

    @property
    def _records(self) -> list[ManifestRecord]:
        """The last record of each clip, if any, the newest last."""
        return [*self.results.manifest.latest(clip.output for clip in self.clips)]

    def check(self) -> None:
        """Raise a BatchError or FileError, before any work, if there are no clips or the page cannot be written."""
        if not self.clips:
            raise BatchError("there are no clips to convert")
        self.pages.check(self.clips, self.results, self.recipe.map_file.path)

    def convert(self, workers: Workers, tally: Tally, show: Show = lambda _record: None) -> None:
        """Retarget the clips that are not done, count them, and write the pages.

        `show` is called with each clip's record, or None for a clip that was done before.

        Raises:
            BatchError: the workers are gone, or a clip failed and `fail_fast` is set.
            FileError: the page over all clips cannot be written.
        """

        def count(record: ManifestRecord | None) -> None:
            tally.add(record)
            show(record)

        started, tally.workers = time.perf_counter(), workers.count
        manifest = self.results.manifest
        try:
            for result in convert_all(workers, self._jobs(workers.count, count)):
                self._finish(result, count)
            manifest.sort_metrics()
            records = self._records
            tally.alignments = [*spread_warnings(records)]
            for result in convert_all(workers, self._report_jobs(records)):
                self.pages.write_report(result.record, result.report, self.results)
            self.pages.write(records, self.results)
        finally:
            manifest.release()
            tally.seconds = time.perf_counter() - started - workers.start_seconds

    def _jobs(self, workers: int, show: Show) -> Iterator[Job]:
        """The clips that are not done; last those that another run is at work on, if that does not finish them."""
        left, others = sum(clip.size for clip in self.clips), list[Clip]()
        for clip in self.clips:
            is_long = clip.size > max(SPLIT_SIZE, left / workers)
            left -= clip.size
            if self.results.manifest.claim(clip.output):
                yield from self._unless_done(clip, is_long, show)
            else:
                others.append(clip)
        for clip in others:
            self.results.manifest.claim(clip.output)
            yield from self._unless_done(clip, False, show)

    def _unless_done(self, clip: Clip, is_long: bool, show: Show) -> Iterator[Job]:
        """The job of a clip that is not done."""
        record = self.record_of(clip)
        try:
            source = InputFile(read_bytes(clip.path), clip.path)
            record["input_hash"] = source.hash
            if known := self.results.known(record, clip.outputs):
                show(self.results.again(known, clip.outputs))
                self.results.manifest.release(record["output"])
                return
            job = self._job(source, clip, record)
        except DistretargetError as error:
            self._finish(Result({**record, "error": str(error)}), show)
            return
        yield replace(job, about=self.pages.about_at_once(clip), threads=cores() if is_long else None)

    def _report_jobs(self, records: Sequence[ManifestRecord]) -> Iterator[Job]:
        """The clips that need a report on their present output, from their records."""
        of_output, wanted = {record["output"]: record for record in records}, {*self.pages.without_report(records)}
        for clip in self.clips:
            if clip.output in wanted:
                with suppress(DistretargetError):
                    job = self._job(InputFile(read_bytes(clip.path), clip.path), clip, of_output[clip.output])
                    yield replace(job, about=self.pages.about(clip.path, PurePath(clip.output)))

    def _job(self, source: InputFile, clip: Clip, record: ManifestRecord) -> Job:
        """The job of a clip; an error if a file cannot be read."""
        contacts_path = self._contacts_path(clip)
        return Job(
            replace(with_files_beside(source), joints=self.joints),
            self._packed[str(clip.target.path)],
            self._recipe(clip),
            record,
            clip.outputs,
            contacts=load_contacts(contacts_path) if contacts_path else NO_CONTACTS,
            time_limit=self.time_limit,
        )

    def _finish(self, result: Result, show: Show) -> None:
        """Put the results of a clip in place, with its line of the manifest, and its report."""
        record = result.record
        try:
            if record["status"] == "done":
                contents = {name: self._parts(name, output, record) for name, output in result.outputs.items()}
                record = self.results.put(record, contents)
        except DistretargetError as error:
            record = {**record, "status": "failed", "error": str(error)}
        has_failed = record["status"] == "failed" and not record["left_out"]
        if has_failed:
            try:
                self.results.manifest.add(record)
            except FileError as error:
                record["error"] = f"{record['error']} ({error})"
        self.results.manifest.release(record["output"])
        show(record)
        if has_failed and self.fail_fast:
            raise BatchError(f"stopped at the first failure: {record['error']}")
        if record["status"] == "done":
            self.pages.write_report(record, result.report, self.results)

    def _parts(self, name: str, output: Output, record: ManifestRecord) -> Parts:
        """The content of the file of a result, in parts."""
        if not isinstance(output, Animation):
            return [output]
        target = self._targets[record["target"]]
        return with_animations(self.results.folder / name, target, [output], self.recipe.writing.animations)
