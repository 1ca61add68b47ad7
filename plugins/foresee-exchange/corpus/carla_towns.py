"""CARLA's towns, imported and driven, for tests; and a table of all towns.

`python -m corpus.carla_towns` in the checkout prints the table (some minutes); it needs CARLA's files.
"""

from __future__ import annotations

import dataclasses
import re
import sys
import tempfile
from pathlib import Path

from foresee_exchange.carla import importer as carla_import
from rich.console import Console

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Ego, End, Expect, Predicate, Scenario, Traffic
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run

MAPS = {
    "Town10HD": "xodr/Town10HD.xodr",
    "Town01": "xodr/Town01.xodr",
    "Town02": "xodr/Town02.xodr",
    "Town03": "net/Town03.net.xml",
}


def import_town(carla: Path, town: str, out: Path) -> Imported:
    """Import the five families of a town."""
    routes = sorted(carla.glob(f"routes/*/{town}_*.xml"))
    triggers = sorted(carla.glob(f"scenarios/*/{town}_*.json"))
    return carla_import.run(carla / "maps" / MAPS[town], routes, triggers, out=out)


def cases_of(out: Path) -> dict[str, list[TestCase]]:
    """Return the test cases of a folder by family."""
    cases: dict[str, list[TestCase]] = {}
    for case in load_test_cases([out]):
        cases.setdefault(case.scenario.family, []).append(case)
    return cases


def alone(case: TestCase, net: Path) -> TestCase:
    """Return a test case with the ego as its only actor, on another net."""
    arrives = Expect(mode="eventually", condition=Predicate(what="arrived", actor="ego"))
    items = tuple(item for item in case.scenario.body if isinstance(item, Ego | End))
    scenario = Scenario(name=case.scenario.name, body=(*items, arrives))
    return dataclasses.replace(case, scenario=scenario, network=net)


def without_traffic(case: TestCase) -> TestCase:
    """Return a test case without background traffic, which takes most of the time of compiling."""
    items = tuple(item for item in case.scenario.body if not isinstance(item, Traffic))
    return dataclasses.replace(case, scenario=Scenario(name=case.scenario.name, body=items))


def with_signals_off(net: Path, out: Path) -> Path:
    """Write a copy of a net whose signals are off (SUMO's `O`), and return its path."""
    text = net.read_text(encoding="utf-8")
    off = re.sub(r'(<phase [^>]*state=")([^"]*)"', lambda m: f'{m.group(1)}{"O" * len(m.group(2))}"', text)
    out.write_text(off, encoding="utf-8")
    return out


def drive_alone(case: TestCase, net: Path) -> RunResult:
    """Drive a route without other actors."""
    return run(compile_test_case(alone(case, net)), load_driver("idm"))


def passages(bundle: SumoBundle) -> list[Passage]:
    """Return the junctions between the ego's start and its goal."""
    ego = bundle.scene.actors[0]
    assert ego.line is not None
    start, goal = bundle.scene.start_s, bundle.scene.goal_s
    return [p for p in ego.line.passages if p.exit_s > start and p.entry_s < goal]


def main() -> None:
    """Print for each town the number of routes on which the ego arrives, and their lengths."""
    say = Console(highlight=False).print
    carla = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[3].parent / "shared" / "data" / "carla"
    for town in sys.argv[2:] or MAPS:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            done = import_town(carla, town, folder / "out")
            cases = [case for group in cases_of(folder / "out").values() for case in group]
            bundles = [compile_test_case(without_traffic(case)) for case in cases]
            lengths = [bundle.scene.goal_s - bundle.scene.start_s for bundle in bundles]
            off = with_signals_off(bundles[0].net_file, folder / "off.net.xml")
            results = [drive_alone(case, off) for case in cases]
            arrived = sum(result.verdict == "pass" for result in results)
            say(f"{town}: {done.cases} cases, {arrived} arrive alone, {min(lengths):.0f} to {max(lengths):.0f} m")
            for case, result in zip(cases, results, strict=True):
                if result.verdict != "pass":
                    say(f"  {Path(case.id).name}: {result.verdict}")


if __name__ == "__main__":
    main()
