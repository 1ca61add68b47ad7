"""The campaign: seeds are run, failing ones set aside, the others forecast, clipped, mutated; what fails is kept."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from foresee_dsl.campaign.folder import CampaignFolder
from foresee_dsl.campaign.pool import Broken, Task, WorkerPool
from foresee_dsl.campaign.results import CampaignResult, ClipOutcome, SeedOutcome, sorted_outcomes
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps import case_name
from foresee_dsl.campaign.tasks import ClipTask, SeedTask, run_clip, run_seed
from foresee_dsl.compile import placement_mistakes
from foresee_dsl.errors import InputError
from foresee_dsl.language.document import TestCase


class Listener(Protocol):
    """What is told while a campaign runs (a progress bar)."""

    def seeds(self, total: int) -> None:
        """So many test cases will be run."""

    def seed_done(self, outcome: SeedOutcome, clips: int) -> None:
        """One is done, and gave so many clips."""

    def clip_done(self, outcome: ClipOutcome) -> None:
        """One clip and its children are done."""

    def broken(self, what: str) -> None:
        """Something could not be run."""


def run_campaign(
    cases: Sequence[TestCase], settings: CampaignSettings, *, out: Path, jobs: int, listener: Listener
) -> CampaignResult:
    """Run a whole campaign and write its folder.

    Args:
        cases: the test cases, already loaded (so that mistakes show before anything runs).
        settings: what to do.
        out: the campaign's folder; its `children` and `traces` are replaced, all at once, at the end.
        jobs: worker processes; the result does not depend on it.
        listener: is told of progress.

    Returns:
        The result; after Ctrl-C, with what was finished and `interrupted` set.

    Raises:
        InputError: a test case is impossible on its network; nothing was run or written.
    """
    started = time.monotonic()
    mistakes = placement_mistakes(cases)
    if mistakes:
        raise InputError(mistakes)
    folder = CampaignFolder(out)
    seeds: list[SeedOutcome] = []
    clips: list[ClipOutcome] = []
    broken: list[str] = []
    interrupted = False
    pool = WorkerPool(jobs)
    listener.seeds(len(cases))
    try:
        with folder.working() as work:
            pool.add(Task(t.address, run_seed, t) for t in seed_tasks(cases, settings, out, work))
            try:
                for task, outcome in pool.results():
                    if isinstance(outcome, Broken):
                        broken.append(f"{task.name}: {outcome.reason}")
                        listener.broken(broken[-1])
                    elif isinstance(outcome, SeedOutcome):
                        seeds.append(outcome)
                        more = _clip_tasks(task, outcome)
                        pool.add(more)
                        listener.seed_done(outcome, len(more))
                    elif isinstance(outcome, ClipOutcome):
                        clips.append(outcome)
                        listener.clip_done(outcome)
            except KeyboardInterrupt:
                interrupted = True
            finally:
                pool.close()
            ordered = sorted_outcomes(seeds, clips)
            result = CampaignResult(settings, *ordered, time.monotonic() - started, interrupted, tuple(sorted(broken)))
            folder.publish(result)
    finally:
        pool.close()
    return result


def seed_tasks(cases: Sequence[TestCase], settings: CampaignSettings, out: Path, work: Path) -> list[SeedTask]:
    """Return a task for each test case, with a name of its own for its files.

    The name is the scenario's and the case's (`red_light_runner_r02`); when two files hold scenarios of one name, a
    number follows.
    """
    owners: dict[str, str] = {}
    tasks = []
    for case in cases:
        base = case_name(case)
        name, number = base, 2
        while owners.setdefault(name, case.id) != case.id:
            name, number = f"{base}_{number}", number + 1
        tasks.append(SeedTask(case.id, name, f"children/{case.source.stem}", out, work, settings))
    return tasks


def _clip_tasks(task: Task, outcome: SeedOutcome) -> list[Task]:
    seed = task.argument
    if not isinstance(seed, SeedTask):
        return []
    return [Task(draft.name, run_clip, ClipTask(seed, outcome.family, outcome.trace, draft)) for draft in outcome.clips]
