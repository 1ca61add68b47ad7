"""The behaviour on a CARLA route, family by family: the values of a case, as text of the language.

CARLA's triggers contain places only; its scenario code contains the rest. The behaviour here is modelled by us after
the names and descriptions of its scenarios: which actors take part, where, and how fast. The values vary from route to
route, so that the cases of a family differ; they are ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.language.project.loading import bundled_models
from foresee_dsl.language.traversal import si_of
from foresee_exchange.carla.other_vehicle import other_vehicle
from foresee_exchange.carla.placed_route import PlacedRoute, kerbs, passages_of

STAGED = ("3", "4", "7", "8", "9")
"""The families whose behaviour is modelled."""
Variant = Literal["", "walker", "crossing", "open"]
"""Kinds of behaviour on a route. "": the family's behaviour. `walker`, for 7 to 9: a pedestrian crosses behind the
junction, because no movement conflicts with the ego's. `crossing`, for 4: the behaviour of family 3, because there is
no room behind the junction. `open`: no behaviour."""

AHEAD_M = 12.0
"""Distance of a crossing pedestrian behind the trigger, m: the default `distance` of CARLA's DynamicObjectCrossing
(scenario_runner, object_crash_vehicle.py)."""
PACE_MPS = 8.0
"""Assumed mean speed of the ego before a junction (ours: 29 km/h), to estimate when it arrives."""
LEAST_S, SLOW_MPS, RED_S = 90, 4.0, 45.0
"""Time limit of a run, s: at least 90 s; otherwise the time at 14 km/h and two red lights (ours: a slower ego is
stuck)."""
_NEAREST_M = 22.0
"""Least distance from the start to a crossing: 25 km/h, a reaction of 1 s and braking at 4 m/s^2 need 13 m (ours)."""
_BEFORE_GOAL_M = 4.0
_COVER_BEFORE_M = 1.2
"""Distance between the end of the obstacle that hides a pedestrian and the pedestrian's path, m (ours: a step)."""
_LEAST_ROOM_M = 8.0
"""Room behind a junction for an obstacle and a crossing, m (ours)."""
_HALF_LANE_M = 1.75
_GREEN_AHEAD_S = 6.0
"""Time by which green begins before the ego is expected, s, if possible (ours: the ego then need not brake for
amber)."""

_WALKERS = (
    ("pedestrian.adult", "1.4 m/s"),
    ("pedestrian.child", "2.1 m/s"),
    ("pedestrian.elderly", "0.9 m/s"),
    ("pedestrian.hurried", "1.8 m/s"),
    ("pedestrian.jogger", "2.8 m/s"),
    ("pedestrian.pram", "1.1 m/s"),
)
_OTHER_MODELS = ("car.sedan", "car.suv", "van.delivery", "motorcycle.street", "car.compact", "truck.light", "bus.midi")
_OTHER_SPEEDS = (45, 50, 40, 55, 48)
_GAPS = {"7": ("0.2 s", "0.6 s", "0.0 s", "0.9 s"), "8": ("0.5 s", "1.2 s", "2.0 s", "0.2 s")}
_GAPS["9"] = ("0.8 s", "1.4 s", "0.4 s", "2.2 s")
_START_SPEEDS = (30, 25, 36)
"""Speeds at the start, km/h. A start inside a junction has 20 km/h, because 36 km/h in a bend of 8 m would be 12 m/s^2
sideways."""
_COVERS = ("obstacle.parked_van", "obstacle.parked_suv", "obstacle.parked_van", "obstacle.parked_truck")
_PARKED = ("obstacle.parked_car", "obstacle.skip", "obstacle.parked_van", "obstacle.barrier", "obstacle.parked_suv")
_CYCLISTS = (("bicycle.city", 13), ("bicycle.racing", 20), ("bicycle.cargo", 11), ("bicycle.child", 9))


_ANY_SPEED = "speed", "20 km/h..80 km/h step 1 km/h"
_PARAMS: Mapping[str, tuple[str, str]] = {
    "first": ("arm", ""),
    "last": ("arm", ""),
    "start_speed": ("speed", "0 km/h..50 km/h step 1 km/h"),
    "junction": ("junction", ""),
    "shown": ("stage", ""),
    "since": ("time", ""),
    "traffic_seed": ("count", "0..9999 step 1"),
    "limit": ("time", ""),
    "gap": ("time", "0 s..5 s step 0.1 s"),
    "notice": ("length", "6 m..50 m step 1 m"),
    "pace": ("speed", "0.4 m/s..4 m/s step 0.1 m/s"),
    "cyclist_speed": ("speed", "5 km/h..30 km/h step 1 km/h"),
    "runner_speed": _ANY_SPEED,
    "oncoming_speed": _ANY_SPEED,
    "crossing_speed": _ANY_SPEED,
}
"""Type and range (empty for none) of each parameter; other parameters are lengths, or of the type that the ending of
their name implies."""
_ROUTE_PARAMS = ("first", "last", "begin", "beside", "finish", "start_speed", "traffic_seed", "limit")


def declared(name: str, default: str) -> str:
    """Return the declaration of a parameter."""
    edge = name.endswith(("_first", "_last")) or name.startswith("through")
    by_ending = "model" if name.endswith("_model") else "arm" if edge else "length"
    type_, within = _PARAMS.get(name, (by_ending, ""))
    return f"param {name}: {type_} = {default}" + (f" in {within}" if within else "")


def is_of_route(name: str) -> bool:
    """Return whether a parameter concerns the ego's route, not the behaviour on it."""
    return name in _ROUTE_PARAMS or name.startswith("through")


@dataclass(frozen=True)
class Case:
    """A case of a scenario file, with its values as text.

    Attributes:
        family: such as `3`. variant: kind of behaviour.
        values: the values of all parameters of its file.
        bridge: whether its route goes over or under another road; the world is flat, so it then gets no background
            traffic. walkers: whether there are pedestrians in the background traffic.
    """

    name: str
    family: str
    variant: Variant
    values: Mapping[str, str]
    bridge: bool = False
    walkers: bool = True

    @property
    def signal(self) -> bool:
        """Return whether the junction of the scenario has a signal."""
        return "shown" in self.values


def case_of(
    network: RoadNetwork,
    signals: Mapping[str, Signal],
    placed: PlacedRoute,
    *,
    name: str,
    number: int,
    staged: bool = True,
) -> Case:
    """Return the case of a route, the `number`th of its family; the values vary with the number.

    Args:
        signals: the signals of the town, by junction. staged: whether the case has the family's behaviour, if there is
            room for it.
    """
    family = placed.route.family
    stage = _STAGES.get(family) if staged else None
    variant, values = stage(network, signals, placed, number) if stage is not None else _NOTHING
    return Case(name=name, family=family, variant=variant, values=_route_values(placed, number) | values)


def _route_values(placed: PlacedRoute, number: int) -> dict[str, str]:
    first, *between, last = placed.named if len(placed.named) > 1 else (placed.named[0], placed.named[0])
    return {
        "first": _word(first),
        **{through(k): _word(edge) for k, edge in enumerate(between)},
        "last": _word(last),
        "begin": _m(placed.begin_m),
        "beside": _m(placed.beside_m),
        "finish": _m(placed.finish_m),
        "start_speed": "20 km/h" if placed.way.start.lane.internal else f"{_START_SPEEDS[number % 3]} km/h",
        "traffic_seed": str(number + 1),
        "limit": f"{max(LEAST_S, math.ceil((placed.finish_m / SLOW_MPS + RED_S) / 10) * 10)} s",
    }


_Staged = tuple[Variant, dict[str, str]]
_NOTHING: _Staged = ("open", {})


def _crossing(network: RoadNetwork, _: Mapping[str, Signal], placed: PlacedRoute, number: int) -> _Staged:
    """Return the behaviour of family 3: a pedestrian crosses behind the trigger, and a cyclist crosses farther on."""
    room = placed.finish_m - _BEFORE_GOAL_M
    if room < _NEAREST_M:
        return _NOTHING
    spot = min(max(placed.trigger_m + AHEAD_M, _NEAREST_M), room)
    second = min(spot + 25.0, room) if spot + 10.0 < room else max(spot - 10.0, _NEAREST_M / 2)
    near, far = kerbs(network, placed.line, placed.s + spot)
    second_near, second_far = kerbs(network, placed.line, placed.s + second)
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


def _after_turn(network: RoadNetwork, signals: Mapping[str, Signal], placed: PlacedRoute, number: int) -> _Staged:
    """Return the behaviour of family 4: an obstacle stands behind the junction, and a cyclist crosses behind the
    obstacle."""
    passages = sorted(passages_of(network, placed), key=lambda junction: junction.turn not in ("left", "right"))
    rooms = [(junction, min(placed.goal_s, placed.line.end_s) - junction.exit_s - 1.0) for junction in passages]
    passage, room = next(((junction, room) for junction, room in rooms if room >= _LEAST_ROOM_M), (None, 0.0))
    if passage is None:
        variant, values = _crossing(network, signals, placed, number)
        return ("crossing" if values else variant), values
    crossing = min((16.0, 20.0, 24.0)[number % 3], room)
    parked = _PARKED[number % len(_PARKED)]
    beyond = crossing - _COVER_BEFORE_M - si_of(bundled_models()[parked].length) / 2
    near, far = kerbs(network, placed.line, passage.exit_s + crossing)
    cyclist, speed = _CYCLISTS[number % len(_CYCLISTS)]
    return "", {
        "junction": _word(passage.junction),
        **_green(signals, passage, placed),
        "parked_model": parked,
        "beyond": _m(beyond),
        # Half of the obstacle stands in the lane; or all of it in the lane beside the ego's.
        "parked_side": _m(-(_HALF_LANE_M + 0.6)),
        "crossing": _m(crossing),
        "near_kerb": _m(near),
        "far_kerb": _m(far),
        "cyclist_model": cyclist,
        "cyclist_speed": f"{speed} km/h",
        "notice": f"{(18, 22, 15, 26)[number % 4]} m",
    }


def _in_junction(network: RoadNetwork, signals: Mapping[str, Signal], placed: PlacedRoute, number: int) -> _Staged:
    """Return the behaviour of family 7, 8 or 9: another vehicle reaches the junction at the same time as the ego."""
    family = placed.route.family
    passages = sorted(passages_of(network, placed), key=lambda junction: junction.signal is None)
    speed = _OTHER_SPEEDS[number % len(_OTHER_SPEEDS)]
    vehicle = passage = None
    for passage in passages:
        away = (passage.entry_s - placed.s) * speed / 3.6 / PACE_MPS
        vehicle = other_vehicle(network, passage, family, away)
        if vehicle is not None:
            break
    if passage is None:
        return _NOTHING
    # No movement conflicts with the ego's, so a pedestrian crosses the road behind the first junction.
    if vehicle is None:
        passage = passages[0]
        return "walker", {
            "junction": _word(passage.junction),
            **_green(signals, passage, placed),
            **_walker(network, placed, passage, number),
        }
    other = _OTHERS[family]
    return "", {
        "junction": _word(passage.junction),
        **_green(signals, passage, placed),
        f"{other}_first": _word(vehicle.named[0]),
        f"{other}_last": _word(vehicle.named[1]),
        f"{other}_begin": _m(vehicle.begin_m),
        f"{other}_model": _OTHER_MODELS[number % len(_OTHER_MODELS)],
        f"{other}_speed": f"{speed} km/h",
        "gap": _GAPS[family][number % len(_GAPS[family])],
        **(_walker(network, placed, passage, number) if family in ("8", "9") else {}),
    }


def _walker(network: RoadNetwork, placed: PlacedRoute, passage: Passage, number: int) -> dict[str, str]:
    """Return a pedestrian on the crossing of the road that the ego turns into."""
    walk = max(min(6.0, placed.line.end_s - passage.exit_s - 0.5), 0.0)
    near, far = kerbs(network, placed.line, passage.exit_s + walk)
    walker, pace = _WALKERS[number % len(_WALKERS)]
    return {
        "walk": _m(walk),
        "near_kerb": _m(near),
        "far_kerb": _m(far),
        "walker_model": walker,
        "pace": pace,
        "notice": f"{(18, 22, 15, 26)[number % 4]} m",
    }


_OTHERS = {"7": "runner", "8": "oncoming", "9": "crossing"}
"""Name of the other vehicle, by family."""
_STAGES = {"3": _crossing, "4": _after_turn, "7": _in_junction, "8": _in_junction, "9": _in_junction}


def _green(signals: Mapping[str, Signal], passage: Passage, placed: PlacedRoute) -> dict[str, str]:
    """Return the signal's stage and its elapsed time at the start, chosen so that the ego has green when it arrives."""
    signal = signals.get(passage.junction)
    link = passage.movement.link
    if signal is None or passage.signal is None or link < 0:
        return {}
    *starts, cycle = accumulate((phase.duration_s for phase in signal.phases), initial=0.0)
    phase_starts = zip(starts, (phase.state for phase in signal.phases), strict=True)
    green = next((at for at, state in phase_starts if link < len(state) and state[link] in "Gg"), None)
    if green is None or cycle <= 0:
        return {}
    lead = max((passage.entry_s - placed.s) / PACE_MPS - _GREEN_AHEAD_S, 0.0)
    at = (green - lead + 1.0) % cycle
    k, begun = max((k, begun) for k, begun in enumerate(starts) if begun <= at)
    phase = signal.phases[k]
    return {"shown": _word(signal.stages[phase.stage]), "since": f"{phase.since_stage_s + at - begun:.1f} s"}


def _m(length: float) -> str:
    return f"{length + 0.0:.2f} m".replace("-0.00 m", "0.00 m")


def _word(name: str) -> str:
    return f'"{name}"'


def through(k: int) -> str:
    """Return the name of the k-th edge between the first and the last: `through`, `through_2`, ..."""
    return "through" if k == 0 else f"through_{k + 1}"


def common(cases: Sequence[Case], name: str) -> str:
    """Return the value that occurs most often among the cases: the default of the parameter."""
    values = [value_of(case, name) for case in cases]
    return max(dict.fromkeys(values), key=values.count)


def value_of(case: Case, name: str) -> str:
    """Return a case's value; a route with fewer edges in between repeats its last edge."""
    return case.values.get(name, case.values["last"]) if name.startswith("through") else case.values[name]
