"""Repeat the paper's experiment: write the tables of docs/paper.md and draw its pictures.

    python benchmarks/paper.py

Takes half a minute. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paper_tables import tables
from tables import insert

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tools"))
from paper_pictures import draw_pictures  # noqa: E402


def main() -> None:
    """Write the page's tables, and draw its pictures."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    insert(ROOT / "docs" / "paper.md", tables())
    draw_pictures(ROOT / "docs" / "pictures")


if __name__ == "__main__":
    main()
