"""Any table with a row for each sample of an actor: its columns are named by the request, or by their usual names."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from foresee_recordings.readers.classes import Shape, have, kind_of, shape_of, usual_shape
from foresee_recordings.readers.samples import Samples
from foresee_recordings.readers.tables import Table, listed, number, table
from foresee_recordings.reading import Request
from foresee_recordings.recording import Recording, RecordingError

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "time_s": ("time_s", "time", "t", "t_s", "timestamp", "timestamp_s", "time_sec", "sec", "seconds", "sim_time"),
    "time_ms": ("time_ms", "timestamp_ms", "t_ms", "ms", "millis"),
    "time_ns": ("time_ns", "timestamp_ns", "t_ns", "nanos", "total_nanos"),
    "frame": ("frame", "frame_id", "frame_number", "frame_index", "timestep", "step"),
    "actor": ("actor", "actor_id", "id", "track_id", "track", "vehicle_id", "veh_id", "object_id", "agent_id",
              "agent", "idx", "name"),
    "x_m": ("x_m", "x", "x_center", "center_x", "pos_x", "position_x", "world_x", "x_utm"),
    "y_m": ("y_m", "y", "y_center", "center_y", "pos_y", "position_y", "world_y", "y_utm"),
    "heading_rad": ("heading_rad", "yaw_rad", "psi_rad", "theta_rad", "orientation_rad"),
    "heading_deg": ("heading_deg", "yaw_deg", "psi_deg", "theta_deg", "orientation_deg"),
    "heading": ("heading", "yaw", "psi", "theta", "orientation"),
    "speed_mps": ("speed_mps", "speed", "velocity", "v_mps", "v", "vel"),
    "speed_kmh": ("speed_kmh", "velocity_kmh", "v_kmh"),
    "vx": ("vx", "vx_mps", "v_x", "x_velocity", "velocity_x", "vel_x"),
    "vy": ("vy", "vy_mps", "v_y", "y_velocity", "velocity_y", "vel_y"),
    "length_m": ("length_m", "length", "len"),
    "width_m": ("width_m", "width"),
    "kind": ("kind", "class", "class_name", "type", "agent_type", "object_type", "category", "vehicle_type"),
}  # fmt: skip
"""Our names of columns, each with the usual names in files (without case and punctuation). Angles are counter-clockwise
from east. `heading` is in degrees if any value is more than a full turn of radians."""
_PER_S: Mapping[str, float] = {"time_s": 1.0, "time_ms": 1e-3, "time_ns": 1e-9}
_TURN_RAD = 6.4
"""Headings above this are in degrees. Ours: a full turn and some rounding."""
_MOST_RAD = 8 * math.pi
"""If most headings are beyond this, they cannot be in rad. Ours: four turns, if an actor's turns are counted on."""
_KMH = 3.6


class TableReader:
    """Any table with a row for each sample."""

    what: ClassVar[str] = "any table (CSV) with a row for each sample of an actor; its columns can be named"
    numbers: ClassVar[tuple[str, ...]] = ("rate_hz",)

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether the first line has usual names for the columns of time, actor, x and y."""
        first = next((line for line in head.decode("utf-8", "replace").splitlines() if not line.startswith("#")), "")
        names = re.split(r"[,;\t]", first)
        usual = {ours for ours, theirs in COLUMNS.items() if any(_plain(name) in map(_plain, theirs) for name in names)}
        return {"actor", "x_m", "y_m"} <= usual and bool(usual & {*_PER_S, "frame"})

    def read(self, request: Request) -> Recording:
        """Read the rows of the request.

        Raises:
            RecordingError: also if a needed column is missing, or there are frames and no `request.numbers["rate_hz"]`.
        """
        samples = Samples(request)
        shapes: dict[str, Shape] = {}
        unknown: Counter[str] = Counter()
        with table(request.path) as rows:
            columns = _columns(rows, request.columns)
            time_of = _time(rows, columns, request)
            motion_of, shape_in = _motion(columns), _shape(columns, unknown)
            actor, x, y = columns["actor"], columns["x_m"], columns["y_m"]
            widest, count, far = 0.0, 0, 0
            for row in rows.rows:
                try:
                    name, time_s = row[actor].strip(), time_of(row)
                    if not samples.wants(name, time_s):
                        continue
                    heading, speed = motion_of(row)
                    count += 1
                    if math.isfinite(heading):
                        widest, far = max(widest, abs(heading)), far + (abs(heading) > _MOST_RAD)
                    if samples.add(name, time_s, number(row[x]), number(row[y]), heading, speed) and name not in shapes:
                        shapes[name] = shape_in(row)
                except ValueError as err:
                    raise rows.error(f"a value is not a number ({err})") from None
        if "heading_rad" in columns and far > count / 2:
            theirs = rows.columns[columns["heading_rad"]]
            raise RecordingError(
                f"{request.path}: the headings in {theirs!r} reach {widest:.0f}, so they are not in rad: write "
                f"--columns heading_deg={theirs} if they are in degrees"
            )
        if "heading" in columns and widest > _TURN_RAD:
            samples.heading_unit = math.pi / 180
            samples.note(f"Headings reach {widest:.0f}: they are in degrees.")
        _note(samples, shapes, unknown, has_sizes={"length_m", "width_m"} <= columns.keys())
        return samples.recording("table", shapes)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _columns(rows: Table, named: Mapping[str, str]) -> dict[str, int]:
    """Return the index of each of our columns that the table has."""
    for ours, theirs in named.items():
        if ours not in COLUMNS:
            raise RecordingError(f"there is no column {ours!r}; our names are {', '.join(COLUMNS)}")
        if theirs not in rows.columns:
            raise RecordingError(f"{rows.path} has no column {theirs!r}; its columns are {listed(rows.columns)}")
    columns = {ours: rows.columns.index(theirs) for ours, theirs in named.items()}
    plain = [_plain(name) for name in rows.columns]
    for ours, usual in COLUMNS.items():
        if ours not in columns:
            index = next((plain.index(_plain(name)) for name in usual if _plain(name) in plain), None)
            if index is not None and index not in columns.values():
                columns[ours] = index
    missing = [ours for ours in ("actor", "x_m", "y_m") if ours not in columns]
    if not columns.keys() & {*_PER_S, "frame"}:
        missing.insert(0, "time_s")
    if missing:
        raise RecordingError(
            f"{rows.path} has no column that is called like our {' and '.join(missing)}: name it with --columns "
            f"{missing[0]}=NAME,...; its columns are {listed(rows.columns)}"
        )
    return columns


def _time(rows: Table, columns: Mapping[str, int], request: Request) -> Callable[[Sequence[str]], float]:
    """Return what gives the time of a row, s: that of its frame only if there is no column of times, or a rate."""
    rate_hz = request.numbers.get("rate_hz")
    name = next((ours for ours in _PER_S if ours in columns), "frame")
    if "frame" in columns and (name == "frame" or "frame" in request.columns):
        if rate_hz is None or not 0 < rate_hz < math.inf:
            raise RecordingError(
                f"{rows.path} has frames and no times: give the frames per second, --number rate_hz=25"
            )
        name, unit_s = "frame", 1 / rate_hz
    else:
        unit_s = _PER_S[name]
    index = columns[name]
    return lambda row: float(row[index]) * unit_s


def _motion(columns: Mapping[str, int]) -> Callable[[Sequence[str]], tuple[float, float]]:
    """Return what gives heading and speed of a row; NaN for what the table has not."""
    angle, unit = _first(columns, {"heading_rad": 1.0, "heading_deg": math.pi / 180, "heading": 1.0})
    speed, factor = _first(columns, {"speed_mps": 1.0, "speed_kmh": 1 / _KMH})
    vx, vy = columns.get("vx"), columns.get("vy")

    def motion(row: Sequence[str]) -> tuple[float, float]:
        heading = math.nan if angle is None else number(row[angle]) * unit
        if speed is not None:
            return heading, number(row[speed]) * factor
        if vx is not None and vy is not None:
            return heading, math.hypot(number(row[vx]), number(row[vy]))
        return heading, math.nan

    return motion


def _first(columns: Mapping[str, int], units: Mapping[str, float]) -> tuple[int | None, float]:
    """Return the index of the first of these columns that there is, and its unit."""
    return next(((columns[name], unit) for name, unit in units.items() if name in columns), (None, 1.0))


def _shape(columns: Mapping[str, int], unknown: Counter[str]) -> Callable[[Sequence[str]], Shape]:
    """Return what gives the shape of a row's actor; it counts words of classes that are not known."""
    length, width, kind = columns.get("length_m"), columns.get("width_m"), columns.get("kind")

    def shape(row: Sequence[str]) -> Shape:
        word = "" if kind is None else row[kind].strip()
        ours = kind_of(word)
        if ours is None:
            unknown[word[:30]] += 1
            ours = "car"
        if length is None or width is None:
            return usual_shape(ours)
        return shape_of(ours, number(row[length]), number(row[width]))

    return shape


def _note(samples: Samples, shapes: Mapping[str, Shape], unknown: Counter[str], *, has_sizes: bool) -> None:
    if count := unknown.pop("", 0):
        samples.note(f"{have(count)} no class: cars are assumed.")
    if unknown:
        words = ", ".join(repr(word) for word, _ in unknown.most_common(8))
        samples.note(f"{have(sum(unknown.values()))} an unknown class ({words}): cars are assumed.")
    if unsized := sum(not shape.sized for shape in shapes.values()):
        samples.note(
            f"{have(unsized)} no {'possible size' if has_sizes else 'size'}: that which is usual for the class is used."
        )
