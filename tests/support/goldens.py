"""Golden files: what a test made, compared with a file beside its input, or written there with `--rewrite-goldens`.

A test takes the fixture `golden` and calls `golden(text, file)`. Values become text with `readable`.
"""

from __future__ import annotations

import dataclasses
import enum
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.trace import Trace

DECIMALS = 6
"""Digits of a number behind its point: a micrometre. More would differ between C libraries."""
_WIDTH = 120


class Golden:
    """Compares text with files, or writes the files."""

    def __init__(self, *, rewrite: bool) -> None:
        self.rewrite = rewrite

    def __call__(self, text: str, file: Path) -> None:
        """Compare `text` with what `file` holds; fail with the command that rewrites it."""
        if self.rewrite:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8", newline="\n")
        expected = file.read_text(encoding="utf-8") if file.exists() else ""
        assert text == expected, f"{file} differs; look at it with: pytest --rewrite-goldens, then git diff"


def readable(value: object, *, leave_out: frozenset[str] = frozenset()) -> str:
    """Return plain data, dataclasses and pydantic models as JSON with short values on one line.

    Args:
        value: what to write; numbers are rounded to `DECIMALS`, fields of dataclasses that have their default left out.
        leave_out: names of fields that are not written.
    """
    return _text(_plain(value, leave_out), "") + "\n"


def recorded_run(
    folder: Path, name: str = "trace", case: TestCase | None = None, *, rewrite: bool
) -> tuple[TestCase, Trace]:
    """Return a test case (the only one of `scenario.foresee` in the folder, if none is given) and its recorded run.

    The run is read from `NAME.npz`, so that what is tested does not depend on SUMO or the processor; with `rewrite` it
    is driven again with the driver idm, and written.
    """
    if case is None:
        (case,) = load_test_cases([str(folder / "scenario.foresee")])
    file = folder / f"{name}.npz"
    if rewrite:
        run_test_case(case, "idm", 0).trace.save(file)
    return case, Trace.load(file)


def _plain(value: object, leave_out: frozenset[str]) -> Any:
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, float):
        return round(value, DECIMALS) + 0.0  # no minus in front of zero
    if value is None or isinstance(value, bool | int | str):
        return value
    if hasattr(value, "model_dump"):
        return _plain(value.model_dump(mode="json", exclude_defaults=True), leave_out)
    if dataclasses.is_dataclass(value):
        shown = [f for f in dataclasses.fields(value) if f.name not in leave_out and not _is_default(f, value)]
        return {f.name: _plain(getattr(value, f.name), leave_out) for f in shown}
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(key): _plain(v, leave_out) for key, v in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(_plain(item, leave_out) for item in value)
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), leave_out)  # a numpy array
    if isinstance(value, Path):
        return value.name
    return [_plain(item, leave_out) for item in value]  # type: ignore[attr-defined]


def _is_default(field: dataclasses.Field[Any], value: object) -> bool:
    default = field.default
    return default is not dataclasses.MISSING and bool(default == getattr(value, field.name))


def _text(value: Any, indent: str) -> str:
    """Return JSON on one line if it fits, else with one item per line."""
    line = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or not value or len(indent) + len(line) < _WIDTH:
        return line
    inner = indent + "  "
    if isinstance(value, dict):
        items = [f"{json.dumps(key, ensure_ascii=False)}: {_text(item, inner)}" for key, item in value.items()]
        return "{\n" + ",\n".join(inner + item for item in items) + f"\n{indent}}}"
    return "[\n" + ",\n".join(inner + _text(item, inner) for item in value) + f"\n{indent}]"
