"""What a mutation operator may look at, and what it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.derive.presets import Preset
from foresee_dsl.derive.validity import fits
from foresee_dsl.forecast.geometry import distances_to_ego
from foresee_dsl.forecast.settings import VEHICLE_KINDS
from foresee_dsl.language.model import Actor, Change, Clip, Item
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace

_T = TypeVar("_T", bound=Item)


@dataclass(frozen=True)
class Situation:
    """What an operator may look at: a clip, its unmutated run, and what the risky point is about.

    Attributes:
        trace: the clip's own run; frame 0 is the clip's beginning. frame: the risky point's.
        ranked: the id of the actor that the point is about, or "".
        models: every model that the case knows, by name. swappable: those that may be swapped in.
    """

    clip: Clip
    trace: Trace
    frame: int
    ranked: str
    models: Mapping[str, ModelSpec]
    swappable: tuple[str, ...]

    @cached_property
    def actors(self) -> dict[str, Actor]:
        """The clip's actors, by id."""
        return {item.name: item for item in self.clip.body if isinstance(item, Actor)}

    @cached_property
    def columns(self) -> dict[str, int]:
        """The columns of the clip's actors in the trace, in the trace's order."""
        return {info.id: k for k, info in enumerate(self.trace.actors) if info.id in self.actors}

    @cached_property
    def gaps(self) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
        """Distances between the footprints of the ego and the clip's actors over the whole run, m."""
        return {actor: distances_to_ego(self.trace, k) for actor, k in self.columns.items()}

    def kind(self, actor: str) -> str:
        """Return an actor's class."""
        return self.trace.actors[self.columns[actor]].kind

    def spec(self, actor: str) -> ModelSpec:
        """Return an actor's model."""
        return self.models[self.trace.actors[self.columns[actor]].model]

    def speed_mps(self, actor: str, frame: int) -> float:
        """Return an actor's speed; 0 when it is absent."""
        speed = float(self.trace.states[frame, self.columns[actor], SPEED])
        return 0.0 if math.isnan(speed) else speed

    def way_m(self, actor: str) -> float:
        """Return how far an actor drives in the clip until a second after the risky point."""
        until = self.frame + round(1 / STEP_S)
        return float(np.nansum(self.trace.states[: until + 1, self.columns[actor], SPEED])) * STEP_S

    def fitting(self, actor: str) -> tuple[str, ...]:
        """Return the other models that an actor can have at the clip's first frame, sorted."""
        if actor not in self._fitting:
            column = self.columns[actor]
            now = self.trace.actors[column].model
            others = (name for name in self.swappable if name != now)
            found = [name for name in others if fits(self.trace, column, 0, self.models[name])]
            self._fitting[actor] = tuple(sorted(found))
        return self._fitting[actor]

    @cached_property
    def _fitting(self) -> dict[str, tuple[str, ...]]:
        return {}

    def follows_path(self, actor: str) -> bool:
        """Say whether an actor follows a path rather than lanes."""
        return bool(self.trace.actors[self.columns[actor]].path)

    def on_lanes(self, actor: str) -> bool:
        """Say whether an actor is a vehicle or bicycle that drives along lanes."""
        info = self.trace.actors[self.columns[actor]]
        return info.kind in VEHICLE_KINDS and bool(info.route) and not info.path

    def stated(self, actor: str, kind: type[_T]) -> _T | None:
        """Return the clip's statement of a kind about an actor, if there is one."""
        return next((item for item in self.actors[actor].body if isinstance(item, kind)), None)

    def closest(self, frame: int, among: list[str]) -> list[str]:
        """Return actors by their distance to the ego at a frame; those that are absent then are left out."""
        return sorted(
            (a for a in among if math.isfinite(self.gaps[a][frame])),
            key=lambda a: (float(self.gaps[a][frame]), self.columns[a]),
        )


@runtime_checkable
class Operator(Protocol):
    """Proposes changes of one kind. `name` goes into the mutant's origin."""

    name: str

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a change of the target; empty where nothing that has an effect can be done to it."""
        ...

    def letter_target(self, situation: Situation) -> str:
        """Return the target that the paper's wording gives ("" for none)."""
        ...


class OwnOperator:
    """An operator that the paper does not have, so that its wording gives no target."""

    def letter_target(self, situation: Situation) -> str:
        """Return that there is none."""
        del situation
        return ""


def drawn(rng: Generator, low: float, high: float, step: float, *, centre: float, dead: float) -> float | None:
    """Draw one of the multiples of a step between two bounds, all alike, that are not within `dead` of the centre."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    allowed = [k for k in range(first, last + 1) if abs(k * step - centre) >= dead - 1e-9]
    return round(allowed[int(rng.integers(len(allowed)))] * step, 9) if allowed else None
