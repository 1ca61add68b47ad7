"""The INTERACTION data set: tables of vehicles and pedestrians, and the lanelet2 map of their place.

Source: Zhan et al., "INTERACTION Dataset", arXiv:1910.03088, and the folder structure in the repository
interaction-dataset/interaction-dataset. The tables of its prediction challenges hold many cases in one file.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import ClassVar

from foresee_recordings.maps.roads_file import roads_of_file
from foresee_recordings.readers.classes import Shape, kind_of, shape_of, usual_shape
from foresee_recordings.readers.samples import Samples
from foresee_recordings.readers.tables import Table, number, table
from foresee_recordings.reading import Request
from foresee_recordings.recording import RecordedMap, Recording, RecordingError

_TRACKS = re.compile(r"(vehicle|pedestrian)_tracks_(\w+)\.csv")
_COLUMNS = ("track_id", "timestamp_ms", "agent_type", "x", "y", "vx", "vy")
_MAPS = "maps"


class InteractionReader:
    """The tables of the INTERACTION data set."""

    what: ClassVar[str] = "INTERACTION: vehicle_tracks_NNN.csv with pedestrian_tracks_NNN.csv, or their folder"
    numbers: ClassVar[tuple[str, ...]] = ("recording", "case")

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is such a table, or a folder has one."""
        if path.is_dir():
            return bool(_tables_in(path))
        first = head.partition(b"\n")[0].decode("utf-8", "replace").strip().split(",")
        return set(_COLUMNS) <= set(first)

    def read(self, request: Request) -> Recording:
        """Read a recording; of a folder with several, the one of `request.numbers["recording"]`.

        Of a table with several cases, the one of `request.numbers["case"]` is read.
        """
        tracks = _tracks_file(request)
        samples = Samples(request)
        shapes: dict[str, Shape] = {}
        for file in (tracks, _pedestrians(tracks)):
            if file is not None:
                with table(file) as rows:
                    _take(rows, request, samples, shapes)
        return samples.recording("interaction", shapes, source=tracks, roads=_roads(request, tracks))


def _take(rows: Table, request: Request, samples: Samples, shapes: dict[str, Shape]) -> None:
    """Add the samples of a table that the request wants."""
    actor, time, type_, x, y, vx, vy = rows.indices(*_COLUMNS)
    heading = rows.index("psi_rad") if "psi_rad" in rows.columns else None
    size = rows.indices("length", "width") if "length" in rows.columns else None
    case, wanted = _case(rows, request)
    for row in rows.rows:
        try:
            if case is not None and number(row[case]) != wanted:
                continue
            name, time_s = row[actor].removesuffix(".0"), number(row[time]) / 1000
            if not samples.wants(name, time_s):
                continue
            direction = math.nan if heading is None else number(row[heading])
            speed = math.hypot(number(row[vx]), number(row[vy]))
            samples.add(name, time_s, number(row[x]), number(row[y]), direction, speed)
            if name not in shapes:
                sides = None if size is None else (number(row[size[0]]), number(row[size[1]]))
                shapes[name] = _shape(row[type_], sides, samples)
        except ValueError as err:
            raise rows.error(f"a value is not a number ({err})") from None


def _case(rows: Table, request: Request) -> tuple[int | None, float]:
    """Return the index of the column of the case, and the wanted case; None without such a column.

    Raises:
        RecordingError: the table has cases, and the request names none.
    """
    if "case_id" not in rows.columns:
        return None, 0.0
    if "case" not in request.numbers:
        raise RecordingError(
            f"{rows.path} holds many cases (column case_id): name one with --number case=1, for example"
        )
    return rows.index("case_id"), request.numbers["case"]


def _shape(type_: str, sides: tuple[float, float] | None, samples: Samples) -> Shape:
    """Return the class and the size of an actor."""
    if "pedestrian" in type_ and "bicycle" in type_:
        samples.note("The data set does not tell pedestrians and cyclists apart: they are pedestrians.")
        return usual_shape("pedestrian")
    kind = kind_of(type_)
    if kind is None:
        samples.note(f"Actors of the type {type_[:40]!r} are cars.")
        kind = "car"
    shape = usual_shape(kind) if sides is None else shape_of(kind, *sides)
    if not shape.sized:
        samples.note(f"Actors of kind {kind} without a possible size have a usual one.")
    return shape


def _tables_in(folder: Path) -> list[Path]:
    return sorted(file for file in folder.glob("*_tracks_*.csv") if _TRACKS.fullmatch(file.name))


def _tracks_file(request: Request) -> Path:
    path = request.path
    if not path.is_dir():
        return path
    files = [file for file in _tables_in(path) if file.name.startswith("vehicle")]
    if (recording := request.numbers.get("recording")) is not None:
        files = [file for file in files if file.stem.rpartition("_")[2] == f"{round(recording):03d}"]
    if len(files) != 1:
        names = ", ".join(file.name for file in _tables_in(path)[:20]) or "none"
        has = f"no recording {recording:g}" if recording is not None and not files else "more than one recording"
        raise RecordingError(f"{path} has {has}: name one of its tables of tracks ({names})")
    return files[0]


def _pedestrians(tracks: Path) -> Path | None:
    """Return the table of pedestrians beside one of vehicles."""
    if not tracks.name.startswith("vehicle_tracks_"):
        return None
    file = tracks.with_name(tracks.name.replace("vehicle", "pedestrian", 1))
    return file if file.exists() else None


def _roads(request: Request, tracks: Path) -> RecordedMap | None:
    """Return the map in the data set's folder `maps` that has the name of the tracks' folder; None without one."""
    if request.map_file is not None:
        return None  # it is used in any case
    name = f"{tracks.resolve().parent.name}.osm"
    folders = (tracks.parent, tracks.parent / _MAPS, *(parent / _MAPS for parent in tracks.resolve().parents[1:3]))
    file = next((folder / name for folder in folders if (folder / name).is_file()), None)
    return None if file is None else roads_of_file(file)
