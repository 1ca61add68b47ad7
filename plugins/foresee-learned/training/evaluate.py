"""Evaluates drivers on cases without training: `python -m training.evaluate --driver fusion --weights FOLDER --jobs 2`.

Three parts: `plain`, the bundled test cases; `town10`, CARLA's routes in Town10HD; `alone`, drives without other actors
in every CARLA town, of which Town02 and Town10HD are held out. The runs use the machinery of `foresee assess`.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from foresee_exchange.carla import importer

from foresee_dsl.campaign.assessment import DriverRun, assess_drivers
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict
from training.record import CARLA
from training.towns import CARLA_HELD_OUT, CARLA_TRAINED, drive

PARTS = ("plain", "town10", "alone")
_SEED = 424242


def row(name: str, runs: Sequence[DriverRun]) -> dict[str, object]:
    """Return the figures of some runs."""
    verdicts = Counter(run.verdict for run in runs)
    failed = sum(count for verdict, count in verdicts.items() if verdict.is_collision)
    off_road = sum("left the drivable area" in run.reason for run in runs)
    seconds = sum(run.duration_s for run in runs)
    return {
        "part": name,
        "runs": len(runs),
        "arrived": round(verdicts[Verdict.PASS] / len(runs), 3),
        "failed": round(failed / len(runs), 3),
        "off_road": round(off_road / len(runs), 3),
        "verdicts": {verdict.value: count for verdict, count in sorted(verdicts.items())},
        "mean_mps": round(sum(run.way_m for run in runs) / seconds, 2) if seconds else 0.0,
        "step_ms": round(sum(run.step_ms * run.duration_s for run in runs) / seconds, 3) if seconds else 0.0,
    }


def addresses(part: str, work: Path, carla: Path, count: int) -> dict[str, list[str]]:
    """Return the test cases of a part, by their name in the table; `count`: number of drives alone in each town."""
    if part == "plain":
        return {"plain": [case.id for case in load_test_cases([data_folder("scenarios")]) if not case.snapshot]}
    if part == "town10":
        out = work / "town10"
        if not out.is_dir():
            routes = sorted(carla.glob("routes/Scenario*/Town10HD_*.xml"))
            triggers = sorted(carla.glob("scenarios/Scenario*/Town10HD_*.json"))
            importer.run(carla / "maps" / CARLA_HELD_OUT["Town10HD"], routes, triggers, out=out)
        return {"town10": [case.id for case in load_test_cases([out])]}
    by_name = {}
    for town, file in {**CARLA_TRAINED, **CARLA_HELD_OUT}.items():
        rng = np.random.Generator(np.random.PCG64([_SEED, sum(town.encode())]))
        folder = work / "alone" / town
        drives = [
            drive(carla / "maps" / file, f"{town.lower()}_alone_{k:03d}", folder, rng, alone=True) for k in range(count)
        ]
        held_out = " (held out)" if town in CARLA_HELD_OUT else ""
        by_name[f"alone {town}{held_out}"] = [path.as_posix() for path in drives]
    return by_name


def rows(driver: str, named: dict[str, list[str]], jobs: int, every: int = 1) -> Iterable[dict[str, object]]:
    """Run all test cases (or every n-th), and yield the rows of each name and of each family within it."""
    for name, chosen in named.items():
        cases = load_test_cases(chosen[::every])
        runs = assess_drivers(cases, [driver], jobs=jobs)
        yield {"driver": driver, **row(name, runs)}
        families = sorted({run.family for run in runs})
        if len(families) > 1:
            for family in families:
                yield {"driver": driver, **row(f"{name}, family {family}", [r for r in runs if r.family == family])}
        failures = [f"{Path(run.case).name}: {run.verdict.value} {run.reason}" for run in runs if not run.passed]
        yield {"driver": driver, "part": f"{name}, not arrived", "cases": failures}


def main() -> None:
    """Read the command line, run, and print a line of JSON for each row."""
    parser = argparse.ArgumentParser(
        prog="python -m training.evaluate", description="Drive where no driver was trained."
    )
    parser.add_argument("--driver", action="append", required=True, help="name of an installed driver; repeatable")
    parser.add_argument("--weights", type=Path, help="folder of weights (FORESEE_WEIGHTS)")
    parser.add_argument("--part", action="append", choices=PARTS, help="default: all three")
    parser.add_argument("--alone", type=int, default=15, help="drives alone in each town")
    parser.add_argument("--every", type=int, default=1, help="only every so manieth test case")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--work", type=Path, default=Path("out") / "evaluate", help="folder for imported towns")
    parser.add_argument("--carla", type=Path, default=CARLA, help="folder of CARLA's maps")
    options = parser.parse_args()
    if options.weights is not None:
        os.environ["FORESEE_WEIGHTS"] = str(options.weights.resolve())
    for part in options.part or PARTS:
        named = addresses(part, options.work, options.carla, options.alone)
        for driver in options.driver:
            for row in rows(driver, named, options.jobs, options.every):
                print(json.dumps(row), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
