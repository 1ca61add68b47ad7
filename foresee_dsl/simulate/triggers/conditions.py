"""Evaluates conditions against the running world, and by how much they hold.

Their definitions are those of `language.model.conditions`. Where a condition cannot be evaluated, because an actor is
not there or does not come to the junction, it has no outcome and does not hold.

By how much it holds is the robustness of signal temporal logic, kept within one dimension: the margin of a comparison
is how far its measure is from the bound, positive where it holds. `and`, `always` and `for` take the smallest, `or` and
`eventually` the largest, `not` turns the sign (Donze and Maler, "Robust Satisfaction of Temporal Logic over Real-Valued
Signals", FORMATS 2010). Metres and seconds cannot be compared: across dimensions the margin is that of what decides
whether the condition holds, of the first where several do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.kernels.boxes import overlaps
from foresee_dsl.kernels.conditions import gap
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.results.metrics import outlines_of
from foresee_dsl.simulate.triggers.ways import Ways

_Between = Literal["eta", "distance", "ttc", "ttc_along", "headway", "lateral", "overlap", "relative_speed"]


class Eyes(Protocol):
    """What sees: the ego's sensors."""

    def reports(self, actor: str) -> bool:
        """Say whether they report an actor now."""
        ...


class Sightlines(Protocol):
    """Bare lines of sight."""

    def clear(self, eye: str, actor: str) -> bool:
        """Say whether nothing hides an actor from another."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """Whether a condition holds at a frame, and by how much.

    Attributes:
        held: it does.
        margin: in the SI unit of `unit`, positive where the condition holds; NaN where there is no number.
        unit: the unit word of what decides, as its author wrote it; "" where there is no number.
        decides: the part that decides.
        dimension: of the margin; margins of one dimension can be compared.
        value: what was compared with the bound, in the same SI unit; NaN where nothing is compared.
    """

    held: bool
    margin: float = math.nan
    unit: str = ""
    decides: m.Condition | None = None
    dimension: str = ""
    value: float = math.nan

    def negated(self) -> Outcome:
        """Return the outcome of the opposite."""
        return replace(self, held=not self.held, margin=-self.margin)


class Conditions:
    """Evaluates conditions at the frame that a simulation is at; `condition_history` follows them over time."""

    def __init__(
        self,
        simulation: Simulation,
        signals: Mapping[str, Signal],
        *,
        eyes: Eyes | None = None,
        sightlines: Sightlines | None = None,
    ) -> None:
        """Evaluate conditions of one run. `eyes`: the ego's sensors; `sightlines`: None, like `eyes`, where nothing is
        seen."""
        self.simulation, self.signals = simulation, signals
        self.eyes, self.sightlines = eyes, sightlines
        self.outlines = outlines_of(simulation.network)
        self.states = simulation.state_table.states
        self.sizes = np.array([(actor.length, actor.width) for actor in simulation.actors]).reshape(-1, 2)
        """[A, 7] the states of all actors, and [A, 2] their lengths and widths, m, for kernels."""
        self.rows = {actor.id: row for row, actor in enumerate(simulation.actors)}
        self.ways = Ways(simulation)
        self.ego_hit: bool | None = None
        """Whether the ego touches anything at this frame, where that is known already."""

    @property
    def frame(self) -> int:
        """The frame that the simulation is at."""
        return self.simulation.frame

    @property
    def time_s(self) -> float:
        """Its time."""
        return self.simulation.time_s

    def arrived(self, name: str) -> bool:
        """Whether an actor has reached its goal: the ego's point, a path's end, the end of a route."""
        actor = self.simulation.by_id.get(name)
        if actor is None:
            return False
        if actor is self.simulation.ego:
            return self.simulation.progress.of(actor, self.simulation.frame)[0] >= self.simulation.scene.goal_s
        if isinstance(actor, PathActor):
            return actor.follower.arrived
        if isinstance(actor, GuidedVehicle) and actor.arrived:
            return True
        return not actor.present

    def collides(self, name: str) -> bool:
        """Whether an actor touches another."""
        if name == "ego" and self.ego_hit is not None:
            return self.ego_hit
        actor = self.actor(name)
        return actor is not None and any(overlaps(actor.box, other.box) for other in self.simulation.others(actor))

    def gap(self, actor: Actor, other: Actor) -> float:
        """Return the distance between two footprints, m."""
        return float(gap(self.states, self.sizes, self.rows[actor.id], self.rows[other.id]))

    def actor(self, name: str | None) -> Actor | None:
        """Return an actor that is present; None for any other name."""
        actor = self.simulation.by_id.get(name or "")
        return actor if actor is not None and actor.present else None

    def is_junction(self, name: str) -> bool:
        """Whether a name is a junction's; an actor of the same name comes first."""
        return name not in self.simulation.by_id and self.simulation.network.is_junction(name)


def every(outcomes: Iterable[Outcome | None], *, unknown: bool = False) -> Outcome | None:
    """Return the outcome of `and`: one that does not hold decides; else none where one of them has none, or with
    `unknown`."""
    return _joined(tuple(outcomes), enough=False, unknown=unknown)


def some(outcomes: Iterable[Outcome | None]) -> Outcome | None:
    """Return the outcome of `or`. One that holds decides; otherwise it has none where one has none."""
    return _joined(tuple(outcomes), enough=True, unknown=False)


def _joined(outcomes: tuple[Outcome | None, ...], *, enough: bool, unknown: bool) -> Outcome | None:
    """Join outcomes of which one with `held == enough` is enough to decide.

    The margin is that of a part that decides: of those in the dimension of the first, the nearest to the opposite for
    `and`, the furthest from it for `or`.
    """
    known = [outcome for outcome in outcomes if outcome is not None]
    deciding = [outcome for outcome in known if outcome.held == enough]
    if not deciding:
        if unknown or len(known) < len(outcomes):
            return None
        deciding = known
    numbers = [outcome for outcome in deciding if not math.isnan(outcome.margin)]
    if not numbers:
        return deciding[0]
    alike = [outcome for outcome in numbers if outcome.dimension == numbers[0].dimension]
    return (max if enough else min)(alike, key=lambda outcome: outcome.margin)
