"""Reproduce the paper's experiment: write the tables of docs/paper.md and draw its pictures.

    python benchmarks/paper.py [--no-pictures]

Takes about a minute. The pictures need matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paper_tables import tables
from tables import insert

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "paper.md"
PICTURES = ROOT / "docs" / "pictures"


def main() -> None:
    """Write what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--no-pictures", action="store_true", help="write the tables alone")
    arguments = parser.parse_args()
    insert(PAGE, tables())
    if not arguments.no_pictures:
        sys.path.append(str(ROOT / "tools"))
        from paper_pictures import draw_pictures

        draw_pictures(PICTURES)


if __name__ == "__main__":
    main()
