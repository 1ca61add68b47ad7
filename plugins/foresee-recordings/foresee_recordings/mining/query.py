"""Queries: conditions of the language over recorded actors, and where they hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from foresee_dsl.errors import InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.model.conditions import MEASURED
from foresee_dsl.language.parser import parse
from foresee_dsl.language.traversal import parts
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining.conditions import HOLDS, check, names_in, truths
from foresee_recordings.mining.measures import BETWEEN, values
from foresee_recordings.mining.rows import EGO, Rows, rows_of
from foresee_recordings.mining.situation import Occurrence
from foresee_recordings.mining.traffic import IntArray, Traffic
from foresee_recordings.recording import FloatArray, RecordingError

MERGED_S = 1.0
"""A condition that holds again within this time continues the same situation, s. Ours: a reaction time."""
_END = {"length": "m", "time": "s", "speed": "mps"}
_BEFORE = "foresee 1\n\nscenario query {\n  expect never "


@dataclass(frozen=True)
class Query:
    """A condition to search for.

    Attributes:
        text: as it was written. names: the actors in it, `ego` first.
    """

    text: str
    condition: m.Condition
    names: tuple[str, ...]

    @classmethod
    def of(cls, text: str) -> Query:
        """Read a condition.

        Raises:
            RecordingError: it is not a condition, or cannot be searched for in a recording.
        """
        try:
            document = parse(f"{_BEFORE}{text}\n}}\n", "condition")
        except InputError as err:
            first = err.diagnostics[0]
            raise RecordingError(
                f"`{text}` is not a condition: {first.message}" + (f" ({first.help})" if first.help else "")
            ) from err
        expects = [item for item in getattr(document.model, "body", ()) if isinstance(item, m.Expect)]
        if len(expects) != 1 or not isinstance(document.model, m.Scenario) or len(document.model.body) != 1:
            raise RecordingError(f"`{text}` is not one condition, such as `ttc(ego, other) < 1.5 s`")
        condition = expects[0].condition
        check(condition)
        return cls(text, condition, tuple(names_in(condition)))

    def occurrences(self, traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
        """Yield where the condition holds, by ego, then by time.

        Raises:
            RecordingError: the condition is not about `ego`, or is about too many actors.
        """
        for rows in rows_of(traffic, self.names, within_m):
            held = np.flatnonzero(truths(self.condition, rows) == HOLDS)
            if len(held):
                yield from self._occurrences(rows, held)

    def _occurrences(self, rows: Rows, held: IntArray) -> Iterator[Occurrence]:
        pause = round(MERGED_S / STEP_S)
        apart = (np.diff(rows.frames[held]) > pause) | (np.diff(rows.group[held]) != 0)
        for run in np.split(held, np.flatnonzero(apart) + 1):
            inside = rows.at(run)
            others = tuple(int(inside.actors[name][0]) for name in self.names if name != EGO)
            frames = inside.frames
            moment = int(frames[self._decisive(inside)])
            ego = int(inside.actors[EGO][0])
            yield Occurrence(ego, others, int(frames[0]), int(frames[-1]), moment, self._measures(inside))

    def _measures(self, rows: Rows) -> dict[str, float]:
        """Return the worst value of each measure between actors that the condition compares, by name and unit."""
        measures: dict[str, float] = {}
        for part in parts(self.condition):
            if isinstance(part, m.Comparison) and isinstance(part.left, m.Measure) and part.left.what in BETWEEN:
                measured = values(part.left, rows)
                worst = np.nanmin(measured) if part.op[0] == "<" else np.nanmax(measured)
                measures.setdefault(f"{part.left.what}_{_END[MEASURED[part.left.what]]}", float(worst))
        return measures

    def _decisive(self, rows: Rows) -> int:
        """Return the row at which the first comparison of a measure holds by the most; the first row without one."""
        for part in parts(self.condition):
            if isinstance(part, m.Comparison) and isinstance(part.left, m.Measure) and part.left.what != "time":
                measured: FloatArray = values(part.left, rows)
                return int(np.nanargmin(measured) if part.op[0] == "<" else np.nanargmax(measured))
        return 0
