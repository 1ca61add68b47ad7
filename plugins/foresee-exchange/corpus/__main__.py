"""`python -m corpus FOLDER [--player ESMINI] [--maps FOLDER] [--csv FILE]`, from the checkout."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from rich.console import Console

from corpus import maps, scenarios
from corpus.limited import run_limited
from corpus.rows import show, write_csv
from foresee_dsl.kernels.compiling import ensure


def main() -> None:
    """Judge every file of a folder: scenarios and maps."""
    parser = argparse.ArgumentParser(prog="python -m corpus", description=main.__doc__)
    parser.add_argument("folder", type=Path, nargs="+", help="folders, or single files")
    parser.add_argument("--player", type=Path, help="esmini's program, to compare with")
    parser.add_argument("--maps", type=Path, help="a folder of the maps that scenarios name without a path")
    parser.add_argument("--csv", type=Path, help="the table as a file")
    parser.add_argument("--only", default="", help="a part of the files' names: .xosc, .xodr")
    parser.add_argument("--seconds", type=float, default=120.0, help="of one scenario, at most")
    parser.add_argument("--megabytes", type=int, default=4000, help="of one file, at most")
    options = parser.parse_args()
    settings = scenarios.Settings(options.player, options.maps)
    console = Console()
    ensure()  # machine code is made once, for all processes
    rows = []
    for file, name in _files(options.folder):
        if options.only not in name:
            continue
        if file.suffix == ".xosc":
            job, seconds = partial(scenarios.judge, file, name, settings), options.seconds
        elif maps.kind_of(file) is not None:
            job, seconds = partial(maps.judge, file, name), maps.LIMIT_S
        else:
            continue
        row = run_limited(job, name, seconds, options.megabytes)
        console.print(f"{row.seconds:6.1f} s  {row.outcome:26s} {name}", highlight=False, soft_wrap=True)
        rows.append(row)
        if options.csv is not None:
            write_csv(rows, options.csv)
    show(rows, console)


def _files(folders: list[Path]) -> list[tuple[Path, str]]:
    """Return the files with their names below their folder; catalogues, which are parts of others, are none."""
    named_files = []
    for folder in folders:
        files = [folder] if folder.is_file() else sorted(f for f in folder.rglob("*") if f.is_file())
        named_files += [(file, file.name if folder.is_file() else str(file.relative_to(folder))) for file in files]
    return [(file, name) for file, name in named_files if "catalog" not in name.lower().rpartition("/")[0]]


if __name__ == "__main__":
    main()
