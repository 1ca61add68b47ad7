"""Positions in files of recordings, read without the readers that are measured: one short function for each format."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path

from defusedxml.ElementTree import parse

Sample = tuple[str, float, float, float]
"""Id of the actor, time, s, and the footprint's centre as the file has it, m."""


def commonroad(file: Path) -> Iterator[Sample]:
    """Yield the positions of all obstacles with shapes around their position (others have no such numbers)."""
    root = parse(file).getroot()
    step_s = float(root.get("timeStepSize"))
    for obstacle in [*root.iter("obstacle"), *root.iter("dynamicObstacle"), *root.iter("staticObstacle")]:
        x0, y0 = (float(obstacle.findtext(f"shape/rectangle/center/{axis}", "0")) for axis in "xy")
        for state in [obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")]:
            x, y = state.findtext("position/point/x"), state.findtext("position/point/y")
            time = state.findtext("time/exact")
            if x is None or time is None:
                continue
            turn = float(state.findtext("orientation/exact", "0"))
            ahead, left = x0 * math.cos(turn) - y0 * math.sin(turn), x0 * math.sin(turn) + y0 * math.cos(turn)
            yield obstacle.get("id"), float(time) * step_s, float(x) + ahead, float(y) + left


def interaction(file: Path) -> Iterator[Sample]:
    """Yield the positions of a table and of the pedestrians' table beside it."""
    pedestrians = file.with_name(file.name.replace("vehicle_", "pedestrian_"))
    for table in {file, pedestrians}:
        if table.exists():
            with table.open(newline="", encoding="utf-8") as text:
                for row in csv.DictReader(text):
                    yield row["track_id"], float(row["timestamp_ms"]) / 1000, float(row["x"]), float(row["y"])


def fcd(file: Path) -> Iterator[Sample]:
    """Yield the positions of SUMO's vehicles, which are those of their front, and of its pedestrians.

    SUMO's angle is in degrees, clockwise from north. The length of a vehicle is not in the file: the front is yielded.
    """
    for step in parse(file).getroot().iter("timestep"):
        for actor in step:
            yield actor.get("id"), float(step.get("time")), float(actor.get("x")), float(actor.get("y"))


def levelx(file: Path) -> Iterator[Sample]:
    """Yield the centres of inD, rounD and exiD."""
    with file.with_name(file.name.replace("_tracks", "_recordingMeta")).open(newline="", encoding="utf-8") as text:
        rate_hz = float(next(csv.DictReader(text))["frameRate"])
    with file.open(newline="", encoding="utf-8") as text:
        for row in csv.DictReader(text):
            yield row["trackId"], float(row["frame"]) / rate_hz, float(row["xCenter"]), float(row["yCenter"])


def argoverse(file: Path) -> Iterator[Sample]:
    """Yield the positions of Argoverse 2, at 10 Hz."""
    from pyarrow import parquet

    columns = ["track_id", "timestep", "position_x", "position_y"]
    for row in parquet.read_table(file, columns=columns).to_pylist():
        yield row["track_id"], row["timestep"] / 10, row["position_x"], row["position_y"]


EXPECTED: dict[str, Callable[[Path], Iterator[Sample]]] = {
    "argoverse": argoverse,
    "commonroad": commonroad,
    "fcd": fcd,
    "interaction": interaction,
    "levelx": levelx,
}
"""The function for each format, by the reader's name."""
