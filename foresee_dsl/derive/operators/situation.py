"""The interface of a mutation operator, and the situation for which an operator draws changes."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.derive.presets import HeadStartSettings, MutationPreset
from foresee_dsl.forecast.geometry import distances_to_ego
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.forecast.settings import VEHICLE_KINDS
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.language.model import Actor, Change, Clip, Quantity
from foresee_dsl.language.model.derived import PROPERTIES
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, ActorInfo, Trace, X, Y


@dataclass(frozen=True)
class Situation:
    """The situation that an operator changes: a clip, a run of its seconds without mutation, and its risky point.

    Attributes:
        trace: the clip's own run, or its seconds of the parent's run; frame 0 is the clip's beginning.
        frame: the frame of the risky point.
        ranked: id of the actor that the risky point names, or "".
        models: all models of the case, by name. swappable: names of the models that may be swapped in.
        weather: the clip's rain, fog and wetness, ratios.
        onset_s: time at which a proposed change begins, from the clip's beginning; None if no change is proposed.
        goal: the campaign's goal, if a roll-out can compute its margin.
    """

    clip: Clip
    trace: Trace
    frame: int
    ranked: str
    models: Mapping[str, ModelSpec]
    swappable: tuple[str, ...]
    weather: Mapping[str, Quantity] = field(default_factory=dict)
    onset_s: float | None = None
    goal: PairGoal | None = None

    @cached_property
    def actors(self) -> dict[str, Actor]:
        """Return the clip's actors, by id."""
        return {item.name: item for item in self.clip.body if isinstance(item, Actor)}

    @cached_property
    def columns(self) -> dict[str, int]:
        """Return the columns of the clip's actors in the trace, in the trace's order."""
        return {info.id: k for k, info in enumerate(self.trace.actors) if info.id in self.actors}

    @cached_property
    def gaps(self) -> dict[str, FloatArray]:
        """Return the distances between the footprints of the ego and the clip's actors over the whole run, m."""
        return dict(zip(self.columns, distances_to_ego(self.trace, list(self.columns.values())), strict=True))

    @cached_property
    def fitting_models(self) -> dict[str, tuple[str, ...]]:
        """Return a cache that operators fill: for each actor that was examined, the names of the models that fit."""
        return {}

    @cached_property
    def head_starts(self) -> dict[tuple[str, HeadStartSettings], tuple[float, ...]]:
        """Return a cache that operators fill: for each actor that was examined, the places on its path where it may
        begin, m.
        """
        return {}

    def info(self, actor: str) -> ActorInfo:
        """Return the properties of an actor that are constant over a run."""
        return self.trace.actors[self.columns[actor]]

    def kind(self, actor: str) -> str:
        """Return an actor's class."""
        return self.info(actor).kind

    def spec(self, actor: str) -> ModelSpec:
        """Return an actor's model."""
        return self.models[self.info(actor).model]

    def speed_mps(self, actor: str, frame: int) -> float:
        """Return an actor's speed at a frame, m/s; 0 when it is absent."""
        speed = float(self.trace.states[frame, self.columns[actor], SPEED])
        return 0.0 if math.isnan(speed) else speed

    def driven_m(self, actor: str) -> float:
        """Return the distance that an actor drives from the clip's beginning to one second after the risky point, m."""
        until = self.frame + round(1 / STEP_S)
        return float(np.nansum(self.trace.states[: until + 1, self.columns[actor], SPEED])) * STEP_S

    def follows_path(self, actor: str) -> bool:
        """Return whether an actor follows a path rather than lanes."""
        return bool(self.info(actor).path)

    def on_lanes(self, actor: str) -> bool:
        """Return whether an actor is a vehicle or bicycle that drives along lanes."""
        info = self.info(actor)
        return info.kind in VEHICLE_KINDS and bool(info.route) and not info.path

    def present_value(self, actor: str, name: str) -> Quantity | None:
        """Return the value of an actor's numeric property (`language.model.derived.PROPERTIES`).

        It is the value that the clip states; if it states none, the default; None if there is no default either.
        """
        definition = PROPERTIES[name]
        if definition.statement is None or definition.dimension is None:
            return None
        kind, field = definition.statement
        value = next((getattr(item, field) for item in self.actors[actor].body if isinstance(item, kind)), None)
        if isinstance(value, Quantity):
            return value
        return None if definition.default is None else Quantity.of(definition.default.si, definition.dimension, 2)

    def closest(self, frame: int, among: list[str]) -> list[str]:
        """Return the actors that are present at a frame, the closest to the ego first."""
        return sorted(
            (a for a in among if math.isfinite(self.gaps[a][frame])),
            key=lambda a: (float(self.gaps[a][frame]), self.columns[a]),
        )


@runtime_checkable
class Operator(Protocol):
    """Proposes changes of one kind; its `name` is part of the mutant's origin."""

    name: str

    def changes(self, situation: Situation, target: str, preset: MutationPreset, rng: Generator) -> tuple[Change, ...]:
        """Draw a change of the target; empty if no change of it has an effect."""
        ...

    def letter_target(self, situation: Situation) -> str:
        """Return the target that the wording of the paper defines; "" for none."""
        ...


class ActorsRun(NamedTuple):
    """The unmutated run of an actor: its trace, the actor's column in it, and all models by name."""

    trace: Trace
    actor: int
    models: Mapping[str, ModelSpec]


class BuiltIn(ABC):
    """One of our operators: its name, the property that it changes, its draws and its roll-out.

    The bounds of its draws are its settings in a preset (`derive.presets`).
    """

    name: str
    property: str

    @abstractmethod
    def changes(self, situation: Situation, target: str, preset: MutationPreset, rng: Generator) -> tuple[Change, ...]:
        """Draw a change of the target; empty if no change of it has an effect."""

    @abstractmethod
    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Return an actor's track after a change of this operator's property, computed without simulation.

        `boxes`: the actor's track, [T, 5] footprints, with the earlier changes.
        """

    def letter_target(self, situation: Situation) -> str:
        """Return the target that the paper's wording defines; "" for an operator that the paper does not have."""
        del situation
        return ""

    def changed(self, situation: Situation, target: str, value: float | None) -> tuple[Change, ...]:
        """Return the change of the target's property to a value in SI units; empty if the value is None."""
        was = situation.present_value(target, self.property)
        if value is None or was is None:
            return ()
        now = Quantity.of(value, was.dimension, 2)
        return (Change(actor=target, property=self.property, was=was, now=now),)


class Numeric(BuiltIn):
    """One of our operators that draws a number; all allowed values are equally likely."""

    @abstractmethod
    def values(self, situation: Situation, target: str, preset: MutationPreset) -> Sequence[float]:
        """Return all values (SI) that the property of a target may take; empty if the operator cannot act on it."""

    def changes(self, situation: Situation, target: str, preset: MutationPreset, rng: Generator) -> tuple[Change, ...]:
        """Draw one of the allowed values."""
        values = self.values(situation, target, preset)
        return self.to(situation, target, preset, values[int(rng.integers(len(values)))]) if values else ()

    def to(self, situation: Situation, target: str, preset: MutationPreset, value: float) -> tuple[Change, ...]:
        """Return the change of a target's property to an allowed value."""
        del preset
        return self.changed(situation, target, value)


@lru_cache(maxsize=256)
def multiples(low: float, high: float, step: float, *, centre: float, dead: float) -> tuple[float, ...]:
    """Return the multiples of a step from `low` to `high`, without those that are closer to `centre` than `dead`."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(round(k * step, 9) for k in range(first, last + 1) if abs(k * step - centre) >= dead - 1e-9)


def boxes_at(trace: Trace, frame: int) -> FloatArray:
    """Return all footprints at a frame, [A, 5]: x, y, heading, length, width (m, rad); NaN where absent."""
    sizes = np.array([(info.length_m, info.width_m) for info in trace.actors])
    return np.hstack([trace.states[frame][:, [X, Y, HEADING]], sizes])


def others_at(trace: Trace, actor: int, frame: int) -> FloatArray:
    """Return the footprints of all other actors that are present at a frame, [N, 5]."""
    others = np.delete(boxes_at(trace, frame), actor, axis=0)
    return others[~np.isnan(others[:, 0])]


def is_free(trace: Trace, actor: int, frame: int, box: FloatArray) -> bool:
    """Return whether a footprint, [5], of an actor would touch no other actor at a frame."""
    others = others_at(trace, actor, frame)
    return not len(others) or bool((box_distance(box, others) > 0).all())
