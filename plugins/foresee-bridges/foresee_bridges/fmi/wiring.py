"""Which variable of an FMU gets or gives which of ours: by equal names, or by the names in a TOML file.

The TOML file is for FMUs whose variables have other names::

    fmu = "cruise.fmu"          # beside this file
    [inputs]                    # ours = the FMU's
    "route.speed_error" = "e"
    [outputs]
    "control.acceleration" = "a_cmd"
    [start]                     # values of the FMU's parameters
    k_p = 0.8
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from foresee_bridges.fmi.variables import INPUTS, OUTPUTS, PARAMETERS, SERIES
from foresee_dsl.errors import DriverError
from foresee_dsl.files import read_outside_text

_INDEX = re.compile(r"^(?P<first>\w+(?:\.\w+)?)\[(?P<number>\d+)\](?P<rest>[\w.]*)$")
STEERS, PEDALS = ("control.steering_angle", "control.steer"), ("control.throttle", "control.brake")
ACCELERATES = "control.acceleration"


class Source(NamedTuple):
    """One of our values: its name, and the index of an element of a series, from 0; None: the number or whole array."""

    name: str
    element: int | None = None


@dataclass(frozen=True)
class Names:
    """The content of a TOML file: the FMU, and its names by ours; without a file, both are empty."""

    fmu: Path
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether the FMU's variables have our names."""
        return not (self.inputs or self.outputs)


@dataclass(frozen=True)
class Wiring:
    """The variables of an FMU (as fmpy describes them) that are set before a run and at each step, and its outputs.

    Attributes:
        constants: each with the source of its value, one of `PARAMETERS`. start: each with its value.
        inputs: each with the source of its value. outputs: by our name.
    """

    constants: tuple[tuple[Any, Source], ...]
    start: tuple[tuple[Any, float], ...]
    inputs: tuple[tuple[Any, Source], ...]
    outputs: Mapping[str, Any]


def read_names(file: Path) -> Names:
    """Return the content of a TOML file with the names of an FMU's variables.

    Raises:
        DriverError: the file cannot be read, has other keys, or a value of another type.
    """
    try:
        content = tomllib.loads(read_outside_text(file))
    except (OSError, ValueError) as err:
        raise DriverError(f"{file} cannot be read: {getattr(err, 'strerror', None) or err}") from None
    unknown = content.keys() - {"fmu", "inputs", "outputs", "start"}
    tables = [content.get(key, {}) for key in ("inputs", "outputs")]
    start = content.get("start", {})
    is_sound = all(isinstance(table, dict) and all(isinstance(v, str) for v in table.values()) for table in tables)
    if unknown or not isinstance(content.get("fmu"), str) or not is_sound or not _is_numbers(start):
        raise DriverError(
            f'{file} must have fmu = "FILE.fmu", the tables [inputs] and [outputs] of names, and may have [start] with '
            f"numbers{'; unknown: ' + ', '.join(sorted(unknown)) if unknown else ''}"
        )
    return Names(file.parent / content["fmu"], tables[0], tables[1], {k: float(v) for k, v in start.items()})


def wire(variables: Iterable[Any], names: Names, title: str) -> Wiring:
    """Return the wiring of an FMU's variables.

    Args:
        variables: the variables of fmpy's model description. names: other names, if any.
        title: the driver's address, for messages.

    Raises:
        DriverError: a name is unknown, a shape does not fit, or the outputs are not enough to drive.
    """
    variables = list(variables)
    by_name = {variable.name: variable for variable in variables}
    if names.is_empty:
        settable = [v for v in variables if v.causality in ("input", "parameter")]
        sources = {v.name: source for v in settable if (source := source_of(v.name)) is not None}
        _refuse_unknown((v.name for v in settable if v.causality == "input" and v.name not in sources), title)
        outputs = {v.name: v for v in variables if v.causality == "output" and v.name in OUTPUTS}
    else:
        _refuse_unknown((ours for ours in names.inputs if source_of(ours) is None), title)
        _refuse_unknown((ours for ours in names.outputs if ours not in OUTPUTS), title, OUTPUTS)
        _refuse_missing((*names.inputs.values(), *names.outputs.values()), by_name, title)
        sources = {theirs: _checked_source(ours) for ours, theirs in names.inputs.items()}
        outputs = {ours: by_name[theirs] for ours, theirs in names.outputs.items()}
    _refuse_missing(names.start, by_name, title)
    _check_outputs(outputs, title)
    wires = [(by_name[theirs], source) for theirs, source in sources.items()]
    for variable, source in wires:
        _check_shape(variable, source, title)
    return Wiring(
        constants=tuple(w for w in wires if w[1].name in PARAMETERS),
        start=tuple((by_name[name], value) for name, value in names.start.items()),
        inputs=tuple(w for w in wires if w[1].name not in PARAMETERS),
        outputs=outputs,
    )


def source_of(name: str) -> Source | None:
    """Return the value that one of our names means (`moving_object[2].base.position.x`), or None."""
    if name in INPUTS or name in PARAMETERS or name in SERIES:
        return Source(name)
    match = _INDEX.fullmatch(name)
    if match is None or match["first"] + match["rest"] not in SERIES or int(match["number"]) < 1:
        return None
    return Source(match["first"] + match["rest"], int(match["number"]) - 1)


def _checked_source(name: str) -> Source:
    source = source_of(name)
    assert source is not None  # noqa: S101  checked by the caller
    return source


def _is_numbers(table: object) -> bool:
    return isinstance(table, dict) and all(
        isinstance(v, int | float) and not isinstance(v, bool) for v in table.values()
    )


def _refuse_unknown(names: Iterable[str], title: str, among: Iterable[str] = (*INPUTS, *SERIES, *PARAMETERS)) -> None:
    unknown = sorted(names)
    if not unknown:
        return
    close = difflib.get_close_matches(unknown[0], list(among), n=1, cutoff=0.5)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise DriverError(
        f"{title} has inputs or outputs that this tool does not know: {', '.join(unknown)}{hint} "
        "docs/guide/fmi.md lists all names, and how a TOML file gives the FMU's own"
    )


def _refuse_missing(names: Iterable[str], by_name: Mapping[str, Any], title: str) -> None:
    missing = sorted(name for name in names if name not in by_name)
    if missing:
        raise DriverError(
            f"{title}: the FMU has no variable {', '.join(missing)}; it has {', '.join(sorted(by_name)[:20])}"
        )


def _check_outputs(outputs: Mapping[str, Any], title: str) -> None:
    steers = [name for name in STEERS if name in outputs]
    pedals = [name for name in PEDALS if name in outputs]
    accelerates = ACCELERATES in outputs
    if len(steers) != 1 or (len(pedals) != len(PEDALS) and not accelerates) or (pedals and accelerates):
        raise DriverError(
            f"{title} has the outputs {', '.join(sorted(outputs)) or 'none that this tool knows'}; a driver needs one "
            f"of {' and '.join(STEERS)}, and either {ACCELERATES} or both {' and '.join(PEDALS)}"
        )


def _check_shape(variable: Any, source: Source, title: str) -> None:  # noqa: ANN401  fmpy's variable has no types
    is_array = source.name in SERIES and source.element is None
    shape = tuple(variable.shape or ())
    if (is_array and len(shape) != 1) or (not is_array and shape not in ((), (1,))):
        wanted = "an array with one dimension (FMI 3)" if is_array else "a single number"
        raise DriverError(f"{title}: {variable.name} has the shape {list(shape)}, and {source.name} is {wanted}")
    if variable.type in ("String", "Binary", "Clock"):
        raise DriverError(f"{title}: {variable.name} is of type {variable.type}, and {source.name} is a number")
