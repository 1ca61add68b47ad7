"""Runs every benchmark: `python -m benchmarks.run [NAME ...]`.

A benchmark is a module `bench_NAME.py` beside this one with a function `figures()` that returns (or yields) `Figure`s.
Prints one table; writes `latest.json` ({"schema": 1, "ratios": {...}}: all ratios, and what else is in `ASKED`) and
adds a line with every figure to `history.jsonl`.
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
"""Figures that are no ratios and that readers of `latest.json` look for there all the same."""
_LIBRARIES = ("foresee-dsl", "lark", "pydantic", "typer", "numpy", "libsumo")


def main(wanted: list[str]) -> int:
    """Run the benchmarks of these names (all without any); 1 when a target is missed, else 0."""
    names = sorted(file.stem.removeprefix("bench_") for file in _HERE.glob("bench_*.py"))
    unknown = sorted(set(wanted) - set(names))
    if unknown:
        Console(stderr=True).print(f"no benchmark called {unknown[0]}; there are {', '.join(names)}")
        return 2
    found: list[Figure] = []
    for name in wanted or names:
        found += importlib.import_module(f"benchmarks.bench_{name}").figures()
    Console().print(_table(found))
    _write(found, whole=not wanted)
    return 0 if all(figure.met for figure in found) else 1


def _table(found: list[Figure]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("figure")
    for heading in ("measured", "target"):
        table.add_column(heading, justify="right")
    table.add_column("met")
    table.add_column("what it says")
    for figure in found:
        unit = "" if figure.unit == "ratio" else f" {figure.unit}"
        bound = "at least" if figure.more else "at most"
        target = "" if figure.target is None else f"{bound} {figure.target:g}{unit}"
        met = "" if figure.target is None else ("yes" if figure.met else "[bold red]no[/]")
        table.add_row(figure.name, f"{figure.value:.3f}{unit}", target, met, figure.means)
    return table


def _write(found: list[Figure], *, whole: bool) -> None:
    """Write the ratios, which do not depend on the machine so much, and a line of history with everything."""
    ratios = ratios_of(found)
    latest = _HERE / "latest.json"
    if not whole and latest.exists():  # some were not run: keep theirs
        ratios = {**json.loads(latest.read_text())["ratios"], **ratios}
    latest.write_text(json.dumps({"schema": 1, "ratios": ratios}, indent=2, sort_keys=True) + "\n")
    line = {
        "when": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "machine": _machine(),
        "figures": {figure.name: round(figure.value, 4) for figure in found},
    }
    with (_HERE / "history.jsonl").open("a") as history:
        history.write(json.dumps(line, sort_keys=True) + "\n")


def ratios_of(found: list[Figure]) -> dict[str, float]:
    """Return what goes into `latest.json`, by name."""
    return {figure.name: round(figure.value, 4) for figure in found if figure.unit == "ratio" or figure.name in ASKED}


def _machine() -> dict[str, object]:
    """What the figures depend on; no names of hosts or folders."""
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
