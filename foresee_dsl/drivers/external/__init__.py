"""The driver `external`: a program in any language that exchanges JSON lines over its standard input and output.

docs/reference/external.md describes the protocol. The program is started at `reset` and ended at `close`, so that
no state of one run can reach the next; a program that declares `stays` is kept for the next run (`drivers.kept`).
Messages have the fields of the protocol's dataclasses, so that a new field is sent without a change here.
"""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import shutil
import weakref
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.deadlines import RESET_VARIABLE, STEP_VARIABLE, seconds_of
from foresee_dsl.drivers.external.process import Program
from foresee_dsl.drivers.kept import leave, take
from foresee_dsl.drivers.parts import ALWAYS, DriverPart, Truth
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Trajectory, VehicleLimits
from foresee_dsl.errors import DriverError, DriverLateError
from foresee_dsl.measuring import Part

STEP_DEADLINE_S = 1.0
"""Limit of the wall time of an answer, s, unless FORESEE_STEP_DEADLINE_S is set. Ours: twenty times real time, so that
a busy machine does not change a verdict."""
RESET_DEADLINE_S = 10.0
"""Limit of the wall time from the start of the program to its first line, s, unless FORESEE_RESET_DEADLINE_S is set.
Ours: an interpreter that imports a framework for learned models takes some seconds."""
T = TypeVar("T")
USAGE = 'write external:COMMAND, such as --driver "external:python3 my_driver.py"'
PROTOCOL_VERSION = 1
LONGEST_ARRAY = 20_000
"""Largest number of elements of an array that is sent to the program. Larger arrays, and all arrays of three or more
dimensions, are pictures, which are not sent. Ours: above a centreline of 10,000 points, below a raster of 150 by 150
pixels."""
SHOWN = 80
"""Maximum number of characters of an invalid answer that a message quotes. Ours."""
FUTURE_S: NDArray[np.float64] = np.arange(1, 21, dtype=np.float64) * 0.2
"""Times from now for which an actor's future is sent for an ideal prediction, s. Ours: 4 s, the horizon of `pdm`."""
MAP = "map"
"""Word in `wants` of a program's first line: it wants the road map before the first step."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}")
_LEFT_OUT = object()


class ExternalDriver:
    """Any program over stdio, one JSON line a step: --driver "external:python3 my_driver.py"."""

    name = "external"
    version = "1"

    def __init__(self, command_line: str) -> None:
        """Check a command line and split it into words as a shell does. Nothing is started yet, and no shell is ever
        used.

        Raises:
            DriverError: the command line is empty or cannot be split, there is no such program, or the setting of a
                deadline is not a time.
        """
        if os.name != "posix":
            raise DriverError("external drivers need process groups, which this system does not have")
        self._command = _split(command_line)
        self.step_deadline_s = seconds_of(STEP_VARIABLE, STEP_DEADLINE_S)
        self._reset_s = seconds_of(RESET_VARIABLE, RESET_DEADLINE_S)
        self._program: Program | None = None
        self._stays = False
        self._trajectory: Trajectory | None = None
        self._last_resort: weakref.finalize[[], ExternalDriver] | None = None
        # As a mutant's file records it (`registry.recorded_driver`): texts of the language have no double quotes.
        self.name = f"external:{shlex.join(self._command)}".replace('"', "%22")
        self.version = ""  # read from the program's first line when the program has started
        self.parts: tuple[DriverPart, ...] = tuple(DriverPart)
        """The parts that can be replaced by ideal ones: any, until the program's first line declares them."""
        self._ideal: frozenset[DriverPart] = frozenset()
        self._truth: Truth | None = None

    @classmethod
    def from_argument(cls, argument: str) -> ExternalDriver:
        """Create the driver of the address `external:ARGUMENT`."""
        return cls(argument)

    def idealise(self, ideal: frozenset[DriverPart], truth: Truth) -> None:
        """Send the program the truth for these parts from the next `reset` on."""
        self._ideal, self._truth = ideal, truth

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Start the program, unless it has stayed since the previous run, and send it the mission, and the road map if
        it wants that.

        Sets `version` to its name and version.
        """
        self.close()
        stayed = take(self._key)
        if stayed is not None and not stayed.waits:
            stayed.kill()
            stayed = None
        self._program = stayed if stayed is not None else Program(self._command)
        self._last_resort = weakref.finalize(self, self._program.kill)
        ready = self._exchange(reset_line(mission, vehicle, seed, self._ideal), self._reset_s, read_ready)
        if MAP in ready.wants:
            ready = self._exchange(map_line(mission), self._reset_s, read_ready)
        self.version, self._stays, self.parts = f"{ready.name} {ready.version}", ready.stays, ready.parts

    def step(self, observation: Observation) -> Control | Trajectory:
        """Send one observation and return the program's answer; for `keep` its last trajectory, the same object."""
        read = partial(read_answer, last=self._trajectory)
        answer = self._exchange(step_line(observation, self._truth_now()), self.step_deadline_s, read)
        if isinstance(answer, Trajectory):
            self._trajectory = answer
        return answer

    def close(self) -> None:
        """Send the program the end of the run, and end it unless it stays for the next run."""
        if self._program is not None and self._stays and self._program.stays(end_line()):
            if (other := take(self._key)) is not None:
                other.kill()
            leave(self._key, self._program)
        elif self._program is not None:
            self._program.end(end_line())
        self._forget()

    def _truth_now(self) -> dict[str, object] | None:
        """Return the truth of this step for the ideal parts; None if no part is ideal."""
        truth = self._truth
        if truth is None or not self._ideal:
            return None
        actors: list[object] = []
        for actor in truth.actors():
            entry = plain(actor)
            if DriverPart.PREDICTION in self._ideal and actor.tracks:
                entry["future"] = plain(truth.future(actor.tracks[-1], FUTURE_S))
            actors.append(entry)
        return {"actors": actors, "signals": truth.signals()}

    @property
    def _key(self) -> tuple[str, ...]:
        return "external", str(Path.cwd()), *self._command

    def _exchange(self, line: bytes, deadline_s: float, read: Callable[[bytes], T]) -> T:
        """Send a line and return `read` of the answer.

        A program that breaks the protocol is ended, and the error names it.
        """
        if self._program is None:
            raise DriverError("an external driver was stepped before reset, or after it broke")
        try:
            return read(self._program.exchange(line, deadline_s))
        except BaseException as err:
            # The program is killed on Ctrl-C too, because an answer that comes later would be taken for that to the
            # next line.
            self._program.kill()
            self._forget()
            if isinstance(err, DriverLateError):
                raise DriverLateError(f"{shlex.join(self._command)}: {err}", err.deadline_s) from err
            if isinstance(err, DriverError):
                raise DriverError(f"{shlex.join(self._command)}: {err}") from err
            raise

    def _forget(self) -> None:
        if self._last_resort is not None:
            self._last_resort.detach()
        self._program = self._last_resort = self._trajectory = None
        self._stays = False


def _split(command_line: str) -> list[str]:
    try:
        command = shlex.split(command_line)
    except ValueError as err:
        raise DriverError(f"external:{command_line} cannot be split into words: {err}".rstrip(".")) from None
    if not command:
        raise DriverError(f"external names no program; {USAGE}")
    if shutil.which(command[0]) is None:
        raise DriverError(
            f"external:{command_line}: there is no program {command[0]!r} in the search path or in {Path.cwd()}"
        )
    return command


# --- messages -----------------------------------------------------------------------------------------------------


@Part.PIPE.measured
def reset_line(
    mission: Mission, vehicle: VehicleLimits, seed: int, ideal: frozenset[DriverPart] = frozenset()
) -> bytes:
    """Return the first line of a run; `ideal`: the parts of the program for which it gets the truth."""
    ideal_key = {"ideal": [str(part) for part in DriverPart if part in ideal]} if ideal else {}
    first = {"foresee": PROTOCOL_VERSION, "type": "reset", "mission": mission, "vehicle": vehicle, "seed": seed}
    return _line({**first, **ideal_key})


@Part.PIPE.measured
def step_line(observation: Observation, truth: dict[str, object] | None = None) -> bytes:
    """Return the line of one step; `truth`: for ideal parts."""
    return _line({"type": "step", "observation": observation, **({"truth": truth} if truth is not None else {})})


@Part.PIPE.measured
def map_line(mission: Mission) -> bytes:
    """Return the line with the road map of a mission; `null` if the mission has none."""
    road_map = mission.road_map
    document = road_map.as_document() if road_map is not None else None
    return json.dumps({"type": "map", "map": document}, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def end_line() -> bytes:
    """Return the last line of a run."""
    return _line({"type": "end"})


class Ready(NamedTuple):
    """The content of the program's first line of a run.

    `stays`: whether the program takes another `reset` after the `end` of a run. `parts`: the parts for which it can
    take the truth, with those that every driver has. `wants`: what else the program wants to get before the first step.
    """

    name: str
    version: str
    stays: bool = False
    parts: tuple[DriverPart, ...] = ALWAYS
    wants: tuple[str, ...] = ()


def read_ready(line: bytes) -> Ready:
    """Return the content of the program's first line of a run."""
    answer = _object(line)
    if answer.get("type") != "ready":
        raise DriverError(f'its first line must be {{"type": "ready", ...}}, not {_readable(line)}')
    stays = answer.get("stays", False)
    if not isinstance(stays, bool):
        raise DriverError(f"its `stays` must be true or false, not {stays!r:.80}")
    return Ready(_name(answer, "name"), _name(answer, "version"), stays, _parts(answer), _wants(answer))


@Part.PIPE.measured
def read_answer(line: bytes, last: Trajectory | None = None) -> Control | Trajectory:
    """Return the control or the trajectory in a program's answer; the simulator clips values of a control that are out
    of range.

    Args:
        line: the program's line. last: its last trajectory, with which `keep` goes on.
    """
    answer = _object(line)
    if "trajectory" in answer:
        return _trajectory(answer["trajectory"])
    if "keep" in answer:
        if answer["keep"] is not True:
            raise DriverError(f"its `keep` must be true: {_readable(line)}")
        if last is None:
            raise DriverError("it answered `keep`, but it has not answered a trajectory in this run")
        return last
    return Control(*(_number(answer, key, line) for key in ("steer", "throttle", "brake")))


def _trajectory(answer: object) -> Trajectory:
    """Return a program's trajectory; the simulator checks its values (`drivers.following`)."""
    if not isinstance(answer, dict):
        raise DriverError(f"its trajectory must be an object with lists, not {answer!r:.80}")
    x, y = (_column(answer, key) for key in ("x", "y"))
    if len(x) != len(y):
        raise DriverError(f"its trajectory has {len(x)} numbers in `x` and {len(y)} in `y`")
    heading, speed = (_column(answer, key) if answer.get(key) is not None else None
                      for key in ("heading_rad", "speed_mps"))  # fmt: skip
    return Trajectory(_column(answer, "time_s"), np.column_stack([x, y]), heading, speed)


def _column(trajectory: dict[str, Any], key: str) -> NDArray[np.float64]:
    values = trajectory.get(key)
    if not isinstance(values, list) or any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in values):
        raise DriverError(f"`{key}` of its trajectory must be a list of numbers, not {values!r:.80}")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError as err:
        raise DriverError(f"`{key}` of its trajectory has a number that is too large") from err


def plain(value: object) -> Any:  # noqa: ANN401  a JSON value
    """Return a value as dicts, lists, texts, finite numbers, booleans and None, without the parts that JSON cannot
    express.

    Dataclasses become objects with a key for each field, arrays become lists, and numbers that are not finite become
    None.
    """
    result = _plain(value)
    return None if result is _LEFT_OUT else result


def _plain(value: object) -> object:  # noqa: PLR0911  one return a kind
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, (tuple, list)):
        return [v for v in map(_plain, value) if v is not _LEFT_OUT]
    if isinstance(value, dict):
        return {key: v for key, v in ((str(k), _plain(v)) for k, v in value.items()) if v is not _LEFT_OUT}
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, np.ndarray):
        if value.ndim > 2 or value.size > LONGEST_ARRAY:
            return _LEFT_OUT
        return _plain(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return _plain({name: getattr(value, name) for name in _names(type(value))})
    return _LEFT_OUT


@lru_cache(maxsize=256)
def _names(cls: type) -> tuple[str, ...]:
    return tuple(f.name for f in fields(cls))


def _line(message: dict[str, object]) -> bytes:
    return json.dumps(plain(message), allow_nan=False, separators=(",", ":")).encode() + b"\n"


def _object(line: bytes) -> dict[str, Any]:
    try:
        answer = json.loads(line.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as err:  # ValueError: not UTF-8, not JSON, or a number with too many digits
        raise DriverError(f"its line is not JSON: {_readable(line)}") from err
    if not isinstance(answer, dict):
        raise DriverError(f"its line is not a JSON object: {_readable(line)}")
    return answer


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not JSON")


def _number(answer: dict[str, Any], key: str, line: bytes) -> float:
    if key not in answer:
        raise DriverError(f"its answer has no {key}: {_readable(line)}")
    value = answer[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DriverError(f"its {key} is not a number: {_readable(line)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DriverError(f"its {key} is not finite: {_readable(line)}")
    return number


def _name(answer: dict[str, Any], key: str) -> str:
    value = answer.get(key)
    if not isinstance(value, str) or not _NAME.fullmatch(value):
        raise DriverError(f"its {key} must be a text of letters, digits and . _ + - (64 at most), not {value!r:.80}")
    return value


def _parts(answer: dict[str, Any]) -> tuple[DriverPart, ...]:
    declared = answer.get("parts", [])
    names = [str(part) for part in DriverPart]
    if not isinstance(declared, list) or any(part not in names for part in declared):
        raise DriverError(f"its `parts` must be a list of {', '.join(names)}, not {declared!r:.80}")
    return tuple(part for part in DriverPart if part in declared or part in ALWAYS)


def _wants(answer: dict[str, Any]) -> tuple[str, ...]:
    wants = answer.get("wants", [])
    if not isinstance(wants, list) or any(word != MAP for word in wants):
        raise DriverError(f'its `wants` must be a list that may hold "{MAP}", not {wants!r:.80}')
    return tuple(wants)


def _readable(line: bytes) -> str:
    text = line.decode("utf-8", errors="replace").strip()
    return repr(text if len(text) <= SHOWN else text[:SHOWN] + "...")
