"""Runs every benchmark: `python -m benchmarks.run [NAME ...]`.

A benchmark is a module `bench_NAME.py` beside this one with a function `figures()` that returns (or yields) `Figure`s.
Prints a table; writes `latest.json` ({"schema": 1, "ratios": {...}}: all ratios and the figures in `ASKED`) and adds a
line with all figures to `history.jsonl`.
"""

from __future__ import annotations

import importlib
import json
import os
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.figures import Figure

_HERE = Path(__file__).parent
ASKED = frozenset({"engine_ms_per_run", "resume_s"})
"""Figures other than ratios that readers of `latest.json` need."""
_LIBRARIES = ("foresee-dsl", "lark", "pydantic", "typer", "numpy", "libsumo")


def main(wanted: list[str]) -> int:
    """Run the named benchmarks (all by default); return 1 if a target is missed, 2 for an unknown name, else 0."""
    names = sorted(file.stem.removeprefix("bench_") for file in _HERE.glob("bench_*.py"))
    unknown = sorted(set(wanted) - set(names))
    if unknown:
        Console(stderr=True).print(f"no benchmark called {unknown[0]}; there are {', '.join(names)}")
        return 2
    figures: list[Figure] = []
    for name in wanted or names:
        figures += importlib.import_module(f"benchmarks.bench_{name}").figures()
    Console().print(_table(figures))
    _write(figures, whole=not wanted)
    return 0 if all(figure.met for figure in figures) else 1


def _table(figures: list[Figure]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("figure")
    for heading in ("measured", "target"):
        table.add_column(heading, justify="right")
    table.add_column("met")
    table.add_column("what it says")
    for figure in figures:
        unit = "" if figure.unit == "ratio" else f" {figure.unit}"
        bound = "at least" if figure.more else "at most"
        target = "" if figure.target is None else f"{bound} {figure.target:g}{unit}"
        met = "" if figure.target is None else ("yes" if figure.met else "[bold red]no[/]")
        table.add_row(figure.name, f"{figure.value:.3f}{unit}", target, met, figure.means)
    return table


def _write(figures: list[Figure], *, whole: bool) -> None:
    """Write the ratios, which depend less on the machine, to `latest.json`, and all figures to the history."""
    ratios = ratios_of(figures)
    latest = _HERE / "latest.json"
    if not whole and latest.exists():  # benchmarks that were not run keep their ratios
        ratios = {**json.loads(latest.read_text())["ratios"], **ratios}
    latest.write_text(json.dumps({"schema": 1, "ratios": ratios}, indent=2, sort_keys=True) + "\n")
    line = {
        "when": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "machine": _machine(),
        "figures": {figure.name: round(figure.value, 4) for figure in figures},
    }
    with (_HERE / "history.jsonl").open("a") as history:
        history.write(json.dumps(line, sort_keys=True) + "\n")


def ratios_of(figures: list[Figure]) -> dict[str, float]:
    """Return the figures for `latest.json` by name."""
    return {figure.name: round(figure.value, 4) for figure in figures if figure.unit == "ratio" or figure.name in ASKED}


def _machine() -> dict[str, object]:
    """Return the properties of the machine on which figures depend, without names of hosts or folders."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in _LIBRARIES},
    }


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
