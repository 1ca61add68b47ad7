"""The goal of a search: how near a run came to breaking one of its expectations, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from foresee_dsl.documents import or_null, rounded
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.language.model import Comparison, Condition, Expect, Quantity, Within
from foresee_dsl.language.traversal import mentioned, parts
from foresee_dsl.language.units import UNITS
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

DIGITS = 4
"""Decimals of a margin in a trace. Ours: as many as a clip's places have."""
USUAL_SCALES = {"length": 2.0, "time": 1.5}
"""Margin with which a run counts as far from the bound, if the bound is 0 or there is none, in SI units. Ours: the
distance and the time to collision below which a pass counts as a near miss (`campaign.allocation.draws`)."""
OTHER_SCALE = 5.0
"""The same for all other dimensions. Ours: 5 m/s, or 5 m/s^2 of braking, which is an emergency manoeuvre in UN
Regulation 157."""


@dataclass(frozen=True)
class GoalMargin:
    """How near a run came to breaking the expectation that a campaign searches.

    Attributes:
        name: the expectation's label. held: whether it held.
        margin: its smallest margin over the run, in `unit`: negative if it was broken; None without a number.
        unit: as its author wrote it. time_s: time of that margin; None without a number.
        nearness: 0 (the margin is as large as the bound itself, or larger) to 1 (the bound is reached).
    """

    name: str
    held: bool
    margin: float | None = None
    unit: str = ""
    time_s: float | None = None
    nearness: float = 0.0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "held": self.held,
            "margin": rounded(self.margin, DIGITS),
            "unit": or_null(self.unit),
            "time_s": rounded(self.time_s, 2),
        }


@dataclass(frozen=True, eq=False)
class GoalSeries:
    """The margin of an expectation at every frame of a run.

    Attributes:
        name: its label. unit: unit of the margins, as its author wrote it.
        scale: margin in that unit that counts as far from the bound.
        actors: the actors that the expectation names, without the ego.
        margins: [T], in `unit`; NaN where the expectation has no number.
    """

    name: str
    unit: str
    scale: float
    actors: tuple[str, ...]
    margins: FloatArray

    @classmethod
    def of(cls, expect: Expect, dimension: str, unit: str, margins_si: Sequence[float]) -> Self:
        """Return the series of an expectation; `margins_si`: its margins in SI units."""
        to_si = UNITS[unit].to_si if unit else 1.0
        scale = scale_of(expect.condition, dimension) / to_si
        actors = tuple(sorted(mentioned(expect.condition) - {"ego"}))
        return cls(expect.name or "", unit, scale, actors, np.asarray(margins_si, dtype=np.float64) / to_si)

    @classmethod
    def in_meta(cls, meta: Mapping[str, Any]) -> Self | None:
        """Return the series in the metadata of a trace; None if the run had no goal."""
        data = meta.get("goal")
        if data is None:
            return None
        margins = np.array([math.nan if value is None else value for value in data["margins"]], dtype=np.float64)
        return cls(data["name"], data["unit"], data["scale"], tuple(data["actors"]), margins)

    def as_meta(self) -> dict[str, object]:
        """Return the series as it is stored in a trace's metadata."""
        margins = [round(value, DIGITS) if math.isfinite(value) else None for value in self.margins.tolist()]
        return {"name": self.name, "unit": self.unit, "scale": round(self.scale, DIGITS), "actors": list(self.actors),
                "margins": margins}  # fmt: skip

    @property
    def worst(self) -> int | None:
        """The frame of the smallest margin; None without a number."""
        finite = np.isfinite(self.margins)
        return int(np.argmin(np.where(finite, self.margins, np.inf))) if finite.any() else None

    @property
    def short(self) -> str:
        """How much is missing at the smallest margin, and when: `0.52 m at 3.20 s`; "" without a number."""
        worst = self.worst
        if worst is None:
            return ""
        return f"{-self.margins[worst]:.2f} {self.unit}".rstrip() + f" at {worst * STEP_S:.2f} s"

    def actor_in(self, trace: Trace) -> str:
        """Return the actor that the expectation names and that was nearest to the ego at the smallest margin; "" if it
        names none that is there.
        """
        worst, ids = self.worst, {info.id: k for k, info in enumerate(trace.actors)}
        columns = [ids[name] for name in self.actors if name in ids]
        if worst is None or not columns:
            return ""
        places = trace.states[worst][:, [X, Y]]
        far = np.hypot(*(places[columns] - places[0]).T)
        return "" if np.isnan(far).all() else trace.actors[columns[int(np.nanargmin(far))]].id

    def margin(self, *, held: bool) -> GoalMargin:
        """Return the smallest margin; `held`: whether the expectation held in the run."""
        worst = self.worst
        if worst is None:
            return GoalMargin(self.name, held, nearness=0.0 if held else 1.0)
        least = round(float(self.margins[worst]), 6)
        nearness = min(max(1.0 - least / self.scale, 0.0), 1.0)
        return GoalMargin(self.name, held, least, self.unit, round(worst * STEP_S, 6), nearness)


def scale_of(condition: Condition, dimension: str) -> float:
    """Return the margin that counts as far from the bound, in SI units: the largest bound of this dimension.

    A run with twice the required distance, or one that brakes not at all where hard braking is forbidden, is as far
    from breaking the expectation as its bound is from zero.
    """
    bounds = [part.right if isinstance(part, Comparison) else part.distance for part in parts(condition)
              if isinstance(part, Comparison | Within)]  # fmt: skip
    sizes = [abs(bound.si) for bound in bounds if isinstance(bound, Quantity) and bound.dimension == dimension]
    return max(sizes, default=0.0) or USUAL_SCALES.get(dimension, OTHER_SCALE)
