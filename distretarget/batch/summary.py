"""The summary of a batch, in lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from distretarget.batch.record import ManifestRecord
from distretarget.measure.figures import Figure, figures_at

FAILURES = 20  # most failures that are listed
WORST = 3  # most clips that are listed as the worst by a figure
LEAST = 1e-6  # a clip with a figure up to this is not listed among the worst


@dataclass(kw_only=True)
class Tally:
    """Counts the clips of a run by outcome, and remembers the worst and the failures.

    Attributes:
        done: clips converted.
        skipped: clips that were converted by an earlier run.
        failed: clips that could not be converted.
        frames: frames converted.
        warned: clips converted that need a look.
    """

    done: int = 0
    skipped: int = 0
    failed: int = 0
    frames: int = 0
    warned: int = 0
    _worst: dict[Figure, list[ManifestRecord]] = field(default_factory=dict)
    _failures: list[str] = field(default_factory=list)

    def add(self, record: ManifestRecord | None) -> None:
        """Count a clip by its line of the manifest; None stands for a clip that an earlier run converted."""
        if record is None:
            self.skipped += 1
        elif record["status"] == "done":
            self.done += 1
            self.frames += record["frames"]
            self.warned += bool(record["warnings"])
            for figure in figures_at("worst clips"):
                self._worst[figure] = worst([*self._worst.get(figure, ()), record], figure)[:WORST]
        else:
            self.failed += 1
            if self.failed <= FAILURES:
                self._failures.append(_failure(record))

    def lines(self, clips: int, seconds: float, workers: int) -> Iterator[str]:
        """The summary of a run over `clips` clips, which took `seconds` with `workers` processes."""
        counts = [f"{self.done} converted", f"{self.skipped} done before", f"{self.failed} failed"]
        if left := clips - self.done - self.skipped - self.failed:
            counts.append(f"{left} left")
        yield f"{clips} {'clip' if clips == 1 else 'clips'}: {', '.join(counts)}"
        if self.frames:
            jobs = f"{workers} {'job' if workers == 1 else 'jobs'}"
            frames = "1 frame" if self.frames == 1 else f"{self.frames:,} frames"
            yield f"{frames} in {seconds:.1f} s, {self.frames / seconds:,.0f} frames/s with {jobs}"
        if self.warned:
            yield f"{self.warned} of {self.done} need a look; the manifest has their warnings"
        for figure, records in self._worst.items():
            if bad := [_value(record, figure) for record in records if _of_result(record, figure) > LEAST]:
                yield f"worst {figure.label}: {', '.join(bad)}"
        yield from self.failure_lines()

    def failure_lines(self) -> Iterator[str]:
        """Which clips failed, and why; nothing if none did."""
        if self.failed:
            yield from ("failed:", *(f"  {failure}" for failure in self._failures))
        if self.failed > FAILURES:
            yield f"  and {self.failed - FAILURES} more; the manifest has them all"


def worst(records: Iterable[ManifestRecord], figure: Figure) -> list[ManifestRecord]:
    """The lines of converted clips, those with the largest figure first."""
    return sorted(records, key=lambda record: -_of_result(record, figure))


def _of_result(record: ManifestRecord, figure: Figure) -> float:
    """The figure of the result, 0 where nothing was to be measured."""
    return record["figures"].get("result", {}).get(figure.key) or 0.0


def _failure(record: ManifestRecord) -> str:
    clip, error = record["input"], record["error"] or "no reason given"
    return error if error.startswith(clip) else f"{clip}: {error}"


def _value(record: ManifestRecord, figure: Figure) -> str:
    value, copy = (record["figures"][side][figure.key] for side in ("result", "rotation_copy"))
    return f"{record['output']} ({value:.3g}, rotation copy {copy:.3g})"
