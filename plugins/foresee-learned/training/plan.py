"""The plan of recordings: the drawn cases and the drives through towns, with their seeds and disturbances.

The plan is a function of hours and seed. It contains no bundled test case: the meanings are compared.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from foresee_dsl.errors import InputError
from foresee_dsl.exchange.outcome import write_text
from foresee_dsl.files import data_folder
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.addresses import scenario_files
from foresee_dsl.language.project.loading import Project, load_test_cases
from foresee_dsl.language.sampling import draw
from training.driving import Disturbance
from training.towns import drive, net_of, town_names

RUN_S = {"cases": 45.0, "towns": 62.0}
"""Mean duration of a run, s (measured on the first thousand)."""
TOWN_SHARE = 0.5
CARLA_WEIGHT = 2.0
"""Ratio of the numbers of drives in a CARLA town and in a generated one."""
CHUNK = 24
FOCUS = 3
"""Factor on the number of drawn cases for scenarios in focus."""
DRAW_SEED = 5_000_000
"""Smallest seed of drawn cases; bundled files and examples have smaller ones."""
STARTS, BURSTS = 0.5, 0.65
"""Shares of the runs whose start and whose controls are disturbed."""
_PLACES = ("arm", "junction", "turn", "stage")
"""Types of parameters of which only few combinations of values are possible."""


@dataclass(frozen=True)
class Item:
    """One run.

    Attributes:
        address: of the test case. family: "3" to "9", or a town's name.
    """

    address: str
    family: str
    seed: int
    disturbance: Disturbance


def bundled_meanings(scenarios: Path | None = None) -> frozenset[str]:
    """Return the meanings of all bundled test cases."""
    folder = scenarios or data_folder("scenarios")
    return frozenset(case.meaning for case in load_test_cases([folder]))


def drawn_cases(
    work: Path, count: int, seed: int, scenarios: Path | None = None, focus: Sequence[str] = ()
) -> dict[str, list[str]]:
    """Write files with drawn cases of all bundled scenarios, and return the addresses by family.

    `count`: number of cases per family; more with a `focus` (names of scenario files). Cases with the meaning of a
    bundled test case are found when they are loaded.
    """
    folder = scenarios or data_folder("scenarios")
    files: dict[str, list[Path]] = defaultdict(list)
    for file in scenario_files([folder]):
        name = file.stem if file.parent == folder else file.parent.name
        if name.startswith("scenario"):
            files[name.removeprefix("scenario")].append(file)
    by_scenario: dict[str, list[str]] = defaultdict(list)
    for family, members in sorted(files.items()):
        each = -(-count // len(members))
        for file in sorted(members):
            out = work / "cases" / f"{file.parent.name}_{file.stem}.foresee"
            names = _write_cases(file, out, each * (FOCUS if file.stem in focus else 1), DRAW_SEED + seed)
            by_scenario[family] += [f"{out.as_posix()}::{name}" for name in names]
    return dict(by_scenario)


def _write_cases(file: Path, out: Path, count: int, seed: int) -> list[str]:
    """Write an extension of a scenario with drawn cases, and return their names.

    Values are drawn as for `cases ... from seed`, except roads, junctions, turns and stages: independent ones rarely
    fit together, so each case has those of a bundled case.
    """
    scenario = Project().whole_scenario(file, drawn=True)
    templates = [case_values(scenario, case) for case in scenario.all(m.Case)]
    kept = {param.name for param in scenario.all(m.Param) if param.type in _PLACES}
    drawn = draw(scenario, m.Cases(count=m.Quantity.of(count, "count", 0), seed=m.Quantity.of(seed, "count", 0)))
    cases = []
    for k, case in enumerate(drawn):
        values = dict(case_values(scenario, case))
        values |= {name: templates[k % len(templates)][name] for name in kept}
        assignments = tuple(m.Assignment(name=name, value=value) for name, value in values.items())
        cases.append(m.Case(name=f"drawn_{k:03d}", values=assignments))
    body = tuple(m.Add(item=case) for case in cases)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_text(out, m.Extension(name=f"drawn_{file.stem}", parent=file.resolve().as_posix(), body=body))
    return [case.name for case in cases]


def town_drives(work: Path, count: int, seed: int, carla: Path | None) -> dict[str, list[str]]:
    """Write scenarios of drives through all towns, and return their files by town; `count`: total number."""
    towns = town_names(carla)
    weights = np.array([CARLA_WEIGHT if town.startswith("Town") else 1.0 for town in towns])
    by_town: dict[str, list[str]] = {}
    for k, town in enumerate(towns):
        net = net_of(town, work / "towns", carla, seed=100 + k)
        rng = np.random.Generator(np.random.PCG64([seed, k]))
        each = round(count * float(weights[k] / weights.sum()))
        drives = (drive(net, f"{town.lower()}_{n:04d}", work / "towns" / town, rng) for n in range(each))
        by_town[town] = [file.as_posix() for file in drives]
    return by_town


def plan(
    hours: float,
    seed: int,
    work: Path,
    *,
    carla: Path | None,
    scenarios: Path | None = None,
    bursts: float = BURSTS,
    focus: Sequence[str] = (),
    chunk: int = CHUNK,
    towns: float = TOWN_SHARE,
) -> tuple[tuple[Item, ...], ...]:
    """Return the runs in pieces, each of which is recorded into one file; all runs of a piece have the same network."""
    seconds = hours * 3600.0
    cases = drawn_cases(work, round(seconds * (1 - towns) / RUN_S["cases"] / 5), seed, scenarios, focus)
    drives = town_drives(work, round(seconds * towns / RUN_S["towns"]), seed, carla)
    rng = np.random.Generator(np.random.PCG64([seed, 777]))
    pieces: list[tuple[Item, ...]] = []
    mixed = [(family, address) for family, addresses in sorted(cases.items()) for address in addresses]
    order = rng.permutation(len(mixed)).tolist()
    pieces += _pieces([_item(*mixed[k], rng, bursts) for k in order], chunk)
    for town, addresses in drives.items():
        pieces += _pieces([_item(town, address, rng, bursts) for address in addresses], chunk)
    return tuple(pieces)


def _item(family: str, address: str, rng: np.random.Generator, bursts: float) -> Item:
    disturbance = Disturbance(bool(rng.random() < STARTS), bool(rng.random() < bursts), float(rng.uniform(5.0, 12.0)))
    return Item(address, family, int(rng.integers(1, 2**31)), disturbance)


def _pieces(items: Sequence[Item], chunk: int) -> Iterable[tuple[Item, ...]]:
    for k in range(0, len(items), chunk):
        yield tuple(items[k : k + chunk])


def loaded(project: Project, item: Item, bundled: frozenset[str]) -> TestCase | None:
    """Load a run's test case; None if its values are impossible, or if it has the meaning of a bundled test case."""
    try:
        case = project.test_case(item.address)
    except InputError:
        return None
    return None if case.meaning in bundled else case
