"""Runs the campaigns that questions need, each once, into one store; stored results are not computed again."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.campaign.execution.engine import Listener, run_missing
from foresee_dsl.campaign.settings import Shard
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.forecast.protocol import Learned
from foresee_dsl.forecast.registry import RANKERS, load_ranker
from foresee_dsl.language.document import TestCase
from foresee_study.complementing import complement
from foresee_study.folder import Cost, StudyFolder
from foresee_study.fuzz.engine import fuzz
from foresee_study.fuzz.settings import FuzzSettings
from foresee_study.fuzzed import Fuzzed, fuzzed
from foresee_study.measured import MeasuredCampaign
from foresee_study.measuring import measure
from foresee_study.questions import wanted_by
from foresee_study.search.searches import SEARCHES
from foresee_study.search.stages import SearchStages
from foresee_study.settings import BUNDLED, StudyCampaign, StudySettings

Cases = Mapping[str, Sequence[TestCase]]
"""The test cases of each group."""


@dataclass(frozen=True)
class StudyRun:
    """The result of a study run.

    Attributes:
        costs: the cost of each question that is answered completely.
        broken: runs that could not be done, in words.
        interrupted: whether the study was stopped.
    """

    costs: dict[str, Cost]
    interrupted: bool
    broken: tuple[str, ...]


def possible(settings: StudySettings) -> tuple[StudySettings, tuple[str, ...]]:
    """Return the settings without the drivers and rankers that are not installed, and a note on each that is left out.

    Raises:
        ForeseeError: no driver, or no ranker, is left.
    """
    installed = RANKERS.names()
    rankers = tuple(name for name in settings.rankers if name in installed)
    notes = [f"ranker {name}: left out, because it is not installed" for name in settings.rankers
             if name not in installed]  # fmt: skip
    drivers = []
    for driver in settings.drivers:
        try:
            load_driver(driver)
        except DriverError as err:
            notes.append(f"driver {driver}: left out ({err})")
        else:
            drivers.append(driver)
    for what, left in (("driver", drivers), ("ranker", rankers)):
        if not left:
            raise ForeseeError(f"no {what} is left to study: {'; '.join(notes)}")
    return replace(settings, drivers=tuple(drivers), rankers=rankers), tuple(notes)


def watched(wanted: Iterable[StudyCampaign]) -> tuple[tuple[StudyCampaign, ...], tuple[str, ...]]:
    """Return the campaigns whose ranker has weights for their driver, and a note on each pair that is left out."""
    kept, notes = [], {}
    for campaign in wanted:
        if campaign.budget_s is not None:
            kept.append(campaign)
            continue
        ranker = load_ranker(campaign.ranker)
        try:
            if isinstance(ranker, Learned):
                ranker.weights_hash(campaign.driver)
            kept.append(campaign)
        except ForeseeError as err:
            notes[campaign.ranker, campaign.driver] = f"{campaign.ranker} with {campaign.driver}: left out ({err})"
    return tuple(kept), tuple(notes.values())


def stages_of(
    wanted: StudyCampaign,
    cases: Sequence[TestCase],
    store: Store | None,
    out: Path,
    shard: Shard = Shard(),  # noqa: B008
) -> Stages:
    """Return the steps of a campaign: those of a ranker's clips, or those of a search.

    Raises:
        DriverError: there is no such driver.
    """
    if wanted.budget_s is None:
        return Stages(cases, wanted.campaign(), store, out, shard)
    search = SEARCHES[wanted.ranker]
    return SearchStages(cases, wanted.campaign(), store, out, shard, search=search, budget_s=wanted.budget_s)


def run_study(
    names: Sequence[str],
    settings: StudySettings,
    cases: Cases,
    folder: StudyFolder,
    *,
    store: Store,
    listeners: Sequence[Listener] = (),
    options: RunOptions = RunOptions(),  # noqa: B008 - immutable
    say: Callable[[str], None] = lambda _: None,
) -> StudyRun:
    """Run the campaigns that questions need and that are not stored, and keep the measurements of each.

    Args:
        names: the questions.
        settings: as `possible` returns them.
        cases: the test cases by group.
        folder: the study's folder.
        store: the store of the runs.
        listeners, options: as for a campaign.
        say: is called with the name of each campaign before it runs.

    Raises:
        InputError: a test case is impossible on its network.
        StoreError: the store cannot be written any more; it contains the finished runs.
    """
    folder.at.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(prefix=".work-", dir=folder.at))
    run = _Run(settings, cases, folder, store, listeners, options, say, work)
    try:
        stopped = not all(run.answered(name) for name in names)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return StudyRun(run.costs, stopped, tuple(run.broken))


class _Run:
    """The progress of a study's run."""

    def __init__(
        self, settings: StudySettings, cases: Cases, folder: StudyFolder, store: Store, listeners: Sequence[Listener],
        options: RunOptions, say: Callable[[str], None], work: Path,
    ) -> None:  # fmt: skip
        self._settings, self._cases, self._folder, self._store = settings, cases, folder, store
        self._listeners, self._options, self._say, self._work = listeners, options, say, work
        self._done: dict[StudyCampaign, MeasuredCampaign] = {}
        budget_s = options.limits.budget_s
        self._ends_s = None if budget_s is None else time.monotonic() + budget_s
        self.costs: dict[str, Cost] = {}
        self.broken: list[str] = []

    def answered(self, name: str) -> bool:
        """Run the campaigns of a question; return whether all of them were completed."""
        started = time.monotonic()
        wanted, _ = watched(wanted_by([name], self._settings))
        for k, campaign in enumerate(wanted):
            if self._campaign(campaign, self._cases[campaign.group], f"{name} {k + 1}/{len(wanted)}") is None:
                return False
        if name == "rq4" and not complement(
            self._settings, self._cases[BUNDLED], fuzzes=self._fuzzed, forecasts=self._campaign
        ):
            return False
        self.costs[name] = Cost(round(time.monotonic() - started, 1), self._options.jobs)
        return True

    def _campaign(
        self, wanted: StudyCampaign, cases: Sequence[TestCase], place: str = "rq4"
    ) -> MeasuredCampaign | None:
        """Run a campaign and keep its measurements; None if it was stopped. Equal campaigns are run only once."""
        if wanted in self._done:
            return self._done[wanted]
        self._say(f"{place}: {wanted.driver}, {wanted.ranker}, clips of {wanted.clip_s:g} s, seed {wanted.seed}, "
                  f"{wanted.group}, {wanted.preset}")  # fmt: skip
        stages = stages_of(wanted, cases, self._store, self._folder.at, self._options.shard)
        ran = run_missing(stages, work=self._work, store=self._store, listeners=self._listeners,
                          options=self._time_left(), minimise=False)  # fmt: skip
        self.broken += ran.broken
        measured = measure(stages, self._store, wanted)
        self._folder.keep(wanted, measured)
        if ran.stopped:
            return None
        self._done[wanted] = measured
        return measured

    def _fuzzed(
        self, settings: FuzzSettings, cases: Sequence[TestCase], repetition: int, iteration: int
    ) -> Fuzzed | None:
        """Run one iteration of DriveFuzz and keep its summary; None if it was stopped."""
        self._say(f"rq4: {settings.driver}, DriveFuzz, iteration {iteration}, {len(cases)} test cases, "
                  f"seed {settings.seed}")  # fmt: skip
        result = fuzz(cases, settings, out=self._work / "fuzzed", store=self._store, listeners=self._listeners,
                      options=self._time_left())  # fmt: skip
        self.broken += result.broken
        record = fuzzed(result, {case.id: case for case in cases}, repetition=repetition, iteration=iteration)
        self._folder.keep_fuzzed(record)
        return None if result.interrupted else record

    def _time_left(self) -> RunOptions:
        if self._ends_s is None:
            return self._options
        left_s = max(self._ends_s - time.monotonic(), 0.0)
        return replace(self._options, limits=replace(self._options.limits, budget_s=left_s))
