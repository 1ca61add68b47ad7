"""Export of a test case as OpenSCENARIO XML 1.2 with an OpenDRIVE map, to be played in other simulators."""

from __future__ import annotations

import datetime
import math
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from foresee_dsl.campaign.driving import case_name, run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import ModelSpec, Signal, SumoBundle
from foresee_dsl.exchange.outcome import Imported, import_together
from foresee_dsl.exchange.recorded import driver_and_seed
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y
from foresee_exchange.maps.opendrive import opendrive_of
from foresee_exchange.openscenario.writing import behaviour as behaviours
from foresee_exchange.openscenario.writing.library import (
    MINOR_VERSION,
    Xosc,
    at_time,
    event,
    figure,
    library,
    maneuver_group,
    osc,
    reference_position,
)
from foresee_exchange.openscenario.writing.participants import entities, init

_DATE = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
"""Date in the header, which requires one; a constant, so that the same test case gives the same bytes."""

_HEAD = re.compile(rb'<signal\b[^>]*?\bid="([^"]*)"')
_COLOURS = {"G": "green", "g": "green", "y": "yellow", "r": "red"}
"""Words for SUMO's signal letters; OpenSCENARIO leaves the words to the simulators."""
_LATER_S = 2.0
"""Time by which the file of a failure continues after the run, which ended with the failure, s (ours: another driver
may take longer)."""


def run(
    address: str,
    *,
    out: Path,
    behaviour: bool = False,
    driver: str = "",
    seed: int | None = None,
    allow_outside: bool = True,
) -> Imported:
    """Write `NAME.xosc` and `NAME.xodr` of a test case, a clip or a mutant, which is run once for this.

    Args:
        address: `FILE` or `FILE::CASE`.
        out: the folder.
        behaviour: write the actors' actions and triggers, as far as possible; otherwise their trajectories.
        driver, seed: driver and seed of the run; by default those that a mutant records, otherwise `pdm` and 0.
        allow_outside: see `project.load_test_case`.

    Raises:
        ExchangeError: the package scenariogeneration is missing, or `out` cannot be written.
        InputError, CompileError, DriverError: the test case cannot be run.
    """
    library()
    case = load_test_case(address, allow_outside=allow_outside)
    driver, seed = driver_and_seed(case, driver, seed)
    bundle = compile_test_case(case)
    result = run_test_case(case, driver, seed)
    trace = result.trace
    name = case_name(case)
    left_out: Counter[str] = Counter()
    left_out["slippery patches"] += len(bundle.scene.slippery)
    road = opendrive_of(case.network, bundle.net_file)
    end_s = trace.duration_s + (_LATER_S if result.verdict.is_failure else 0.0)
    network = osc.RoadNetwork(f"{name}.xodr")
    left_out["signals (the map has no heads for them)"] += _add_signals(network, bundle, road, end_s)
    specs = {actor.id: actor.model for actor in bundle.scene.actors}
    board = osc.StoryBoard(init(trace, specs, bundle.scene), at_time("end", end_s, "stop"))
    groups, off = behaviours.groups(bundle, trace, left_out) if behaviour else (recorded_groups(trace, specs), [])
    if groups:
        board.add_story(_story(groups))
    left_out["expectations"] += len(bundle.scene.expects)
    left_out["bus stops (of a bay, its lane for buses is there)"] += len(bundle.network.bus_stops)
    left_out["buildings (they only hide things)"] += len(bundle.network.buildings)
    document = osc.Scenario(
        f"{case.scenario.name}: {result.reason}",
        "foresee-dsl",
        osc.ParameterDeclarations(),
        entities(trace, specs),
        board,
        network,
        osc.Catalog(),
        osc_minor_version=MINOR_VERSION,
        creation_date=_DATE,
    )

    kinds = Counter(info.kind for info in trace.actors)
    taken = {f"of class {kind}": count for kind, count in sorted(kinds.items())}

    def write(folder: Path) -> Imported:
        (folder / f"{name}.xodr").write_bytes(road)
        document.write_xml(str(folder / f"{name}.xosc"))
        return Imported((), 1, taken, +left_out, (f"driven by {driver}: {result.reason}", *off))

    return import_together(out, write)


def _story(groups: list[Xosc]) -> Xosc:
    act = osc.Act("act", at_time("begin", 0.0))
    for group in groups:
        act.add_maneuver_group(group)
    story = osc.Story("story", osc.ParameterDeclarations())
    story.add_act(act)
    return story


def _add_signals(road_network: Xosc, bundle: SumoBundle, road: bytes, until_s: float) -> int:
    """Add a controller per signal with heads on the map; return the number of signals without heads.

    A controller repeats its phases; the first one has the remaining duration at the beginning, and enough phases follow
    that none repeats before the end.
    """
    heads = {signal_id.decode() for signal_id in _HEAD.findall(road)}
    beginning = {junction: (stage, elapsed_s) for junction, stage, elapsed_s in bundle.scene.signals}
    missing = 0
    for signal in {s.tls: s for s in bundle.signals.values()}.values():
        links = [k for k in range(len(signal.phases[0].state)) if f"{signal.tls}_{k}" in heads]
        if not links:
            missing += 1
            continue
        controller = osc.TrafficSignalController(signal.tls)
        for k, (phase, duration_s) in enumerate(_phases_in_order(signal, beginning.get(signal.junction), until_s)):
            xosc_phase = osc.Phase(f"{signal.stages[signal.phases[phase].stage]}_{k + 1}", figure(duration_s))
            for link in links:
                letter = signal.phases[phase].state[link]
                xosc_phase.add_signal_state(f"{signal.tls}_{link}", _COLOURS.get(letter, "off"))
            controller.add_phase(xosc_phase)
        road_network.add_traffic_signal_controller(controller)
    return missing


def _phases_in_order(signal: Signal, at: tuple[str, float] | None, until_s: float) -> list[tuple[int, float]]:
    """Return the phases of a signal in order, each with its duration, s."""
    stage, elapsed_s = at or (signal.stages[signal.phases[0].stage], 0.0)
    phase, left_s = signal.phase_at(stage, elapsed_s)
    phases = [(phase, left_s)] if left_s > 0 else []
    covered = left_s
    while covered <= until_s:
        phase = (phase + 1) % len(signal.phases)
        phases.append((phase, signal.phases[phase].duration_s))
        covered += max(signal.phases[phase].duration_s, 0.05)
    return phases


STANDS_M = 1e-6
"""An actor that moved less than this between two frames stands, m; for a standstill, its trajectory has only the first
and the last frame."""


def recorded_groups(trace: Trace, specs: dict[str, ModelSpec]) -> list[Xosc]:
    """Return a maneuver group for each actor that moves, appears later or disappears before the end."""
    return [
        group for k in range(len(trace.actors)) if (group := _group(trace, k, specs[trace.actors[k].id])) is not None
    ]


def present(trace: Trace, actor: int) -> tuple[int, int] | None:
    """Return the first and last frame in which an actor is present, or None."""
    frames = np.flatnonzero(~np.isnan(trace.states[:, actor, X]))
    return (int(frames[0]), int(frames[-1])) if len(frames) else None


def vertices(trace: Trace, actor: int) -> Iterator[int]:
    """Yield the frames that an actor's trajectory needs: all except the inside of the times at which it stands."""
    span = present(trace, actor)
    if span is None:
        return
    rows = trace.states[span[0] : span[1] + 1, actor][:, [X, Y, HEADING]]
    still = np.abs(np.diff(rows, axis=0)).max(axis=1) < STANDS_M if len(rows) > 1 else np.zeros(0, dtype=bool)
    last = len(rows) - 1
    for k in range(len(rows)):
        if not (0 < k < last and still[k - 1] and still[k]):
            yield span[0] + k


def _group(trace: Trace, actor: int, spec: ModelSpec) -> Xosc:
    name, span = trace.actors[actor].id, present(trace, actor)
    if span is None:
        return None

    def position(frame: int) -> Xosc:
        x, y, heading_rad = (float(value) for value in trace.states[frame, actor, [X, Y, HEADING]])
        return reference_position(x, y, math.remainder(heading_rad, math.tau), spec)

    def at(frame: int) -> Xosc:
        return at_time("time", float(trace.time_s[frame]))

    first, last = span
    events = []
    frames = list(vertices(trace, actor))
    rows = trace.states[first : last + 1, actor][:, [X, Y, HEADING]]
    if first > 0:
        events.append(event(f"{name}_comes", {"comes": osc.AddEntityAction(name, position(first))}, at(first)))
    if len(frames) > 1 and np.ptp(rows, axis=0).max() >= STANDS_M:
        line = osc.Trajectory(f"{name}_trajectory", False)
        line.add_shape(osc.Polyline([figure(trace.time_s[k]) for k in frames], [position(k) for k in frames]))
        follow = osc.FollowTrajectoryAction(line, osc.FollowingMode.position, osc.ReferenceContext.absolute, 1, 0)
        events.append(event(f"{name}_goes", {"goes": follow}, at(first)))
    if last < trace.frames - 1:
        events.append(event(f"{name}_leaves", {"leaves": osc.DeleteEntityAction(name)}, at(last + 1)))
    return maneuver_group(name, events) if events else None
