"""Download the real clips that the benchmarks use from where they are published (`corpus.toml`).

    python benchmarks/fetch_corpus.py FOLDER

FOLDER is then the CORPUS of the other benchmarks, and FOLDER/duets is DUETS. Existing files are kept.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from urllib.request import urlopen

import click
from tqdm import tqdm

SOURCES = Path(__file__).with_name("corpus.toml")
HOST = "https://raw.githubusercontent.com"
TIMEOUT = 60.0  # for an answer [s]


def addresses(host: str = HOST) -> Iterator[tuple[str, str]]:
    """Yield the name in the corpus of each file, and its address."""
    for source in tomllib.loads(SOURCES.read_text("utf-8"))["sources"]:
        for name, path in source["files"].items():
            yield name, f"{host}/{source['repository']}/{source['commit']}/{path}"


def fetch(address: str, path: Path) -> None:
    """Download a file, complete or not at all; an OSError if nothing answers there, or it cannot be written."""
    with urlopen(address, timeout=TIMEOUT) as answer:
        content = answer.read()
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    part.write_bytes(content)
    part.replace(path)


@click.command(help=__doc__.replace("    python", "\b\n    python"))
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option("--host", default=HOST, show_default=True, help="Where the repositories' files are served.")
def main(folder: Path, host: str) -> None:
    missing = [(name, address) for name, address in addresses(host) if not (folder / name).exists()]
    failed = []
    for name, address in tqdm(missing, unit="file", disable=None):
        try:
            fetch(address, folder / name)
        except OSError as error:
            failed.append(f"{address}: {error}")
    print(f"{len(missing) - len(failed)} files fetched into {folder}")
    if failed:
        raise click.ClickException("\n".join([f"{len(failed)} files could not be fetched:", *failed]))


if __name__ == "__main__":
    main()
