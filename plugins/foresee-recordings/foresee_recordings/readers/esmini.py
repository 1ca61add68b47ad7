"""esmini's log (`--csv_logger FILE`): a row for each time, with a group of columns for each entity.

Positions are those of the reference point, the middle of the rear axle of a vehicle (OpenSCENARIO XML). Older versions
write no bounding boxes.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from foresee_recordings.readers.classes import Shape, kind_by_size, kind_of, shape_of, usual_shape
from foresee_recordings.readers.samples import Samples
from foresee_recordings.readers.tables import lines
from foresee_recordings.reading import Request
from foresee_recordings.recording import Recording, RecordingError
from foresee_recordings.sources import as_text, opened

_HEADER_LINES = 50
"""Number of lines in which the names of the columns are expected. Ours: esmini writes six lines before them."""
_COLUMN = re.compile(r"#(\d+)\s+(\w+)")
_CENTRE_M = 1.4
"""Distance from the rear axle to the centre of a car, m: as in esmini's VehicleCatalog.xosc."""
_NEEDED = ("entity_name", "entity_id", "current_speed", "world_position_x", "world_position_y", "world_heading_angle")


@dataclass(frozen=True)
class _Entity:
    """The columns of one entity, by the names without units in lower case, and its size if the log has it."""

    columns: Mapping[str, int]

    def value(self, row: Sequence[str], name: str) -> float:
        return float(row[self.columns[name]])


class EsminiReader:
    """esmini's log."""

    what: ClassVar[str] = "esmini's log (--csv_logger)"
    numbers: ClassVar[tuple[str, ...]] = ()

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file has the names of esmini's log."""
        return b"World_Position_X" in head and b"TimeStamp" in head

    def read(self, request: Request) -> Recording:
        """Read the rows of the request."""
        samples = Samples(request)
        shapes: dict[str, Shape] = {}
        centres: dict[str, tuple[float, float]] = {}
        with opened(request.path) as file, as_text(file) as text:
            stream = lines(request.path, text)
            time, entities, count = _header(request.path, stream)
            for number, row in enumerate(csv.reader(stream), start=count + 1):
                if not any(cell.strip() for cell in row):
                    continue
                try:
                    time_s = float(row[time])
                    for entity in entities:
                        _add(samples, shapes, centres, entity, row, time_s)
                except IndexError:
                    samples.left_out["rows that are cut off"] += 1
                except ValueError as err:
                    raise RecordingError(f"{request.path}:{number}: a value is not a number ({err})") from None
        _note(samples, shapes)
        return samples.recording("esmini", shapes, offset_m=lambda actor, _: centres[actor])


def _header(path: Path, stream: Iterator[str]) -> tuple[int, list[_Entity], int]:
    """Return the column of times, those of the entities, and the number of the line with their names."""
    for count, line in zip(range(1, _HEADER_LINES + 1), stream, strict=False):
        names = [name.strip() for name in line.split(",")]
        time = next((k for k, name in enumerate(names) if name.startswith("TimeStamp")), None)
        if time is None:
            continue
        groups: dict[int, dict[str, int]] = {}
        for k, name in enumerate(names):
            if match := _COLUMN.match(name):
                column = match[2].lower().replace("entitity", "entity")  # as older versions write it
                groups.setdefault(int(match[1]), {})[column] = k
        missing = [f"#{group} {name}" for group, columns in groups.items() for name in _NEEDED if name not in columns]
        if not groups or missing:
            raise RecordingError(
                f"{path}:{count}: esmini's log has no column {', '.join(missing[:3]) or '#1 Entity_Name'}"
            )
        return time, [_Entity(columns) for columns in groups.values()], count
    raise RecordingError(
        f"{path}: no line has the names of the columns of esmini's log, which begin with Index, TimeStamp"
    )


def _add(
    samples: Samples,
    shapes: dict[str, Shape],
    centres: dict[str, tuple[float, float]],
    entity: _Entity,
    row: Sequence[str],
    time_s: float,
) -> None:
    name = row[entity.columns["entity_name"]].strip()
    actor = name or row[entity.columns["entity_id"]].strip()
    if not samples.wants(actor, time_s):
        return
    x, y = entity.value(row, "world_position_x"), entity.value(row, "world_position_y")
    heading, speed = entity.value(row, "world_heading_angle"), entity.value(row, "current_speed")
    if not samples.add(actor, time_s, x, y, heading, speed) or actor in shapes:
        return
    if "bb_length" in entity.columns:
        length_m, width_m = entity.value(row, "bb_length"), entity.value(row, "bb_width")
        shapes[actor] = shape_of(kind_of(name) or kind_by_size(length_m, width_m), length_m, width_m)
        centres[actor] = entity.value(row, "bb_x"), entity.value(row, "bb_y")
    else:
        shapes[actor] = usual_shape(kind_of(name) or "car")
        centres[actor] = (0.0 if shapes[actor].kind in ("pedestrian", "bicycle") else _CENTRE_M), 0.0


def _note(samples: Samples, shapes: Mapping[str, Shape]) -> None:
    kinds = Counter(shape.kind for shape in shapes.values())
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    samples.note(f"The log has no classes: those of the entities' names or sizes are used ({counts}).")
    if any(not shape.sized for shape in shapes.values()):
        samples.note(
            f"The log has no sizes: usual ones are used, and the centre is {_CENTRE_M:g} m ahead of the rear axle, as "
            "in esmini's catalogue of vehicles."
        )
