"""The lines that foresee and an external driver exchange: values to JSON, and answers back, checked.

docs/external.md describes them for people. What is sent is read off the dataclasses of the protocol, field by field,
so that a new field appears by itself.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.errors import DriverError

PROTOCOL_VERSION = 1
LONGEST_ARRAY = 20_000
"""Ours: larger arrays (and all with three or more dimensions) are pictures and stay here; 10,000 points of a
centreline, 1 m apart, are under it, a raster of 150 by 150 pixels is not."""
SHOWN = 80
"""Ours: of a line that is no answer, so many characters are shown."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}")
_LEFT_OUT = object()


def reset_line(mission: Mission, vehicle: VehicleLimits, seed: int) -> bytes:
    """Return the first line of a run."""
    return _line({"foresee": PROTOCOL_VERSION, "type": "reset", "mission": mission, "vehicle": vehicle, "seed": seed})


def step_line(observation: Observation) -> bytes:
    """Return the line of one step."""
    return _line({"type": "step", "observation": observation})


def end_line() -> bytes:
    """Return the last line of a run."""
    return _line({"type": "end"})


def read_ready(line: bytes) -> tuple[str, str]:
    """Return the name and version that a program gives itself in its first line.

    Raises:
        DriverError: the line says something else.
    """
    answer = _object(line)
    if answer.get("type") != "ready":
        raise DriverError(f'its first line must be {{"type": "ready", ...}}, not {_shown(line)}')
    name, version = (_name(answer, key) for key in ("name", "version"))
    return name, version


def read_control(line: bytes) -> Control:
    """Return the control that a program answered; values out of range are left to the simulator, which clips them.

    Raises:
        DriverError: the line is no JSON object with the finite numbers steer, throttle and brake.
    """
    answer = _object(line)
    steer, throttle, brake = (_number(answer, key, line) for key in ("steer", "throttle", "brake"))
    return Control(steer, throttle, brake)


def plain(value: object) -> Any:  # noqa: ANN401  what JSON can say
    """Return a value as dicts, lists, texts, finite numbers, booleans and None; what JSON cannot express is left out.

    Dataclasses become objects with a key a field, arrays lists, numbers that are not finite None.
    """
    found = _plain(value)
    return None if found is _LEFT_OUT else found


def _plain(value: object) -> object:  # noqa: PLR0911  one return a kind
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, (tuple, list)):
        return [v for v in map(_plain, value) if v is not _LEFT_OUT]
    if isinstance(value, dict):
        return _object_of((str(k), _plain(v)) for k, v in value.items())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, np.ndarray):
        if value.ndim > 2 or value.size > LONGEST_ARRAY:
            return _LEFT_OUT
        return _plain(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return _object_of((name, _plain(getattr(value, name))) for name in _names(type(value)))
    return _LEFT_OUT


def _object_of(pairs: Any) -> dict[str, object]:  # noqa: ANN401  pairs of a key and anything
    return {key: value for key, value in pairs if value is not _LEFT_OUT}


@lru_cache(maxsize=256)
def _names(cls: type) -> tuple[str, ...]:
    return tuple(f.name for f in fields(cls))


def _line(message: dict[str, object]) -> bytes:
    return json.dumps(plain(message), allow_nan=False, separators=(",", ":")).encode() + b"\n"


def _object(line: bytes) -> dict[str, Any]:
    try:
        found = json.loads(line.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as err:  # ValueError: no UTF-8, no JSON, a number with too many digits
        raise DriverError(f"its line is no JSON: {_shown(line)}") from err
    if not isinstance(found, dict):
        raise DriverError(f"its line is no JSON object: {_shown(line)}")
    return found


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is no JSON")


def _number(answer: dict[str, Any], key: str, line: bytes) -> float:
    if key not in answer:
        raise DriverError(f"its answer has no {key}: {_shown(line)}")
    value = answer[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DriverError(f"its {key} is no number: {_shown(line)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DriverError(f"its {key} is not finite: {_shown(line)}")
    return number


def _name(answer: dict[str, Any], key: str) -> str:
    value = answer.get(key)
    if not isinstance(value, str) or not _NAME.fullmatch(value):
        raise DriverError(f"its {key} must be a text of letters, digits and . _ + - (64 at most), not {value!r:.80}")
    return value


def _shown(line: bytes) -> str:
    text = line.decode("utf-8", errors="replace").strip()
    return repr(text if len(text) <= SHOWN else text[:SHOWN] + "...")
