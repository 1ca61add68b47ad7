"""Drives over a starter once, with `idm` alone on the road: an import that nobody can drive on is no import."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.errors import CompileError, InputError, SimulationError
from foresee_dsl.exchange.maps.starter import Way
from foresee_dsl.exchange.outcome import ExchangeError, write_text
from foresee_dsl.language import model as m

_DRIVER = "idm"
_MOST_TRIED = 6
"""Ways that are tried until one is found on which `idm` arrives (ours: each takes a second or two)."""
_NEAR_M = 30.0


@dataclass(frozen=True)
class Drive:
    """How a drive alone ended: whether it arrived, in words, and the edges on which it came to its end otherwise."""

    arrived: bool
    reason: str
    ended_on: frozenset[str] = frozenset()


def first_that_arrives(
    find: Callable[[frozenset[str]], tuple[m.Scenario, Way]], folder: Path, roads: RoadNetwork
) -> tuple[m.Scenario, Way, Drive]:
    """Return the best way on which `idm` arrives alone; where there is none, the best way, and how that ended.

    `find`: gives the best way that keeps off some edges. `folder`: holds the network; nothing else stays there.
    """
    scenario, way = find(frozenset())
    drive = driven_alone(scenario, folder, roads)
    first = scenario, way, drive
    without: frozenset[str] = frozenset()
    for _ in range(_MOST_TRIED - 1):
        if drive.arrived:
            return scenario, way, drive
        without |= drive.ended_on or {way.edges[0]}
        try:
            scenario, way = find(without)
        except ExchangeError:  # there are no more
            return first
        drive = driven_alone(scenario, folder, roads)
    return (scenario, way, drive) if drive.arrived else first


def driven_alone(scenario: m.Scenario, folder: Path, roads: RoadNetwork) -> Drive:
    """Place a scenario's actors, and drive it without its traffic."""
    from foresee_dsl.campaign.driving import run_test_case  # here: SUMO and the drivers
    from foresee_dsl.compile import compile_test_case
    from foresee_dsl.language.project.loading import load_test_case
    from foresee_dsl.simulate.results.verdict import Verdict
    from foresee_dsl.simulate.trace import X, Y

    body = tuple(item for item in scenario.body if not isinstance(item, m.Traffic))
    file = folder / "first_drive.foresee"
    try:
        write_text(file, scenario)
        compile_test_case(load_test_case(file))  # traffic too finds its places
        write_text(file, scenario.model_copy(update={"body": body}))
        result = run_test_case(load_test_case(file), _DRIVER, 0, deadlines=None)
    except (InputError, CompileError, SimulationError) as err:
        return Drive(False, str(err).replace(f"{file}:", ""))
    finally:
        file.unlink(missing_ok=True)
    x, y = (float(value) for value in result.trace.states[-1, 0, [X, Y]])
    return Drive(result.verdict is Verdict.PASS, result.reason, _edges_at(roads, x, y))


def _edges_at(roads: RoadNetwork, x: float, y: float) -> frozenset[str]:
    """The edge at a place; inside a junction the one that the nearest way there leads to."""
    near = roads.nearest_lane(x, y, within_m=_NEAR_M)
    if near is None:
        return frozenset()
    if not near.lane.internal:
        return frozenset({near.lane.edge})
    return frozenset(movement.to_edge for movement in roads.movements_through(near.lane.id))
