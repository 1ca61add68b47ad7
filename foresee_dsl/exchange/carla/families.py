"""What happens on a CARLA route, family by family: the values of a case, as text of the language.

CARLA's triggers hold places only, and its scenario code says the rest. What is here is modelled by us after the names
and descriptions of its scenarios: who takes part, where, and how fast. The values vary from route to route, so that a
family is no repetition of one situation; they are ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.exchange.carla.journey import Journey, kerbs, passages_of
from foresee_dsl.exchange.carla.partners import partner_of
from foresee_dsl.language.project.loading import bundled_models
from foresee_dsl.language.traversal import si_of

STAGED = ("3", "4", "7", "8", "9")
"""The families whose behaviour we know."""
Variant = Literal["", "walker", "crossing", "open"]
"""What happens: the family's behaviour; for 7 to 9, where no way conflicts with the ego's, somebody who walks over the
road behind the junction; for 4, where there is no room behind it, what happens in family 3; or nothing."""

AHEAD_M = 12.0
"""Somebody crosses this far behind the trigger. CARLA's DynamicObjectCrossing starts 12 m ahead (from memory, not
checked)."""
PACE_MPS = 8.0
"""What the ego drives on average before a junction (ours: 29 km/h): only for guesses of when it arrives."""
LEAST_S, SLOW_MPS, RED_S = 90, 4.0, 45.0
"""A run may take 90 s, or the time at 14 km/h and two red lights (ours: who takes longer is stuck)."""
_NEAREST_M = 22.0
"""The least way before somebody crosses: 25 km/h, a reaction of 1 s and braking with 4 m/s^2 take 13 m (ours)."""
_BEFORE_GOAL_M = 4.0
_COVER_BEFORE_M = 1.2
"""What hides somebody ends so far before whoever steps out from behind it (ours: a step of room)."""
_LEAST_ROOM_M = 8.0
"""Behind a junction, for something that stands there and somebody who crosses (ours)."""
_HALF_LANE_M = 1.75
_GREEN_AHEAD_S = 6.0
"""Green begins so long before the ego is thought to arrive, where it can (ours: it need not brake for amber)."""

_WALKERS = (
    ("pedestrian.adult", "1.4 m/s"),
    ("pedestrian.child", "2.1 m/s"),
    ("pedestrian.elderly", "0.9 m/s"),
    ("pedestrian.hurried", "1.8 m/s"),
    ("pedestrian.jogger", "2.8 m/s"),
    ("pedestrian.pram", "1.1 m/s"),
)
_PARTNERS = ("car.sedan", "car.suv", "van.delivery", "motorcycle.street", "car.compact", "truck.light", "bus.midi")
_PARTNER_SPEEDS = (45, 50, 40, 55, 48)
_GAPS = {"7": ("0.2 s", "0.6 s", "0.0 s", "0.9 s"), "8": ("0.5 s", "1.2 s", "2.0 s", "0.2 s")}
_GAPS["9"] = ("0.8 s", "1.4 s", "0.4 s", "2.2 s")
_START_SPEEDS = (30, 25, 36)
"""km/h; who starts inside a junction has 20 km/h: 36 km/h in a bend of 8 m would be 12 m/s^2 sideways."""
_COVERS = ("obstacle.parked_van", "obstacle.parked_suv", "obstacle.parked_van", "obstacle.parked_truck")
_PARKED = ("obstacle.parked_car", "obstacle.skip", "obstacle.parked_van", "obstacle.barrier", "obstacle.parked_suv")
_CYCLISTS = (("bicycle.city", 13), ("bicycle.racing", 20), ("bicycle.cargo", 11), ("bicycle.child", 9))


@dataclass(frozen=True)
class Param:
    """A parameter of a family: its type, and its range as text (empty for none)."""

    type: str
    within: str = ""


PARAMS: Mapping[str, Param] = {
    "first": Param("arm"),
    "last": Param("arm"),
    "begin": Param("length"),
    "beside": Param("length"),
    "finish": Param("length"),
    "start_speed": Param("speed", "0 km/h..50 km/h step 1 km/h"),
    "junction": Param("junction"),
    "shown": Param("stage"),
    "since": Param("time"),
    "traffic_seed": Param("count", "0..9999 step 1"),
    "limit": Param("time"),
    "gap": Param("time", "0 s..5 s step 0.1 s"),
    "notice": Param("length", "6 m..50 m step 1 m"),
    "pace": Param("speed", "0.4 m/s..4 m/s step 0.1 m/s"),
    "cyclist_speed": Param("speed", "5 km/h..30 km/h step 1 km/h"),
    "runner_speed": Param("speed", "20 km/h..80 km/h step 1 km/h"),
    "oncoming_speed": Param("speed", "20 km/h..80 km/h step 1 km/h"),
    "crossing_speed": Param("speed", "20 km/h..80 km/h step 1 km/h"),
}
"""What is said of each parameter; those that are not here are lengths, or what their name's ending says."""
ROUTE_PARAMS = ("first", "last", "begin", "beside", "finish", "start_speed", "traffic_seed", "limit")


def param(name: str) -> Param:
    """Return what is said of a parameter."""
    if name in PARAMS:
        return PARAMS[name]
    edge = name.endswith(("_first", "_last")) or name.startswith("through")
    return Param("model" if name.endswith("_model") else "arm" if edge else "length")


def is_of_route(name: str) -> bool:
    """Say whether a parameter is about the ego's route, and not about what happens on it."""
    return name in ROUTE_PARAMS or name.startswith("through")


@dataclass(frozen=True)
class Row:
    """A case: its name, and its values as text.

    Attributes:
        name: of the case. family: `3`. variant: what happens.
        values: of all parameters that its file has.
        bridge: whether it goes over or under another road; the world is flat, so there is no traffic around.
        walkers: whether people walk around.
    """

    name: str
    family: str
    variant: Variant
    values: Mapping[str, str]
    bridge: bool = False
    walkers: bool = True

    @property
    def signal(self) -> bool:
        """Whether the junction that is meant has a signal."""
        return "shown" in self.values


def row_of(
    network: RoadNetwork,
    signals: Mapping[str, Signal],
    journey: Journey,
    *,
    name: str,
    number: int,
    staged: bool = True,
) -> Row:
    """Return the case of a route.

    Args:
        network: the town. signals: of the town, by junction.
        journey: the route.
        name: the case's. number: the route's in its family; what varies comes from it.
        staged: whether to stage the family's behaviour, where there is a place for it.
    """
    values = _route_values(journey, number)
    family = journey.route.family
    stage = _STAGES.get(family) if staged else None
    variant, found = stage(network, signals, journey, number) if stage is not None else _NOTHING
    return Row(name=name, family=family, variant=variant, values=values | found)


def _route_values(journey: Journey, number: int) -> dict[str, str]:
    first, *between, last = journey.named if len(journey.named) > 1 else (journey.named[0], journey.named[0])
    return {
        "first": _word(first),
        **{through(k): _word(edge) for k, edge in enumerate(between)},
        "last": _word(last),
        "begin": _m(journey.begin_m),
        "beside": _m(journey.beside_m),
        "finish": _m(journey.finish_m),
        "start_speed": "20 km/h" if journey.way.start.lane.internal else f"{_START_SPEEDS[number % 3]} km/h",
        "traffic_seed": str(number + 1),
        "limit": f"{max(LEAST_S, math.ceil((journey.finish_m / SLOW_MPS + RED_S) / 10) * 10)} s",
    }


_Staged = tuple[Variant, dict[str, str]]
_NOTHING: _Staged = ("open", {})


def _crossing(network: RoadNetwork, _: Mapping[str, Signal], journey: Journey, number: int) -> _Staged:
    """Family 3: somebody crosses behind the trigger, and a cyclist further on."""
    room = journey.finish_m - _BEFORE_GOAL_M
    if room < _NEAREST_M:
        return _NOTHING
    spot = min(max(journey.trigger_m + AHEAD_M, _NEAREST_M), room)
    second = min(spot + 25.0, room) if spot + 10.0 < room else max(spot - 10.0, _NEAREST_M / 2)
    near, far = kerbs(network, journey.line, journey.s + spot)
    second_near, second_far = kerbs(network, journey.line, journey.s + second)
    walker, pace = _WALKERS[number % len(_WALKERS)]
    cover = _COVERS[number % len(_COVERS)]
    return "", {
        "spot": _m(spot),
        "near_kerb": _m(near),
        "far_kerb": _m(far),
        "walker_model": walker,
        "pace": pace,
        "cover_model": cover,
        "cover_at": _m(spot - _COVER_BEFORE_M - si_of(bundled_models()[cover].length) / 2),
        "cover_side": _m(near - 1.0),
        "second": _m(second),
        "second_near": _m(second_near),
        "second_far": _m(second_far),
        "cyclist_speed": f"{_CYCLISTS[number % len(_CYCLISTS)][1]} km/h",
        "notice": f"{(14, 18, 12, 22)[number % 4]} m",
    }


def _after_turn(network: RoadNetwork, signals: Mapping[str, Signal], journey: Journey, number: int) -> _Staged:
    """Family 4: something stands behind the junction, and a cyclist crosses behind it."""
    passages = sorted(passages_of(network, journey), key=lambda one: one.turn not in ("left", "right"))
    rooms = [(one, min(journey.goal_s, journey.line.end_s) - one.exit_s - 1.0) for one in passages]
    passage, room = next(((one, room) for one, room in rooms if room >= _LEAST_ROOM_M), (None, 0.0))
    if passage is None:
        variant, values = _crossing(network, signals, journey, number)
        return ("crossing" if values else variant), values
    crossing = min((16.0, 20.0, 24.0)[number % 3], room)
    parked = _PARKED[number % len(_PARKED)]
    beyond = crossing - _COVER_BEFORE_M - si_of(bundled_models()[parked].length) / 2
    near, far = kerbs(network, journey.line, passage.exit_s + crossing)
    cyclist, speed = _CYCLISTS[number % len(_CYCLISTS)]
    return "", {
        "junction": _word(passage.junction),
        **_green(signals, passage, journey),
        "parked_model": parked,
        "beyond": _m(beyond),
        # half of it stands in the lane, or all of it in the lane beside the ego's
        "parked_side": _m(-(_HALF_LANE_M + 0.6)),
        "crossing": _m(crossing),
        "near_kerb": _m(near),
        "far_kerb": _m(far),
        "cyclist_model": cyclist,
        "cyclist_speed": f"{speed} km/h",
        "notice": f"{(18, 22, 15, 26)[number % 4]} m",
    }


def _in_junction(network: RoadNetwork, signals: Mapping[str, Signal], journey: Journey, number: int) -> _Staged:
    """Families 7, 8, 9: somebody comes to the junction at the same time."""
    family = journey.route.family
    passages = sorted(passages_of(network, journey), key=lambda one: one.signal is None)
    speed = _PARTNER_SPEEDS[number % len(_PARTNER_SPEEDS)]
    partner = passage = None
    for passage in passages:
        away = (passage.entry_s - journey.s) * speed / 3.6 / PACE_MPS
        partner = partner_of(network, passage, family, away)
        if partner is not None:
            break
    if passage is None or partner is None:
        return _alone(network, signals, journey, number, passages)
    who = _WHO[family]
    return "", {
        "junction": _word(passage.junction),
        **_green(signals, passage, journey),
        f"{who}_first": _word(partner.named[0]),
        f"{who}_last": _word(partner.named[1]),
        f"{who}_begin": _m(partner.begin_m),
        f"{who}_model": _PARTNERS[number % len(_PARTNERS)],
        f"{who}_speed": f"{speed} km/h",
        "gap": _GAPS[family][number % len(_GAPS[family])],
        **(_walker(network, journey, passage, number) if family in ("8", "9") else {}),
    }


def _alone(
    network: RoadNetwork, signals: Mapping[str, Signal], journey: Journey, number: int, passages: Sequence[Passage]
) -> _Staged:
    """For junctions where no way conflicts with the ego's: somebody walks over the road behind it."""
    if not passages:
        return _NOTHING
    return "walker", {
        "junction": _word(passages[0].junction),
        **_green(signals, passages[0], journey),
        **_walker(network, journey, passages[0], number),
    }


def _walker(network: RoadNetwork, journey: Journey, passage: Passage, number: int) -> dict[str, str]:
    """Somebody on the crossing of the road that the ego turns into."""
    walk = max(min(6.0, journey.line.end_s - passage.exit_s - 0.5), 0.0)
    near, far = kerbs(network, journey.line, passage.exit_s + walk)
    walker, pace = _WALKERS[number % len(_WALKERS)]
    return {
        "walk": _m(walk),
        "near_kerb": _m(near),
        "far_kerb": _m(far),
        "walker_model": walker,
        "pace": pace,
        "notice": f"{(18, 22, 15, 26)[number % 4]} m",
    }


_WHO = {"7": "runner", "8": "oncoming", "9": "crossing"}
"""What the other vehicle is called."""
_STAGES = {"3": _crossing, "4": _after_turn, "7": _in_junction, "8": _in_junction, "9": _in_junction}


def _green(signals: Mapping[str, Signal], passage: Passage, journey: Journey) -> dict[str, str]:
    """The signal's stage and time at the beginning, so that the ego's movement has green when it arrives."""
    signal = signals.get(passage.junction)
    link = passage.movement.link
    if signal is None or passage.signal is None or link < 0:
        return {}
    starts = _starts(signal)
    cycle = sum(phase.duration_s for phase in signal.phases)
    green = next((at for at, phase in starts if link < len(phase) and phase[link] in "Gg"), None)
    if green is None or cycle <= 0:
        return {}
    lead = max((passage.entry_s - journey.s) / PACE_MPS - _GREEN_AHEAD_S, 0.0)
    at = (green - lead + 1.0) % cycle
    k, begun = max((k, begun) for k, (begun, _) in enumerate(starts) if begun <= at)
    phase = signal.phases[k]
    return {
        "shown": _word(signal.stages[phase.stage]),
        "since": f"{phase.since_stage_s + at - begun:.1f} s",
    }


def _starts(signal: Signal) -> list[tuple[float, str]]:
    """When each phase of a cycle begins, s, and what it shows."""
    at, found = 0.0, []
    for phase in signal.phases:
        found.append((at, phase.state))
        at += phase.duration_s
    return found


def _m(length: float) -> str:
    return f"{length + 0.0:.2f} m".replace("-0.00 m", "0.00 m")


def _word(name: str) -> str:
    return f'"{name}"'


def through(k: int) -> str:
    """Return what the k-th edge between the first and the last is called: `through`, `through_2`, ..."""
    return "through" if k == 0 else f"through_{k + 1}"


def common(rows: Sequence[Row], name: str) -> str:
    """Return the value that most rows have: the default of the parameter."""
    found = [value_of(row, name) for row in rows]
    return max(dict.fromkeys(found), key=found.count)


def value_of(row: Row, name: str) -> str:
    """Return a case's value: a route without so many edges between goes through its last one."""
    return row.values.get(name, row.values["last"]) if name.startswith("through") else row.values[name]
