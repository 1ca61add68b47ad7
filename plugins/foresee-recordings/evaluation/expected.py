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
    """Yield the centres of SUMO's vehicles and pedestrians: positions are those of their fronts.

    SUMO's angle is in degrees, clockwise from north. Lengths are those of the types in the files beside it, otherwise
    5 m, as those of SUMO's usual type. Degrees are projected by pyproj, which has to be installed for such files.
    """
    to_m = None
    lengths = {}
    for types in [*file.parent.glob("*.rou*.xml"), *file.parent.glob("*.add.xml")]:
        for type_ in parse(types).getroot().iter("vType"):
            lengths[type_.get("id")] = float(type_.get("length", "5"))
    for step in parse(file).getroot().iter("timestep"):
        for actor in step:
            if to_m is None:
                to_m = _projection(file, float(actor.get("x")), float(actor.get("y")))
            half = lengths.get(actor.get("type"), 5.0) / 2
            angle = math.radians(float(actor.get("angle")))
            x, y = to_m(float(actor.get("x")), float(actor.get("y")))
            yield actor.get("id"), float(step.get("time")), x - half * math.sin(angle), y - half * math.cos(angle)


def _projection(file: Path, x: float, y: float) -> Callable[[float, float], tuple[float, float]]:
    """Return what turns positions into metres: into those of the UTM zone of the first one, if they are degrees."""
    if '<fcd-output.geo value="true"' not in file.read_text(encoding="utf-8")[:5000]:
        return lambda x, y: (x, y)
    from pyproj import Transformer

    zone = f"EPSG:{32600 + int((x + 180) // 6) + 1 + (100 if y < 0 else 0)}"
    return Transformer.from_crs("EPSG:4326", zone, always_xy=True).transform


def esmini(file: Path) -> Iterator[Sample]:
    """Yield the centres of entities in an old log of esmini: positions are 1.4 m behind them, at the rear axle."""
    rows = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines()]
    first = next(k for k, row in enumerate(rows) if row[0].startswith("Index"))
    names = [name.strip() for name in rows[first]]
    groups = [k for k, name in enumerate(names) if name.endswith("Entitity_Name [-]")]
    width = groups[1] - groups[0]
    x_, y_, turn_ = (names.index(f"#1 {name}") - groups[0] for name in (
        "World_Position_X [-]", "World_Position_Y [-]", "World_Heading_Angle [rad]"))  # fmt: skip
    for row in rows[first + 1 :]:
        if len(row) < len(names) - 1:
            continue
        for k in groups:
            part = row[k : k + width]
            turn = float(part[turn_])
            x, y = float(part[x_]) + 1.4 * math.cos(turn), float(part[y_]) + 1.4 * math.sin(turn)
            yield part[0].strip(), float(row[1]), x, y


def osi(file: Path) -> Iterator[Sample]:
    """Yield the centres of moving objects: by osi-python's reader, an MCAP file's schema, or omega-prime's columns."""
    if file.suffix == ".parquet":
        from pyarrow import parquet

        for row in parquet.read_table(file, columns=["idx", "total_nanos", "x", "y"]).to_pylist():
            yield str(row["idx"]), row["total_nanos"] / 1e9, row["x"], row["y"]
        return
    if file.suffix == ".osi":
        from osi3trace.osi_trace import OSITrace

        messages = OSITrace(str(file), "GroundTruth")
    else:
        from mcap.reader import make_reader
        from mcap_protobuf.decoder import DecoderFactory

        reader = make_reader(file.open("rb"), decoder_factories=[DecoderFactory()])
        messages = (message for schema, *_, message in reader.iter_decoded_messages() if "GroundTruth" in schema.name)
    for message in messages:
        time_s = message.timestamp.seconds + message.timestamp.nanos / 1e9
        for thing in message.moving_object:
            yield str(thing.id.value), time_s, thing.base.position.x, thing.base.position.y


def omega_table(file: Path) -> Iterator[Sample]:
    """Yield the positions of omega-prime's table of moving objects."""
    with file.open(newline="", encoding="utf-8") as text:
        for row in csv.DictReader(text):
            yield row["idx"], float(row["total_nanos"]) / 1e9, float(row["x"]), float(row["y"])


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
    "esmini": esmini,
    "fcd": fcd,
    "interaction": interaction,
    "levelx": levelx,
    "osi": osi,
    "table": omega_table,
}
"""The function for each format, by the reader's name."""
