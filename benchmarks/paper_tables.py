"""The tables of docs/paper.md, by name."""

from __future__ import annotations

from collections.abc import Iterable

from paper_checks import checks, less
from paper_edits import EditRow, MethodsRow, edit_rows, methods_rows
from paper_motions import MotionRow, motion_rows
from paper_spine import pair_rows, spine_rows
from paper_starts import StartRow, eta_rows, start_rows, tolerance_rows

METHODS = "copy / points / exact bones / contact"


def tables() -> dict[str, str]:
    """Every table."""
    motions = list(motion_rows())
    return {
        "checks": checks_table(),
        "edits": edits_table(edit_rows()),
        "methods": methods_table(methods_rows()),
        "spine": spine_table(),
        "pairs": pairs_table(),
        "starts": starts_table(),
        "tolerances": tolerances_table(),
        "etas": etas_table(),
        "motions": motions_table(motions),
        "solving": solving_table(motions),
    }


def checks_table() -> str:
    """What is known exactly, and what is found."""
    return table(("", "known", "found"), checks())


def edits_table(rows: Iterable[EditRow]) -> str:
    """What the paper's solver finds."""
    head = (
        "edit",
        "sigma, start",
        "sigma, end",
        "iterations",
        "evaluations",
        "bone error, mean / largest, %",
        "distance error, start / end",
        "sigma off L-BFGS-B's",
        "time, ms",
        "L-BFGS-B, ms",
    )
    return table(head, map(edit_cells, rows))


def edit_cells(row: EditRow) -> list[str]:
    """A line of the table of edits; sigma in 10^-3 m^2."""
    return [
        row.edit,
        f"{1e3 * row.start:.2f}",
        f"{1e3 * row.end:.2f}",
        str(row.iterations),
        str(row.evaluations),
        several([100 * row.bones, 100 * row.largest_bone], ".1f"),
        several(row.distances, ".4f"),
        less(row.lbfgs, 1e-9),
        f"{1e3 * row.time:.2f}",
        f"{1e3 * row.lbfgs_time:.1f}",
    ]


def methods_table(rows: Iterable[MethodsRow]) -> str:
    """What every method makes of the same posture."""
    return table(
        (
            "edit",
            f"sigma: {METHODS}",
            "largest bone error, %",
            "direction error, degrees",
            "contact error in the walk: copy / exact bones / contact",
        ),
        map(methods_cells, rows),
    )


def methods_cells(row: MethodsRow) -> list[str]:
    """A line of the table of methods; sigma in 10^-3 m^2."""
    return [
        row.edit,
        several([1e3 * sigma for sigma in row.sigma], ".1f"),
        several([100 * error for error in row.largest_bone], ".1f"),
        several(row.direction, ".1f"),
        several(row.contact_error, ".3f"),
    ]


def spine_table() -> str:
    """The posture on the long spine."""
    return table(
        ("", "source", "copy", "points", "exact bones", "contact"),
        ([name, *(f"{value:.{2 if '[m]' in name else 0}f}" for value in values)] for name, values in spine_rows()),
    )


def pairs_table() -> str:
    """Which pairs sigma comes from on the long spine, in 10^-3 m^2."""
    return table(
        ("sigma of the pairs of", "copy", "points", "exact bones", "contact"),
        ([name, *(f"{1e3 * sigma:.1f}" for sigma in sigmas)] for name, sigmas in pair_rows()),
    )


def starts_table() -> str:
    """What the start does to each clip."""
    return table(
        ("start", "iterations: walk / turn", "sigma, end", "in a higher minimum, %", "mirrored, %"),
        ([name, *start_cells(rows)] for name, rows in start_rows()),
    )


def start_cells(rows: list[StartRow]) -> list[str]:
    """A line of the table of starts without its start; sigma in 10^-3 m^2."""
    return [
        several([row.iterations for row in rows], ".0f"),
        several([1e3 * row.sigma for row in rows], ".2f"),
        several([100 * row.higher for row in rows], ".1f"),
        several([100 * row.mirrored for row in rows], ".1f"),
    ]


def tolerances_table() -> str:
    """What the tolerance does."""
    return table(
        ("tolerance, body sizes", "iterations", "sigma above the minimum's, %", "points off, mm"),
        (
            [f"{tolerance:.0e}", f"{count:.0f}", f"{100 * left:.2g}", f"{1e3 * off:.2g}"]
            for tolerance, count, left, off in tolerance_rows()
        ),
    )


def etas_table() -> str:
    """What eta does."""
    return table(
        ("eta", "iterations", "evaluations", "in a higher minimum, %", "frames not solved"),
        (
            [f"{eta:g}", f"{count:.0f}", f"{evaluations:.0f}", f"{100 * higher:.1f}", str(unsolved)]
            for eta, count, evaluations, higher, unsolved in eta_rows()
        ),
    )


def motions_table(rows: Iterable[tuple[str, MotionRow]]) -> str:
    """Whole motions: how good they are."""
    head = (
        "clip",
        "sigma: copy / points / exact bones",
        "contact error: copy / exact bones / contact",
        "direction error, degrees: copy / exact bones / contact",
        "jerk over copy's: exact bones / contact",
        "slide: source / copy / exact bones / contact",
    )
    return table(head, ([clip, *motion_cells(row)] for clip, row in rows))


def motion_cells(row: MotionRow) -> list[str]:
    """A line of the table of motions without its clip; sigma in 10^-3 m^2."""
    return [
        several([1e3 * sigma for sigma in row.sigma], ".1f"),
        several(row.contact_error, ".3f"),
        several(row.direction_error, ".1f"),
        several(row.jerk, ".1f"),
        several(row.slide, ".2f"),
    ]


def solving_table(rows: Iterable[tuple[str, MotionRow]]) -> str:
    """Whole motions: how they are solved."""
    head = (
        "clip",
        "iterations a frame: points / exact bones / contact",
        "not converged, %",
        "points mirrored, %: from the copy / from the frame before",
    )
    return table(head, ([clip, *solving_cells(row)] for clip, row in rows))


def solving_cells(row: MotionRow) -> list[str]:
    """A line of the table of solving without its clip."""
    return [
        several(row.iterations, ".0f"),
        several([100 * share for share in row.unsolved], ".1f"),
        several([100 * share for share in row.mirrored], ".0f"),
    ]


def several(values: Iterable[float], form: str) -> str:
    """Numbers in one cell."""
    return " / ".join(f"{value:{form}}" for value in values)


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    head = list(head)
    lines = [head, ["---"] * len(head), *map(list, rows)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
