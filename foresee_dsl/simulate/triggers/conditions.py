"""Evaluates conditions in the running simulation, with the margin by which they hold.

Their definitions are those of `language.model.conditions`. A condition that cannot be evaluated, because an actor is
absent or does not pass the junction, has no outcome and does not hold.

The margin is the robustness of signal temporal logic, restricted to one dimension: the margin of a comparison is the
distance of its measure from the bound, positive if the comparison holds. `and`, `always` and `for` take the smallest
margin, `or` and `eventually` the largest, `not` changes the sign (Donze and Maler, "Robust Satisfaction of Temporal
Logic over Real-Valued Signals", FORMATS 2010). Metres and seconds cannot be compared: across dimensions the margin is
that of the first part that decides whether the condition holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.kernels.boxes import overlaps
from foresee_dsl.kernels.conditions import gap
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.results.metrics import outlines_of
from foresee_dsl.simulate.results.outcome import RunEnd
from foresee_dsl.simulate.rules.watch import RuleWatch
from foresee_dsl.simulate.sensing.perception import Sensing
from foresee_dsl.simulate.sensing.sight import LinesOfSight
from foresee_dsl.simulate.triggers.ways import Ways


@dataclass(frozen=True, slots=True)
class ConditionOutcome:
    """Whether a condition holds at a frame, and its margin.

    Attributes:
        held: whether it holds.
        margin: in the SI unit of `unit`, positive if the condition holds; NaN without a number.
        unit: unit word of the deciding part, as its author wrote it; "" without a number.
        decides: the deciding part.
        dimension: dimension of the margin; margins of one dimension can be compared.
        value: the value compared with the bound, in the same SI unit; NaN without a comparison.
    """

    held: bool
    margin: float = math.nan
    unit: str = ""
    decides: m.Condition | None = None
    dimension: str = ""
    value: float = math.nan

    def negated(self) -> ConditionOutcome:
        """Return the outcome of the negated condition."""
        return replace(self, held=not self.held, margin=-self.margin)


class Conditions:
    """Evaluates conditions at the simulation's current frame; `condition_history` follows them over time."""

    def __init__(self, simulation: Simulation, signals: Mapping[str, Signal], sensing: Sensing | None = None) -> None:
        """Evaluate conditions of one run; without the ego's sensors, conditions about them have no outcome."""
        self.simulation, self.signals = simulation, signals
        self.sensing, self.sightlines = sensing, LinesOfSight(simulation)
        self.outlines = outlines_of(simulation.network)
        self.states = simulation.state_table.states
        self.sizes = np.array([(actor.length, actor.width) for actor in simulation.actors]).reshape(-1, 2)
        """States of all actors, [A, 7], and their lengths and widths, [A, 2] m, for kernels."""
        self.rows = {actor.id: row for row, actor in enumerate(simulation.actors)}
        self.ways = Ways(simulation)
        self._rules: dict[str, RuleWatch] = {}
        self._ego_hit = (-1, False)

    @property
    def frame(self) -> int:
        """The simulation's current frame."""
        return self.simulation.frame

    @property
    def time_s(self) -> float:
        """The simulation's current time, s."""
        return self.simulation.time_s

    def arrived(self, name: str) -> bool:
        """Return whether an actor has reached its goal: the ego's goal, a path's end, or the end of a route."""
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
        """Return whether an actor touches another one."""
        if name == "ego" and self._ego_hit[0] == self.simulation.frame:
            return self._ego_hit[1]
        actor = self.actor(name)
        return actor is not None and any(overlaps(actor.box, other.box) for other in self.simulation.others(actor))

    def record_contact(self, *, ego_hit: bool) -> None:
        """State whether the ego touches another actor at this frame, so that `collides` need not compute it."""
        self._ego_hit = self.simulation.frame, ego_hit

    def rules(self, actor: SimulatedActor) -> RuleWatch:
        """Return the traffic rules that an actor has broken, followed from the first call of this method on."""
        if actor.id not in self._rules:
            self._rules[actor.id] = RuleWatch(self.simulation, actor)
        return self._rules[actor.id]

    def end_rules(self, decision: RunEnd) -> None:
        """Add the infractions that only the end of the run shows, at the frame at which it ends."""
        for watch in self._rules.values():
            watch.end(decision)

    def gap(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return the distance between two footprints, m."""
        return float(gap(self.states, self.sizes, self.rows[actor.id], self.rows[other.id]))

    def actor(self, name: str | None) -> SimulatedActor | None:
        """Return the present actor with this name; None without one."""
        actor = self.simulation.by_id.get(name or "")
        return actor if actor is not None and actor.present else None

    def is_junction(self, name: str) -> bool:
        """Return whether a name is that of a junction; an actor with the same name takes precedence."""
        return name not in self.simulation.by_id and self.simulation.network.is_junction(name)


def every(outcomes: Iterable[ConditionOutcome | None], *, unknown: bool = False) -> ConditionOutcome | None:
    """Return the outcome of `and`.

    A part that does not hold decides. Otherwise the outcome is None if a part has no outcome, or if `unknown` is True.
    """
    return _joined(tuple(outcomes), enough=False, unknown=unknown)


def some(outcomes: Iterable[ConditionOutcome | None]) -> ConditionOutcome | None:
    """Return the outcome of `or`. A part that holds decides; otherwise the outcome is None if a part has no outcome."""
    return _joined(tuple(outcomes), enough=True, unknown=False)


def _joined(outcomes: tuple[ConditionOutcome | None, ...], *, enough: bool, unknown: bool) -> ConditionOutcome | None:
    """Join outcomes; an outcome with `held == enough` decides.

    The margin is that of one deciding part. Of the parts that have the dimension of the first deciding part, it is the
    one with the smallest margin for `and`, and with the largest for `or`.
    """
    present = [outcome for outcome in outcomes if outcome is not None]
    deciding = [outcome for outcome in present if outcome.held == enough]
    if not deciding:
        if unknown or len(present) < len(outcomes):
            return None
        deciding = present
    numbers = [outcome for outcome in deciding if not math.isnan(outcome.margin)]
    if not numbers:
        return deciding[0]
    alike = [outcome for outcome in numbers if outcome.dimension == numbers[0].dimension]
    return (max if enough else min)(alike, key=lambda outcome: outcome.margin)
