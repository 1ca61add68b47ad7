"""The scenario that a part of a recording becomes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Literal

from foresee_dsl.language import model as m
from foresee_recordings.recording import Track
from foresee_recordings.scenarios.naming import one_line

ActorWord = Literal["vehicle", "bicycle", "pedestrian", "obstacle"]
AFTER_S = 0.05
"""Time by which a test case ends after the recorded seconds, s: one step, so that the last recorded state counts."""


@dataclass(frozen=True)
class Role:
    """An actor of a test case.

    Attributes:
        name: its name in the scenario. track: its recorded track. track_name: its name in the file of tracks.
        model: name of its model. route: edges that it drives along; empty off the lanes.
        driven: SUMO drives it from the beginning. leaves: it leaves its track when the ego deviates.
        state: x, y (m, in the network's coordinates), heading (rad) and speed at the beginning; None if it is not there
            yet.
        goal: of the ego, x and y, m; None: where its track ends.
    """

    name: str
    track: Track
    track_name: str
    model: str
    route: tuple[str, ...] = ()
    driven: bool = False
    leaves: bool = False
    state: tuple[float, float, float, float] | None = None
    goal: tuple[float, float] | None = None

    @property
    def word(self) -> ActorWord:
        """The word of the language for its class."""
        match self.track.kind:
            case "bicycle":
                return "bicycle"
            case "pedestrian":
                return "pedestrian"
            case "obstacle":
                return "obstacle"
            case _:
                return "vehicle"


@dataclass(frozen=True)
class Files:
    """Names of the files that a scenario uses, and the pin of its tracks."""

    network: str
    models: str
    tracks: str
    pin: str


def scenario(
    name: str,
    doc: str,
    tags: Sequence[str],
    files: Files,
    roles: Sequence[Role],
    *,
    lasts_s: float,
    deviation_m: float,
) -> m.Scenario:
    """Return the scenario of a part of a recording; the first of the roles is the ego."""
    ego, *others = roles
    body: list[m.ScenarioItem] = [
        m.Doc(text=one_line(doc)),
        m.Tags(names=tuple(tags)),
        m.UseNetwork(path=files.network),
        m.UseModels(path=files.models),
        m.UseTracks(path=files.tracks, pin=files.pin),
        m.Ego(model=ego.model, body=_ego(ego)),
        *(m.Actor(kind=role.word, name=role.name, model=role.model, body=_moves(role)) for role in others),
    ]
    if leaving := [m.LeavesTrack(actor=role.name) for role in others if role.leaves]:
        condition = m.Comparison(
            left=m.Measure(what="deviation", actor="ego"),
            op=">",
            right=m.Quantity(value=Decimal(f"{deviation_m:g}"), unit="m"),
        )
        body.append(m.When(condition=condition, actions=tuple(leaving)))
    body.append(m.Expect(mode="never", condition=m.Predicate(what="collision", actor="ego")))
    body.append(m.End(after=m.Quantity.of(lasts_s + AFTER_S, "time", 2), where="anywhere"))
    return m.Scenario(name=name, body=tuple(body))


def _ego(role: Role) -> tuple[m.ActorItem, ...]:
    track, route = m.Track(name=role.track_name), m.EdgeRoute(edges=role.route)
    return (track, route) if role.goal is None else (track, route, m.GoalAt(place=_point(*role.goal)))


def _point(x: float, y: float) -> m.Point:
    return m.Point(x=m.Quantity.of(x, "length", 2), y=m.Quantity.of(y, "length", 2))


def _moves(role: Role) -> tuple[m.ActorItem, ...]:
    if not role.driven or role.state is None:
        track = m.Track(name=role.track_name)
        return (track, m.Joins(edges=role.route)) if role.route else (track,)
    x, y, heading, speed = role.state
    front = role.track.length_m / 2
    place = _point(x + front * math.cos(heading), y + front * math.sin(heading))
    return (
        m.EdgeRoute(edges=role.route),
        m.StartAt(place=place),
        m.StartSpeed(speed=m.Quantity.of(speed, "speed", 2)),
    )
