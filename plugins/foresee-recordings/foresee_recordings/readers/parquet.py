"""Tables in Parquet files, read in batches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from foresee_recordings.readers.tables import listed
from foresee_recordings.recording import RecordingError
from foresee_recordings.sources import opened

_BATCH_ROWS = 10_000
"""Number of rows that are in memory at once. Ours."""


def rows_of(path: Path, texts: Sequence[str], numbers: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a Parquet file: the texts of some columns (str), then the numbers of others (NaN if empty).

    Raises:
        RecordingError: the file is not Parquet, is larger than the limit `file` allows, has not these columns, or the
            package pyarrow is not installed.
    """
    pyarrow, parquet = _pyarrow()
    with opened(path, "file") as file:
        try:
            source = parquet.ParquetFile(file, pre_buffer=False)
            _check_columns(path, source.schema_arrow, texts, numbers, pyarrow.types)
            for batch in source.iter_batches(_BATCH_ROWS, columns=[*texts, *numbers]):
                words = [["" if v is None else str(v) for v in batch.column(name).to_pylist()] for name in texts]
                values = [
                    [math.nan if value is None else value for value in batch.column(name).to_pylist()]
                    for name in numbers
                ]
                yield from zip(*words, *values, strict=True)
        except (pyarrow.ArrowException, OSError) as err:
            raise RecordingError(f"{path} is not a Parquet file, or a damaged one: {err}") from err


def _check_columns(path: Path, schema: Any, texts: Sequence[str], numbers: Sequence[str], types: Any) -> None:  # noqa: ANN401
    missing = [name for name in (*texts, *numbers) if name not in schema.names]
    if missing:
        raise RecordingError(f"{path} has no column {', '.join(missing)}; its columns are {listed(schema.names)}")
    for name in numbers:
        type_ = schema.field(name).type
        if not (types.is_integer(type_) or types.is_floating(type_) or types.is_null(type_)):
            raise RecordingError(f"{path}: the values of column {name} are {type_}, not numbers")


def columns_of(path: Path) -> list[str]:
    """Return the names of a Parquet file's columns; raises as `rows_of`."""
    return list(_schema_of(path).names)


def metadata_of(path: Path) -> dict[bytes, bytes]:
    """Return the metadata of a Parquet file's table; raises as `rows_of`."""
    return dict(_schema_of(path).metadata or {})


def _schema_of(path: Path) -> Any:  # noqa: ANN401  pyarrow has no types
    pyarrow, parquet = _pyarrow()
    with opened(path, "file") as file:
        try:
            return parquet.ParquetFile(file).schema_arrow
        except (pyarrow.ArrowException, OSError) as err:
            raise RecordingError(f"{path} is not a Parquet file, or a damaged one: {err}") from err


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ModuleNotFoundError:
        raise RecordingError(
            "Parquet files need the package pyarrow: pip install 'foresee-recordings[parquet]'"
        ) from None
    return pa, parquet
