"""Compares the allocations of mutants: failures, findings and avoidable findings of equal campaigns.

    python plugins/foresee-study/evaluation/allocations.py --half odd --driver pdm --ranker foresee --seed 0

The campaigns share a store, so test cases, clips and equal mutants are run once. A simulated hour is one of clips and
mutants, the repeated runs of the second level included; findings are those of mutants. The figures of
docs/background/method.md are from here.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import replace
from pathlib import Path

from foresee_study.halves import Half, of_half

from foresee_dsl.campaign.assembly import assemble
from foresee_dsl.campaign.execution.engine import run_missing
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import Allocation, CampaignSettings
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.derive.clipping.clip import DRIVES_S
from foresee_dsl.drivers.registry import handover_of, load_driver
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.story import ContactClass

SCENARIOS = Path(__file__).parents[3] / "scenarios"
ALLOCATIONS: tuple[Allocation, ...] = ("even", "adaptive", "stories")
AGAINST = ("idm", "pdm+ideal")
"""Reference drivers. Ours: those that take least time."""
_COUNTED = frozenset({"clip", "check", "child"})
"""The kinds of runs that simulated time is of."""
_SECOND_LEVEL = re.compile(r"_m\d+_m\d+$")


def result_of(settings: CampaignSettings, half: Half, out: Path, jobs: int) -> tuple[CampaignResult, float]:
    """Run the campaign of one half of the test cases, without minimising its findings.

    Returns:
        The result, and the simulated time of its clips and mutants, s: also of mutants that do not count because their
        clip fails or deviates.
    """
    work = out / "work"
    work.mkdir(parents=True, exist_ok=True)
    with Store(out / "store") as store:
        stages = Stages(of_half(load_test_cases([SCENARIOS]), half), settings, store, out)
        end = run_missing(stages, work=work, store=store, options=RunOptions(jobs=jobs), minimise=False)
        result, _ = assemble(stages, out)
        runs = {row.key: row.simulated_s for node, row in stages.walk() if row and node.step.kind in _COUNTED}
    return replace(result, interrupted=end.stopped, broken=end.broken), sum(runs.values())


def row(result: CampaignResult, simulated_s: float) -> str:
    """Return the figures of a campaign as a row of a table; `simulated_s`: see `result_of`."""
    children = {child.name: child for clip in result.clips for child in clip.children}
    second = {(child.round, child.drawn_near) for name, child in children.items() if _SECOND_LEVEL.search(name)}
    repeated_s = sum(children[name].duration_s for _, name in second)
    hours = (simulated_s + repeated_s) / 3600
    findings = [finding for finding in result.findings if isinstance(finding.representative, ChildOutcome)]
    avoidable = sum(finding.avoidable for finding in findings)
    steered = sum(finding.story.contact is ContactClass.STRUCK_BY_STEERED for finding in findings)
    failures = sum(child.verdict.is_failure for child in children.values())
    cells = (result.settings.allocation, len(children), failures, len(findings), avoidable, f"{hours:.2f}",
             f"{len(findings) / hours:.1f}", f"{avoidable / hours:.1f}", f"{steered} of {len(findings)}")  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    """Run the campaigns and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--half", type=Half, default=Half.ODD)
    for option, default in (("driver", "pdm"), ("ranker", "foresee"), ("preset", "focused")):
        parser.add_argument(f"--{option}", default=default)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--risky-points", type=int, default=CampaignSettings.risky_points)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/allocations"))
    options = parser.parse_args()
    settings = CampaignSettings(
        driver=options.driver, ranker=options.ranker, preset=options.preset, seed=options.seed,
        risky_points=options.risky_points,
        handover_s=handover_of(load_driver(options.driver), 5.0 - DRIVES_S),
        against=tuple(name for name in AGAINST if name != options.driver),
    )  # fmt: skip
    columns = ("allocation", "children", "failures", "findings", "avoidable", "hours", "findings an hour",
               "avoidable an hour", "steered into it")  # fmt: skip
    sys.stdout.write(f"| {' | '.join(columns)} |\n")
    for allocation in ALLOCATIONS:
        result, simulated_s = result_of(
            replace(settings, allocation=allocation), options.half, options.out, options.jobs
        )
        sys.stdout.write(f"{row(result, simulated_s)}\n")


if __name__ == "__main__":
    main()
