"""Writes a test case as OpenSCENARIO XML 1.2 with an OpenDRIVE map, so that other simulators can play it."""

from __future__ import annotations

import datetime
from collections import Counter
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.driving import case_name, run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.registry import recorded_address
from foresee_dsl.exchange.maps.opendrive_out import opendrive_of
from foresee_dsl.exchange.openscenario.weather import environment
from foresee_dsl.exchange.openscenario.writing import behaviour as openscenario_behaviour
from foresee_dsl.exchange.openscenario.writing import trajectories as openscenario_trajectories
from foresee_dsl.exchange.openscenario.writing.library import MINOR_VERSION, at_time, library
from foresee_dsl.exchange.openscenario.writing.participants import entities, init
from foresee_dsl.exchange.openscenario.writing.signals import add_signals
from foresee_dsl.exchange.outcome import ExchangeError, Imported, write_together
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult

_DATE = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
"""The header asks for a date; a constant, so that the same test case gives the same bytes."""

_LATER_S = 2.0
"""A failure's file ends so much later than the run, which ended with it: driven by somebody else it may take longer
(ours)."""


def run(
    address: str,
    *,
    out: Path,
    behaviour: bool = False,
    driver: str = "",
    seed: int | None = None,
    allow_outside: bool = True,
) -> Imported:
    """Write `NAME.xosc` and `NAME.xodr` for a test case, a clip or a mutant. It is run for that.

    Args:
        address: `FILE` or `FILE::CASE`.
        out: the folder.
        behaviour: what actors do and when, as far as it can be expressed; otherwise where they went.
        driver, seed: of the run; by default what a mutant records, else `pdm` and 0.
        allow_outside: see `project.load_test_case`.

    Raises:
        ExchangeError: the package scenariogeneration is missing, or `out` cannot be written.
        InputError, CompileError, DriverError: the test case cannot be run.
    """
    library()
    case = load_test_case(address, allow_outside=allow_outside)
    driver, seed = _as_recorded(case, driver, seed)
    bundle = compile_test_case(case)
    result = run_test_case(case, driver, seed)
    trace = result.trace
    name = case_name(case)
    left_out: Counter[str] = Counter()
    road = opendrive_of(case.network, bundle.net_file)
    end_s = trace.duration_s + (_LATER_S if result.verdict.is_failure else 0.0)
    network = library().RoadNetwork(f"{name}.xodr")
    left_out["signals (the map has no heads for them)"] += add_signals(network, bundle, road, end_s)
    document = _document(case, bundle, result, network, end_s, behaviour=behaviour, left_out=left_out)

    def write(folder: Path) -> None:
        (folder / f"{name}.xodr").write_bytes(road)
        document.write_xml(str(folder / f"{name}.xosc"))

    files = write_together(out, write)
    kinds = Counter(info.kind for info in trace.actors)
    taken = {f"of class {kind}": count for kind, count in sorted(kinds.items())}
    notes = (f"driven by {driver}: {result.reason}",)
    return Imported(files=files, cases=1, taken=taken, left_out=+left_out, notes=notes)


def _as_recorded(case: TestCase, driver: str, seed: int | None) -> tuple[str, int]:
    """Return the driver and the seed of the run: what is named, else what the mutant records."""
    origin = case.mutant.origin if case.mutant is not None else None
    if not driver:
        driver = recorded_address((origin.driver if origin else None) or "pdm")
        if ":" in driver:  # a file that somebody sends must not run a command by being exported
            raise ExchangeError(f"recorded with a program as its driver ({driver}): name it with --driver, or another")
    if seed is None:
        seed = int(origin.seed.value) if origin and origin.seed else 0
    return driver, seed


def _document(
    case: TestCase,
    bundle: SumoBundle,
    result: RunResult,
    network: Any,  # noqa: ANN401 - the library has no types
    end_s: float,
    *,
    behaviour: bool,
    left_out: Counter[str],
) -> Any:  # noqa: ANN401 - the library has no types
    osc = library()
    trace = result.trace
    specs = {actor.id: actor.model for actor in bundle.scene.actors}
    board = osc.StoryBoard(init(trace, specs, environment(bundle.scene)), at_time("end", end_s, "stop"))
    if behaviour:
        groups = openscenario_behaviour.groups(bundle, trace, left_out)
    else:
        groups = openscenario_trajectories.groups(trace, specs)
    if groups:
        board.add_story(_story(groups))
    _count(bundle, left_out)
    return osc.Scenario(
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


def _story(groups: list[Any]) -> Any:  # noqa: ANN401 - as above
    osc = library()
    act = osc.Act("act", at_time("begin", 0.0))
    for group in groups:
        act.add_maneuver_group(group)
    story = osc.Story("story", osc.ParameterDeclarations())
    story.add_act(act)
    return story


def _count(bundle: SumoBundle, left_out: Counter[str]) -> None:
    """Count what a file of OpenSCENARIO has no place for."""
    left_out["expectations"] += len(bundle.scene.expects)
    left_out["buildings (they only hide things)"] += len(bundle.network.buildings)
