"""Write `docs/errors.md`: the messages of the program that state only the cause, and their cures from `cures.toml`.

python tools/make_errors.py
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tables import table, with_tables

from distretarget.io.files import REASONS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "distretarget"
PAGE = ROOT / "docs" / "errors.md"
TABLE = tomllib.loads((ROOT / "tools" / "cures.toml").read_text("utf-8"))
CURES, NOT_MESSAGES, USUAL = TABLE["cures"], set(TABLE["not_messages"]), set(TABLE["usual"])
GAP = "…"  # stands for the variable parts of a message
RAISING = {"refuse": 1, "error": 0, "fail": 0, "expected": 0}  # methods that raise, and the index of their text
PREFIXES = {"refuse": f"found {GAP}, expected ", "expected": "expected "}  # that these methods put before the text
HEADINGS = {  # of sections, with the beginnings of the paths of files whose messages they have
    "Reading and writing files": "io/files.py io/input_file.py io/reading.py io/motion cli/outputs.py",
    "BVH files": "io/bvh",
    "Arrays": "io/arrays.py io/smpl.py",
    "Characters: glTF, VRM, FBX": "character/ io/gltf io/vrma.py io/fbx",
    "Skeleton files and maps": "io/json io/skeleton io/map io/obj.py target.py matching/pairing.py",
    "User constraints": "contact_entries.py io/contacts objectives/constraint objectives/paper",
    "Skeletons and motions": "skeleton.py motion.py io/interop.py",
    "Retargeting": "body/ pipeline/ matching/ baseline/ measure/ objectives/",
    "Scenes": "scene/ report/scene measure/scene",
    "The command line": "cli/ batch/",
    "The studio": "studio/",
    "Installation": "numerics/compiled.py",
    "Arguments of Python functions": "checks.py numerics/",
}


@dataclass(frozen=True)
class Message:
    """A message of the program: the file that raises it, and its text with gaps."""

    file: str
    text: str

    @property
    def cure(self) -> str | None:
        """The cure from `cures.toml`; None if the message has one itself."""
        if self.text in CURES:
            return str(CURES[self.text])
        parts = (self.text.rpartition(mark) for mark in ("; ", ", expected "))
        if self.text.startswith("expected ") or any(cause and cure.strip(GAP) for cause, _, cure in parts):
            return None
        raise SystemExit(f"tools/cures.toml says nothing of {self.text!r} in {self.file}")


def messages() -> list[Message]:
    """All messages, in the order of the files and lines."""
    found = (
        Message(path.relative_to(PACKAGE).as_posix(), text)
        for path in sorted(PACKAGE.rglob("*.py"))
        for text in _texts(ast.parse(path.read_text("utf-8")))
    )
    reasons = (Message("io/files.py", text) for text in REASONS.values())
    return [message for message in dict.fromkeys([*found, *reasons]) if message.text not in NOT_MESSAGES]


def _texts(tree: ast.AST) -> Iterator[str]:
    """The texts of the errors that a module raises."""
    for node in ast.walk(tree):
        call = node.exc if isinstance(node, ast.Raise) else node.value if isinstance(node, ast.Expr) else None
        if not isinstance(call, ast.Call):
            continue
        name = ast.unparse(call.func).rpartition(".")[2]
        if isinstance(node, ast.Raise) and name.endswith(("Error", "UsageError", "BadParameter", "ClickException")):
            texts = [text for text in map(_text, call.args) if text.strip(GAP)]
            yield from texts[-1:]
        elif name in RAISING and len(call.args) > RAISING[name]:
            text = _text(call.args[RAISING[name]])
            if text.strip(GAP):
                yield PREFIXES.get(name, "") + text + (f", found {GAP}" if name == "expected" else "")


def _text(node: ast.AST) -> str:
    """The text of an expression; gaps stand for unknown parts."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(part.value if isinstance(part, ast.Constant) else GAP for part in values)
        case ast.BinOp(left=left, right=right):
            return _text(left) + _text(right)
    return GAP


def page() -> str:
    """The page: under each heading, the messages without a cure of their own, grouped by cures that are not usual."""
    left, sections = messages(), []
    for heading, files in HEADINGS.items():
        here = [message for message in left if message.file.startswith(tuple(files.split()))]
        left = [message for message in left if message not in here]
        causes: dict[str, list[str]] = {}
        for message in here:
            if message.cure not in (None, *USUAL):
                causes.setdefault(str(message.cure), []).append(message.text)
        if causes:
            rows = ([_cell("<br>".join(dict.fromkeys(texts))), _cell(cure)] for cure, texts in causes.items())
            sections.append(f"## {heading}\n\n{table(('message', 'what helps'), rows)}")
    if left:
        raise SystemExit(f"no heading for the messages of {', '.join(sorted({message.file for message in left}))}")
    return with_tables(PAGE, {"messages": "\n".join(sections)})


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("&lt;br>", "<br>")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
