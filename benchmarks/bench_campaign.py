"""The campaign engine: its overhead per run, and the time to resume a finished campaign of the paper's size.

The runs do nothing: the real engine passes the real tasks to real worker processes, which return invented results.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.figures import Figure, peak_mb
from foresee_dsl.campaign import records
from foresee_dsl.campaign.driving import relative_path
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.case_run import CaseStep
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.clip import ClipStep
from foresee_dsl.campaign.steps.forecast import ForecastStep
from foresee_dsl.campaign.steps.inputs import load_case
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.step import AnyStep, StepResult, Work
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions, Task, WorkerPool
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict

CASES, REPEAT = 239, 9
"""Number of test cases and of repeats; with 4 risky points and 4 children they make 34,416 children, the number of
simulations in the paper's study."""
TRACE = bytes(range(256)) * 100
"""An invented trace of 26 kB, the median size of the trace of a child's run."""
_TEXT = (
    'foresee 1\n\n{kind} {name} of "{parent}"{case} pin sha256:0123456789ab {{\n}}\n' + "  # as long as usual\n" * 60
)
_SCENARIO = """foresee 1

scenario made_up {
  network road {
    junction a at (0 m, 0 m)
    junction b at (400 m, 0 m)
    road main from a to b { lanes 1; back 0 }
  }
  param begin: length = 20 m in 1 m..300 m step 1 m
  ego: car.sedan {
    route [main]
    start at begin along main
  }
  end after 10 s
"""


class Idle(WorkerPool):
    """Worker processes that do nothing."""

    def add(self, tasks: Iterable[Task], priority: tuple[int, ...] = ()) -> None:
        """Queue tasks with a function that does nothing in the place of theirs."""
        super().add((replace(task, function=made_up) for task in tasks), priority)


def figures() -> Iterator[Figure]:
    """Yield the time of the engine per run, ms, the time of a resume, s, and the peak memory, MB."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _campaign(folder / "warm", 1, 1)  # starts the fork server, which a campaign does once
        first_s, runs = _campaign(folder, CASES, REPEAT)
        again_s = min(_campaign(folder, CASES, REPEAT)[0] for _ in range(2))
        means = f"a campaign of {runs} runs that do nothing, 2 workers, less its resume; a run in four writes a trace"
        yield Figure("engine_ms_per_run", (first_s - again_s) / runs * 1000, "ms", means, 2.0)
        yield Figure("resume_s", again_s, "s", f"a finished campaign of {runs} runs: looked up, reported", 10.0)
        means = f"memory at most of the process that ran {runs} runs and resumed (earlier benchmarks' included)"
        yield Figure("parent_of_many_mb", peak_mb(), "MB", means)


def _campaign(folder: Path, cases: int, repeat: int) -> tuple[float, int]:
    folder.mkdir(exist_ok=True)
    file, out = folder / "made_up.foresee", folder / "out"
    lines = "".join(f"  case c{k} {{ begin = {k + 1} m }}\n" for k in range(cases))
    file.write_text(f"{_SCENARIO}{lines}}}\n", encoding="utf-8")
    settings = CampaignSettings(driver="idm", ranker="foresee", preset="focused", risky_points=4, repeat=repeat)
    options = RunOptions(jobs=2, executor=lambda how: Idle(how.jobs))
    began = time.perf_counter()
    with Store(out / "store") as store:
        result = run_campaign(load_test_cases([file]), settings, out=out, store=store, options=options)
    took_s = time.perf_counter() - began
    runs = len(result.seeds) + len(result.clips) + result.row().children
    if runs != cases + 4 * cases + 16 * repeat * cases:
        raise RuntimeError(f"{runs} runs, which is not the expected number")
    return took_s, runs


def made_up(work: Work) -> Iterator[StepResult]:
    """Yield results as a worker would, without any work."""
    for step in work.steps:
        record, trace = _result(step, work)
        yield StepResult(step.key, step.kind, step.name, record, TRACE + step.key.encode() if trace else None)


def _result(step: AnyStep, work: Work) -> tuple[records.Record, bool]:
    """Return the result of a step, and whether it has a trace."""
    match step:
        case CaseStep():
            return records.CaseRunOutcome(
                load_case(work.case).id, "", "made_up", verdict=Verdict.PASS, reason="made up", duration_s=10.0
            ), True
        case ForecastStep():
            return records.Forecast(9, tuple(_draft(step, work, rank) for rank in range(1, 5))), False
        case ClipStep():
            return records.ClipOutcome(
                seed="", family="", name=step.name, file="", text=step.draft.text, rank=step.rank, verdict=Verdict.PASS,
                reason="made up", duration_s=10.0, others_m=(0.0,) * 20,
            ), True  # fmt: skip
        case MutantsStep():
            again = f"_s{step.seed}" if step.seed else ""
            return records.Mutants(tuple(_mutant(step.name, again, number) for number in range(1, 5))), False
        case ChildStep():
            fails = step.name.endswith("1")
            return records.ChildOutcome(
                step.name, (work.folder / f"{step.name}.foresee").as_posix(), step.mutant.text, ("timing",),
                verdict=Verdict.F4 if fails else Verdict.PASS, with_="other", reason="made up", time_s=5.0,
                duration_s=10.0, digest="sha256:0123456789abcdef",
            ), fails  # fmt: skip
    raise TypeError(f"no result is made up for a {step.kind}")


def _draft(step: ForecastStep, work: Work, rank: int) -> records.Draft:
    name, case = f"{step.name}_p{rank}", step.name.rpartition("_")[2]
    parent = relative_path(work.folder.parents[2] / "made_up.foresee", work.folder)
    text = _TEXT.format(kind="clip", name=name, parent=parent, case=f" case {case}")
    return records.Draft(rank, text, name, f"sha256:{step.key[:11]}{rank}", "")


def _mutant(clip: str, again: str, number: int) -> records.MutantDraft:
    name = f"{clip}{again}_m{number}"
    text = _TEXT.format(kind="mutant", name=name, parent=f"{clip}.foresee", case="")
    return records.MutantDraft(number, text, f"made up {name}", f"_m{number}")
