"""The data sets inD, rounD, exiD, uniD (centres, headings in degrees) and highD (boxes in an image, y downwards).

A recording is three tables: `NN_tracks.csv`, `NN_tracksMeta.csv` and `NN_recordingMeta.csv`. Sources: the pages of
levelxdata.com on the formats, and Krajewski et al., "The highD Dataset", ITSC 2018.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar

from foresee_recordings.readers.classes import Shape, kind_of, shape_of
from foresee_recordings.readers.samples import Samples
from foresee_recordings.readers.tables import Table, listed, number, table
from foresee_recordings.reading import Request
from foresee_recordings.recording import Recording, RecordingError

_TRACKS = re.compile(r"(?P<number>.*)_tracks\.csv(?P<packed>\.gz)?")
_MOVING_MPS = 1.0
"""Speed from which on a vehicle of highD, which has no headings, points in the direction of its velocity, m/s. Ours."""
Sample = tuple[float, float, float, float]


class LevelXReader:
    """The data sets of levelXdata."""

    what: ClassVar[str] = "inD, rounD, exiD, uniD, highD: NN_tracks.csv with its two Meta tables, or their folder"
    numbers: ClassVar[tuple[str, ...]] = ("recording",)

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is a table of tracks with its Meta tables beside it, or a folder has one."""
        if path.is_dir():
            return bool(_tables_in(path))
        return _TRACKS.fullmatch(path.name) is not None and _beside(path, "tracksMeta").exists()

    def read(self, request: Request) -> Recording:
        """Read a recording; of a folder with several, the one of `request.numbers["recording"]`."""
        tracks = _tracks_file(request)
        rate_hz, origin_m = _recording_meta(_beside(tracks, "recordingMeta"))
        samples = Samples(request)
        shapes, directions, unclassed = _shapes(_beside(tracks, "tracksMeta"), samples)
        with table(tracks) as rows:
            sample_of = _centres(rows) if "xCenter" in rows.columns else _boxes(rows, directions)
            frame, actor = rows.indices("frame", "trackId" if "trackId" in rows.columns else "id")
            for row in rows.rows:
                try:
                    name, time_s = row[actor], float(row[frame]) / rate_hz
                    if samples.wants(name, time_s):
                        samples.add(name, time_s, *sample_of(row))
                except ValueError as err:
                    raise rows.error(f"a value is not a number ({err})") from None
        samples.check_actors(shapes.keys() | unclassed, "tracksMeta")
        return samples.recording("levelx", shapes, source=tracks, origin_m=origin_m)


def _tables_in(folder: Path) -> list[Path]:
    """Return the tables of tracks in a folder, or in its folder `data`, with their Meta tables, by name."""
    files = [*folder.glob("*_tracks.csv*"), *(folder / "data").glob("*_tracks.csv*")]
    return sorted(file for file in files if _TRACKS.fullmatch(file.name) and _beside(file, "tracksMeta").exists())


def _beside(tracks: Path, what: str) -> Path:
    """Return the path of another table of a recording: packed, if only that exists."""
    match = _TRACKS.fullmatch(tracks.name)
    stem = match["number"] if match else tracks.stem
    plain = tracks.with_name(f"{stem}_{what}.csv")
    packed = tracks.with_name(f"{stem}_{what}.csv.gz")
    return packed if packed.exists() and not plain.exists() else plain


def _tracks_file(request: Request) -> Path:
    path = request.path
    if not path.is_dir():
        if _TRACKS.fullmatch(path.name) is None:
            raise RecordingError(f"{path}: the name of a table of tracks ends with `_tracks.csv`")
        return path
    files = _tables_in(path)
    recordings = {file: file.name.partition("_")[0] for file in files}
    if (wanted := request.numbers.get("recording")) is not None:
        files = [file for file in files if recordings[file].lstrip("0") == f"{wanted:g}".lstrip("0")]
    if len(files) != 1:
        names = listed([file.name for file in recordings], 20) or "none"
        first = next(iter(recordings.values()), "")
        advice = f"write --number recording={int(first)}, for example" if first.isdigit() else "name one of them"
        has = f"no recording {wanted:g}" if wanted is not None and not files else "more than one recording"
        raise RecordingError(f"{path} has {has}; its tables of tracks are {names}: {advice}")
    return files[0]


def _recording_meta(file: Path) -> tuple[float, tuple[float, float]]:
    """Return the frames per second, and the origin of the positions in UTM, m (highD has none: 0)."""
    with table(file) as rows:
        column = rows.index("frameRate")
        row = next(rows.rows, None)
        if row is None:
            raise RecordingError(f"{file} has no row")
        rate_hz = number(row[column]) if row[column].strip().replace(".", "").isdigit() else math.nan
        if not 0 < rate_hz < math.inf:
            raise rows.error(f"frameRate is {row[column][:40]!r}, not a number above 0")
        names = [name for name in ("xUtmOrigin", "yUtmOrigin") if name in rows.columns]
        try:
            origin = [number(row[rows.index(name)]) for name in names]
        except ValueError as err:
            raise rows.error(f"a value is not a number ({err})") from None
        return rate_hz, ((origin[0], origin[1]) if len(origin) == 2 and all(map(math.isfinite, origin)) else (0.0, 0.0))


def _shapes(file: Path, samples: Samples) -> tuple[dict[str, Shape], dict[str, float], set[str]]:
    """Return the shape of each actor, the driving direction of those of highD, rad, and the actors of unknown class."""
    shapes: dict[str, Shape] = {}
    directions: dict[str, float] = {}
    unclassed: set[str] = set()
    with table(file) as rows:
        boxes = "height" in rows.columns  # highD: `width` is along the road
        actor, class_ = rows.indices("id" if boxes else "trackId", "class")
        length, width = rows.indices(*(("width", "height") if boxes else ("length", "width")))
        direction = rows.index("drivingDirection") if boxes else None
        for row in rows.rows:
            samples.take_room()
            kind = kind_of(row[class_])
            if kind is None:
                samples.left_out["actors of an unknown class"] += 1
                unclassed.add(row[actor])
                continue
            try:
                shape = shapes[row[actor]] = shape_of(kind, number(row[length]), number(row[width]))
            except ValueError as err:
                raise rows.error(f"a value is not a number ({err})") from None
            if not shape.sized:
                samples.note(f"Actors of kind {kind} without a possible size have a usual one.")
            if direction is not None:
                directions[row[actor]] = {"1": math.pi, "2": 0.0}.get(row[direction].strip(), math.nan)
    return shapes, directions, unclassed


def _centres(rows: Table) -> Callable[[Sequence[str]], Sample]:
    """Return what makes a sample (x, y, heading, speed) of a row of inD, rounD, exiD or uniD."""
    x, y, heading = rows.indices("xCenter", "yCenter", "heading")
    vx, vy = (rows.index(name) if name in rows.columns else None for name in ("xVelocity", "yVelocity"))

    def sample(row: Sequence[str]) -> Sample:
        speed = math.nan if vx is None or vy is None else math.hypot(number(row[vx]), number(row[vy]))
        return number(row[x]), number(row[y]), math.radians(number(row[heading])), speed

    return sample


def _boxes(rows: Table, directions: dict[str, float]) -> Callable[[Sequence[str]], Sample]:
    """Return what makes a sample of a row of highD: x, y are those of the box's upper left corner, and y points
    downwards in the image, also for velocities."""
    actor, x, y, length, width, vx, vy = rows.indices("id", "x", "y", "width", "height", "xVelocity", "yVelocity")

    def sample(row: Sequence[str]) -> Sample:
        right, down = number(row[vx]), number(row[vy])
        speed = math.hypot(right, down)
        heading = math.atan2(-down, right) if speed > _MOVING_MPS else directions.get(row[actor], math.nan)
        return number(row[x]) + number(row[length]) / 2, -number(row[y]) - number(row[width]) / 2, heading, speed

    return sample
