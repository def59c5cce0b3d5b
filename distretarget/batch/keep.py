"""Conditions on the metrics of a clip, such as "contact_error < 0.01 and pop == 0"; a clip that fails is left out.

A condition has names of metrics, numbers, comparisons, and, or, not, and brackets; nothing else is evaluated. What was
not measured in a clip, such as the error of contacts where nothing touches, decides nothing: a comparison with it is
neither true nor false, and a clip is kept unless its condition is false.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

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

Values = Mapping[str, float | None]


@dataclass(frozen=True)
class Condition:
    """A condition in words; a SettingsError if it is not one."""

    text: str

    def __post_init__(self) -> None:
        _check(self._tree, self.text)

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise SettingsError(f"keep has {len(self.text)} characters; expected up to {LONGEST}")
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise _refusal(self.text) from None

    def fault(self, record: ManifestRecord) -> str:
        """Return why a clip fails the condition; empty if it does not."""
        counts: dict[str, float | None] = {"frames": record["frames"], "warnings": len(record["warnings"])}
        values = {**dict.fromkeys(COLUMNS), **record["metrics"], **counts}
        if _value(self._tree, values) is not False:
            return ""
        return "; ".join(
            f"{', '.join(f'{name} is {values[name]:.4g}' for name in _names(part))}, expected {ast.unparse(part)}"
            for part in _false_parts(self._tree, values)
        )


def _refusal(text: str) -> SettingsError:
    return SettingsError(
        f"keep is {text!r}; expected comparisons of metrics and numbers with and, or, not, such as "
        "'contact_error < 0.01 and pop == 0'"
    )


def _check(node: ast.expr, text: str) -> None:
    """Raise a SettingsError unless a condition has only what it may have."""
    match node:
        case ast.BoolOp(values=parts):
            for part in parts:
                _check(part, text)
        case ast.UnaryOp(op=ast.Not(), operand=part):
            _check(part, text)
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARISONS for op in ops):
            for operand in (left, *others):
                _check_operand(operand, text)
        case _:
            raise _refusal(text)


def _check_operand(node: ast.expr, text: str) -> None:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return
        case ast.Name(id=name):
            if _known(name) not in NAMES:
                raise SettingsError(f"keep has {name!r}, which is no metric; {closest(name, NAMES)}")
        case _:
            raise _refusal(text)


def _known(name: str) -> str:
    """The name of a metric, which may be given in the plural: pops."""
    return name if name in NAMES else name.removesuffix("s")


def _value(node: ast.expr, values: Values) -> bool | None:
    """Whether a checked condition holds; None where a metric that was not measured would decide it."""
    match node:
        case ast.BoolOp(op=op, values=parts):
            found, decides = [_value(part, values) for part in parts], isinstance(op, ast.Or)
            return decides if decides in found else None if None in found else not decides
        case ast.UnaryOp(operand=part):
            found_one = _value(part, values)
            return None if found_one is None else not found_one
        case ast.Compare(left=left, ops=ops, comparators=others):
            numbers = [_operand(each, values) for each in (left, *others)]
            pairs = zip(ops, numbers, numbers[1:], strict=False)
            return _all([None if None in (a, b) else COMPARISONS[type(op)](a, b) for op, a, b in pairs])  # type: ignore[arg-type]
    raise AssertionError(node)


def _all(found: Sequence[bool | None]) -> bool | None:
    return False if False in found else None if None in found else True


def _operand(node: ast.expr, values: Values) -> float | None:
    return values[_known(node.id)] if isinstance(node, ast.Name) else float(ast.literal_eval(node))


def _false_parts(node: ast.expr, values: Values) -> Iterator[ast.expr]:
    """The parts, joined by "and", that make a condition false."""
    if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
        for part in node.values:
            if _value(part, values) is False:
                yield from _false_parts(part, values)
    else:
        yield node


def _names(node: ast.expr) -> list[str]:
    """The metrics in a part of a condition."""
    return list(dict.fromkeys(_known(each.id) for each in ast.walk(node) if isinstance(each, ast.Name)))
