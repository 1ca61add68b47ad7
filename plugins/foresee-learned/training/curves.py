"""Draws a column of loss curves: `python -m training.curves FILES.csv --column waypoints --out curves.svg`."""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 320, 60, 170, 26, 30
_COLOURS = ("#1b6ca8", "#d1495b", "#3c8d53", "#8a5fbf", "#c98a1b", "#555555")


def points(file: Path, column: str) -> list[tuple[float, float]]:
    """Return the steps and values of a column, without rows that have no value."""
    with file.open(newline="") as lines:
        return [(float(row["step"]), float(row[column])) for row in csv.DictReader(lines) if row.get(column)]


def drawn(curves: dict[str, list[tuple[float, float]]], title: str) -> str:
    """Return a picture (SVG) of curves, their values on a logarithmic scale."""
    values = [value for curve in curves.values() for _, value in curve]
    steps = max(step for curve in curves.values() for step, _ in curve)
    low, high = math.log10(min(values)), math.log10(max(values))
    high = max(high, low + 0.1)

    def place(step: float, value: float) -> tuple[float, float]:
        x = LEFT + (WIDTH - LEFT - RIGHT) * step / steps
        y = TOP + (HEIGHT - TOP - BOTTOM) * (high - math.log10(value)) / (high - low)
        return round(x, 1), round(y, 1)

    levels = [10 ** (low + (high - low) * k / 4) for k in range(5)]
    lines = [
        {
            "name": name,
            "colour": _COLOURS[k % len(_COLOURS)],
            "stroke": 1.5,
            "points": " ".join(f"{x},{y}" for x, y in (place(*point) for point in curve)),
        }
        for k, (name, curve) in enumerate(curves.items())
    ]
    folder = FileSystemLoader(Path(__file__).with_name("templates"))
    environment = Environment(loader=folder, undefined=StrictUndefined, autoescape=True)
    return environment.get_template("curves.svg.jinja").render(
        width=WIDTH, height=HEIGHT, left=LEFT, right=RIGHT, top=TOP, title=title, steps=round(steps), curves=lines,
        levels=[{"y": place(0, level)[1], "label": f"{level:.3g}"} for level in levels],
    )  # fmt: skip


def main() -> None:
    """Draw loss curves that training.train wrote."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--column", default="waypoints")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    curves = {file.stem: points(file, options.column) for file in options.files}
    options.out.write_text(drawn(curves, options.column) + "\n")


if __name__ == "__main__":
    main()
