"""What became of the clips of a run: how many are done, which are the worst, which failed and why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from distretarget.batch.record import ManifestRecord
from distretarget.errors import counted
from distretarget.measure.metrics import SUFFIXES, Metric, Variant, metrics_at

LISTED = 20  # most clips listed as failed, or as left out
WORST = 3  # most clips listed as the worst by a metric


@dataclass(kw_only=True)
class Tally:
    """Count the clips of a run by outcome, and remember the worst and the failures.

    Attributes:
        clips: clips in the run.
        done: clips retargeted.
        skipped: clips that an earlier run retargeted.
        failed: clips that could not be retargeted.
        left_out: clips that fail the condition on what is kept.
        warned: clips that are done and have warnings.
        frames: frames retargeted.
        workers: processes that did so.
        seconds: the time that took, without the start of the processes [s].
        alignments: what is to be said of the alignments of clips of one rig, a line each.
    """

    clips: int
    done: int = 0
    skipped: int = 0
    failed: int = 0
    left_out: int = 0
    warned: int = 0
    frames: int = 0
    workers: int = 1
    seconds: float = 0.0
    alignments: Sequence[str] = ()
    _worst: dict[Metric, list[ManifestRecord]] = field(default_factory=dict)
    _failures: list[str] = field(default_factory=list)
    _left_out: list[str] = field(default_factory=list)

    def add(self, record: ManifestRecord | None) -> None:
        """Count a clip by its record, or None if it was done before."""
        if record is None:
            self.skipped += 1
        elif record["left_out"]:
            self.left_out += 1
            if self.left_out <= LISTED:
                self._left_out.append(f"  {record['input']}: {record['left_out']}")
        elif record["status"] == "done":
            self.done += 1
            self.frames += record["frames"]
            self.warned += bool(record["warnings"])
            for metric in metrics_at("worst clips"):
                self._worst[metric] = worst([*self._worst.get(metric, ()), record], metric)[:WORST]
        else:
            self.failed += 1
            if self.failed <= LISTED:
                clip, error = record["input"], record["error"] or "no reason given"
                self._failures.append(f"  {error}" if error.startswith(clip) else f"  {clip}: {error}")

    @property
    def lines(self) -> list[str]:
        """The summary of the run."""
        counts = [f"{self.done} converted", f"{self.skipped} done before", f"{self.failed} failed"]
        if self.left_out:
            counts.append(f"{self.left_out} left out")
        if left := self.clips - self.done - self.skipped - self.failed - self.left_out:
            counts.append(f"{left} left")
        lines = [f"{counted(self.clips, 'clip')}: {', '.join(counts)}"]
        if self.frames:
            frames = "1 frame" if self.frames == 1 else f"{self.frames:,} frames"
            rate = f"{self.frames / self.seconds:,.0f} frames/s with {counted(self.workers, 'job')}"
            lines.append(f"{frames} in {self.seconds:.1f} s, {rate}")
        if self.warned:
            lines.append(f"{self.warned} of {self.done} have warnings, which are in metrics.csv")
        for metric, records in self._worst.items():
            if bad := [_compared(one, metric) for one in records if value(one, metric) > metric.least]:
                unit = f" [{metric.symbol}]" if metric.symbol else ""
                lines.append(f"worst {metric.label}{unit}: {', '.join(bad)}")
        left_out = _listing("left out:", self._left_out, self.left_out)
        return [*lines, *self.alignments, *left_out, *self.failures]

    @property
    def failures(self) -> list[str]:
        """Which clips failed, and why."""
        return _listing("failed:", self._failures, self.failed)


def _compared(record: ManifestRecord, metric: Metric) -> str:
    """A clip and its metric, beside that of copied rotations."""
    own, copy = (metric.brief(value(record, metric, side)) for side in ("result", "rotation_copy"))
    return f"{record['output']} ({own}, copied rotations {copy})"


def _listing(title: str, lines: list[str], count: int) -> list[str]:
    """The first lines of `count`, below a title; nothing if there are none."""
    more = count - len(lines)
    return [*([title] if count else []), *lines, *([f"  and {more} more; the manifest has them all"] if more else [])]


def worst(records: Iterable[ManifestRecord], metric: Metric) -> list[ManifestRecord]:
    """Return the records of clips, those with the largest metric first."""
    return sorted(records, key=lambda record: -value(record, metric))


def value(record: ManifestRecord, metric: Metric, of: Variant = "result") -> float:
    """Return a metric of a clip, 0 where nothing was to be measured."""
    return record["metrics"].get(metric.key + SUFFIXES[of]) or 0.0
