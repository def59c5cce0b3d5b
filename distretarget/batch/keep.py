"""Conditions on the metrics of a clip, such as "contact_error < 0.01 and pop == 0"; a clip that fails is left out.

A condition has names of metrics, numbers, comparisons, and, or, not, and brackets; nothing else is evaluated. What was
not measured in a clip, such as the error of contacts where nothing touches, decides nothing: a comparison with it is
neither true nor false, and a clip is kept unless its condition is false. This is Kleene's logic of three values.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from distretarget.batch.record import ManifestRecord
from distretarget.errors import SettingsError, closest
from distretarget.measure.metrics import COLUMNS

LONGEST = 1000  # condition [characters]
COMPARISONS: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
NAMES = ("frames", "warnings", *COLUMNS)
FALSE, UNKNOWN, TRUE = 0.0, 0.5, 1.0  # "and" is the least of some values, "or" the largest, "not" 1 minus the value

Values = Mapping[str, float | None]


@dataclass(frozen=True)
class Condition:
    """A condition in words; a SettingsError if it is not one."""

    text: str

    def __post_init__(self) -> None:
        self._value(self._tree, dict.fromkeys(NAMES))

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise SettingsError(f"keep has {len(self.text)} characters; expected up to {LONGEST}")
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._refusal from None

    @property
    def _refusal(self) -> SettingsError:
        return SettingsError(
            f"keep is {self.text!r}; expected comparisons of metrics and numbers with and, or, not, such as "
            "'contact_error < 0.01 and pop == 0'"
        )

    def fault(self, record: ManifestRecord) -> str:
        """Return why a clip fails the condition; empty if it does not."""
        counts: dict[str, float | None] = {"frames": record["frames"], "warnings": len(record["warnings"])}
        values = {**dict.fromkeys(COLUMNS), **record["metrics"], **counts}
        faults = []
        for part in self._false_parts(self._tree, values):
            names = dict.fromkeys(_known(each.id) for each in ast.walk(part) if isinstance(each, ast.Name))
            faults.append(
                f"{', '.join(f'{name} is {values[name]:.4g}' for name in names)}, expected {ast.unparse(part)}"
            )
        return "; ".join(faults)

    def _value(self, node: ast.expr, values: Values) -> float:
        """Whether a part of the condition is `TRUE`, `FALSE` or `UNKNOWN`."""
        match node:
            case ast.BoolOp(op=op, values=parts):
                decisive = min if isinstance(op, ast.And) else max
                return decisive([self._value(part, values) for part in parts])
            case ast.UnaryOp(op=ast.Not(), operand=part):
                return TRUE - self._value(part, values)
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARISONS for op in ops):
                numbers = [self._operand(each, values) for each in (left, *others)]
                return min(
                    UNKNOWN if a is None or b is None else float(COMPARISONS[type(op)](a, b))
                    for op, (a, b) in zip(ops, pairwise(numbers), strict=True)
                )
        raise self._refusal

    def _operand(self, node: ast.expr, values: Values) -> float | None:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return value
            case ast.Name(id=name):
                if _known(name) not in NAMES:
                    raise SettingsError(f"keep has {name!r}, which is no metric; {closest(name, NAMES)}")
                return values[_known(name)]
        raise self._refusal

    def _false_parts(self, node: ast.expr, values: Values) -> Iterator[ast.expr]:
        """The parts, joined by "and", that make a part of the condition false; none if it is not."""
        if self._value(node, values) != FALSE:
            return
        if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
            for part in node.values:
                yield from self._false_parts(part, values)
        else:
            yield node


def _known(name: str) -> str:
    """The name of a metric, which may be given in the plural: pops."""
    return name if name in NAMES else name.removesuffix("s")
