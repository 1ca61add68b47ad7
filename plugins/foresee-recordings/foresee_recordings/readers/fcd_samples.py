"""The samples in SUMO's floating car data: XML, or a table as CSV or Parquet."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.compile.nets.safe_xml import children_of
from foresee_recordings.readers.parquet import columns_of, rows_of
from foresee_recordings.readers.tables import table
from foresee_recordings.recording import RecordingError
from foresee_recordings.sources import head_of

TAGS = ("vehicle", "person")
_TIME = "timestep_time"
"""The column of times in SUMO's tables; others are called after element and attribute, such as `vehicle_x`."""
_FIELDS = ("id", "type", "x", "y", "angle", "speed")
_TEXTS = ("id", "type")


class FcdSample(NamedTuple):
    """A vehicle or person at a time, s: its attributes are texts or numbers, and those that it has not are absent."""

    time_s: float
    tag: str
    fields: Mapping[str, str | float]


def is_table(head: bytes) -> bool:
    """Return whether a file begins like one of SUMO's tables in CSV."""
    return head.startswith(_TIME.encode())


def is_parquet_table(path: Path) -> bool:
    """Return whether a Parquet file is one of SUMO's tables."""
    try:
        return _TIME in columns_of(path)
    except RecordingError:
        return False


def samples_of(path: Path, left_out: Counter[str]) -> Iterator[FcdSample]:
    """Yield all samples of a file, in its order.

    Args:
        left_out: counts elements other than vehicles and persons.

    Raises:
        RecordingError: the file is damaged.
    """
    head = head_of(path, len(_TIME))
    if head.startswith(b"PAR1"):
        return _of_parquet(path)
    return _of_csv(path) if is_table(head) else _of_xml(path, left_out)


def _of_xml(path: Path, left_out: Counter[str]) -> Iterator[FcdSample]:
    for timestep in children_of(path, "fcd-export", "SUMO's FCD output", RecordingError, limit=None):
        time_s = _number(path, timestep.get("time"))
        for element in timestep:
            if element.tag in TAGS:
                yield FcdSample(time_s, element.tag, element.attrib)
            else:
                left_out["elements other than vehicles and persons"] += 1


def _of_csv(path: Path) -> Iterator[FcdSample]:
    with table(path) as rows:
        time = rows.index(_TIME)
        columns = {
            tag: [(name, rows.index(f"{tag}_{name}")) for name in _FIELDS if f"{tag}_{name}" in rows.columns]
            for tag in TAGS
        }
        for row in rows.rows:
            time_s = _number(path, row[time])
            for tag, indices in columns.items():
                fields = {name: row[k] for name, k in indices if row[k]}
                if "id" in fields:
                    yield FcdSample(time_s, tag, fields)


def _of_parquet(path: Path) -> Iterator[FcdSample]:
    names = columns_of(path)
    wanted = [(tag, name) for tag in TAGS for name in _FIELDS if f"{tag}_{name}" in names]
    texts = [pair for pair in wanted if pair[1] in _TEXTS]
    numbers = [pair for pair in wanted if pair[1] not in _TEXTS]
    columns = ["_".join(pair) for pair in texts], [_TIME, *("_".join(pair) for pair in numbers)]
    for row in rows_of(path, *columns):
        words, time_s, values = row[: len(texts)], row[len(texts)], row[len(texts) + 1 :]
        for tag in TAGS:
            fields: dict[str, str | float] = {
                name: word for (of, name), word in zip(texts, words, strict=True) if of == tag and word
            }
            fields |= {
                name: value
                for (of, name), value in zip(numbers, values, strict=True)
                if of == tag and not math.isnan(value)
            }
            if "id" in fields:
                yield FcdSample(time_s, tag, fields)


def _number(path: Path, text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        raise RecordingError(f"{path}: the time of a timestep is {text!r:.50}, not a number") from None
