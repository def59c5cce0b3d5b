"""What a batch came to, in lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from distretarget.batch.manifest import Record

FAILURES = 20  # that are listed, at most
WORST = 3  # clips by each figure
FIGURES = ("contact_error", "direction_error", "stress")  # by which clips are worst
LEAST = 1e-6  # figures below are not bad in any clip


@dataclass
class Tally:
    """What became of the clips of a run.

    Attributes:
        done, failed: their lines of the manifest; those done without warnings and options.
        skipped: how many had nothing to do.
    """

    done: list[Record] = field(default_factory=list)
    failed: list[Record] = field(default_factory=list)
    skipped: int = 0

    @property
    def frames(self) -> int:
        """How many frames were converted."""
        return sum(record["frames"] for record in self.done)

    def add(self, record: Record | None) -> None:
        """Count a clip."""
        if record is None:
            self.skipped += 1
        elif record["status"] == "done":
            self.done.append({name: record[name] for name in ("input", "output", "frames", "figures")})
        else:
            self.failed.append(record)

    def lines(self, clips: int, seconds: float, workers: int) -> Iterator[str]:
        """The summary of a run over so many clips."""
        counts = [f"{len(self.done)} converted", f"{self.skipped} done before", f"{len(self.failed)} failed"]
        if left := clips - len(self.done) - self.skipped - len(self.failed):
            counts.append(f"{left} left")
        yield f"{clips} {'clip' if clips == 1 else 'clips'}: {', '.join(counts)}"
        if self.frames:
            jobs = f"{workers} {'job' if workers == 1 else 'jobs'}"
            yield f"{self.frames:,} frames in {seconds:.1f} s, {self.frames / seconds:,.0f} frames/s with {jobs}"
        for figure in FIGURES:
            if clips_by := list(_worst(self.done, figure)):
                yield f"worst {figure.replace('_', ' ')}: {', '.join(clips_by)}"
        yield from failures(self.failed)


def failures(records: Sequence[Record]) -> Iterator[str]:
    """A line for each failure."""
    if records:
        yield "failed:"
    for record in records[:FAILURES]:
        clip, error = record["input"], record["error"]
        yield f"  {error}" if error.startswith(clip) else f"  {clip}: {error}"
    if len(records) > FAILURES:
        yield f"  and {len(records) - FAILURES} more; the manifest has them all"


def worst(records: Iterable[Record], figure: str) -> list[Record]:
    """The clips that are done, those with the largest figure first."""
    return sorted(records, key=lambda record: -record["figures"]["result"][figure])


def _worst(records: Iterable[Record], figure: str) -> Iterator[str]:
    for record in worst(records, figure)[:WORST]:
        value, copy = (record["figures"][name][figure] for name in ("result", "rotation_copy"))
        if value > LEAST:
            yield f"{record['output']} ({value:.3g}, rotation copy {copy:.3g})"
