"""A run as a table: the criticality of each step with regard to one actor, and the states of all actors."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import write_whole
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.strip import opponent_of
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, criticality
from foresee_dsl.simulate.results.near_misses import times_between
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, Trace, X, Y

STATES = {"x_m": X, "y_m": Y, "heading_rad": HEADING, "speed_mps": SPEED, "acceleration_mps2": ACCELERATION}
"""Columns of a table of states, and where a trace has their values."""
_DECIMALS = 4
"""Decimals of a table: a tenth of a millimetre or of a millisecond."""


def criticality_table(trace: Trace, actor: str) -> dict[str, FloatArray]:
    """Return the criticality of the ego and an actor at each step, [T] each; the keys are names of columns with units.

    A value is NaN where a measure has none, for example without a predicted contact; the braking that is needed at a
    contact is infinite.

    Args:
        trace: the run. actor: id of the other actor.
    """
    column = trace.index(actor)
    return {
        "time_s": trace.time_s,
        "ego_speed_mps": trace.states[:, 0, SPEED],
        "other_speed_mps": trace.states[:, column, SPEED],
        "distance_m": box_distance(trace.boxes(0), trace.boxes(column)),
        **{measure.value: values for measure, values in criticality(trace, column).items()},
        "pet_s": times_between(trace, column),
    }


def write_criticality(run: ShownRun, file: Path, actor: str = "") -> str:
    """Write the criticality of a run's steps, as a table (`.csv`) or a document (`.json`); return the other actor's id.

    Args:
        run: the run. file: the file. actor: id of the other actor; "": the story's opponent, else the nearest actor.

    Raises:
        ForeseeError: the file has another ending, or the run has no such actor.
    """
    if file.suffix not in (".csv", ".json"):
        raise ForeseeError(f"{file} must end in .csv or .json")
    other = _other(run, actor)
    table = criticality_table(run.trace, other)
    rows = np.round(np.column_stack(list(table.values())), _DECIMALS).tolist()
    if file.suffix == ".csv":
        write_whole(file, _csv(("with", *table), ((other, *map(_cell, row)) for row in rows)))
        return other
    document = {
        "test_case": run.case.id,
        "driver": run.driver,
        "seed": run.seed,
        "with": other,
        "measures": {m.value: {"name": m.words, "unit": m.unit, "critical": "high" if m.sign > 0 else "low"}
                     for m in CriticalityMeasure},
        "steps": [dict(zip(table, (v if math.isfinite(v) else None for v in row), strict=True)) for row in rows],
    }  # fmt: skip
    write_whole(file, json.dumps(document, indent=1) + "\n")
    return other


def write_states(trace: Trace, file: Path) -> None:
    """Write the states of a run's actors as a table (`.csv`): a row for each step and each actor that is there.

    Raises:
        ForeseeError: the file has another ending.
    """
    if file.suffix != ".csv":
        raise ForeseeError(f"{file} must end in .csv")
    rows = []
    states = np.round(trace.states[:, :, list(STATES.values())], _DECIMALS)
    for frame, time_s in enumerate(np.round(trace.time_s, _DECIMALS).tolist()):
        rows += [(time_s, info.id, *map(_cell, states[frame, k].tolist())) for k, info in enumerate(trace.actors)
                 if not math.isnan(states[frame, k, 0])]  # fmt: skip
    write_whole(file, _csv(("time_s", "actor", *STATES), rows))


def _other(run: ShownRun, actor: str) -> str:
    others = [info.id for info in run.trace.actors[1:]]
    if actor:
        if actor in others:
            return actor
        raise ForeseeError(f"the run has no actor {actor!r} beside the ego; it has {', '.join(others) or 'none'}")
    if not others:
        raise ForeseeError(f"{run.address} has only the ego: there is nothing to measure its criticality with")
    if opponent := opponent_of(run.trace, run.story):
        return opponent
    xy = run.trace.states[:, :, [X, Y]]
    apart = np.nan_to_num(np.hypot(*np.moveaxis(xy[:, 1:] - xy[:, :1], 2, 0)), nan=np.inf)
    return others[int(apart.min(axis=0).argmin())]


def _cell(value: float) -> float | str:
    return "" if math.isnan(value) else value


def _csv(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((headings, *rows))
    return text.getvalue()
