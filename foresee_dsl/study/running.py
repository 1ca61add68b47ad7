"""Runs the campaigns that questions need, each once, into one store; what is there is not run again."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.campaign.execution.engine import Listener, run_missing
from foresee_dsl.campaign.execution.pool import RunOptions
from foresee_dsl.campaign.stages import Node, Stages
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.forecast.protocol import Learned
from foresee_dsl.forecast.registry import load_ranker, ranker_names
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.study.folder import StudyFolder, Took
from foresee_dsl.study.measuring import measure
from foresee_dsl.study.questions import wanted_by
from foresee_dsl.study.settings import StudySettings, Wanted

Cases = Mapping[str, Sequence[TestCase]]
"""The test cases of each group."""


@dataclass(frozen=True)
class StudyRun:
    """How it went.

    Attributes:
        asked: the questions that are answered wholly, with what they took. broken: what could not be run at all.
    """

    asked: dict[str, Took]
    interrupted: bool
    broken: tuple[str, ...]


def possible(settings: StudySettings) -> tuple[StudySettings, tuple[str, ...]]:
    """Return the settings without the drivers and rankers that are not installed, and what was left out, in words.

    Raises:
        ForeseeError: no driver, or no ranker, is left.
    """
    known = ranker_names()
    rankers = tuple(name for name in settings.rankers if name in known)
    notes = [f"ranker {name}: left out, as none of that name is installed" for name in settings.rankers
             if name not in known]  # fmt: skip
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


def watched(wanted: Iterable[Wanted]) -> tuple[tuple[Wanted, ...], tuple[str, ...]]:
    """Return the campaigns whose ranker knows their driver, and which pairs are left out, in words."""
    kept, notes = [], {}
    for one in wanted:
        ranker = load_ranker(one.ranker)
        try:
            if isinstance(ranker, Learned):
                ranker.weights_hash(one.driver)
            kept.append(one)
        except ForeseeError as err:
            notes[one.ranker, one.driver] = f"{one.ranker} with {one.driver}: left out ({err})"
    return tuple(kept), tuple(notes.values())


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
    """Run what questions need and is not in the store, and keep what each campaign gave.

    Args:
        names: the questions. settings: as `possible` returns them.
        say: is told, before each campaign, which one it is.

    Raises:
        InputError: a test case is impossible on its network.
        StoreError: the store cannot be written any more; what was finished is in it.
    """
    done: set[Wanted] = set()
    asked: dict[str, Took] = {}
    broken: list[str] = []
    ends_s = None if options.limits.budget_s is None else time.monotonic() + options.limits.budget_s
    folder.at.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(prefix=".work-", dir=folder.at))
    try:
        for name in names:
            started = time.monotonic()
            wanted, _ = watched(wanted_by([name], settings))
            for k, one in enumerate(wanted):
                if one in done:
                    continue
                say(f"{name} {k + 1}/{len(wanted)}: {one.driver}, {one.ranker}, clips of {one.clip_s:g} s, "
                    f"seed {one.seed}" + (f", {one.group}" if len(cases) > 1 else ""))  # fmt: skip
                stages = Stages(cases[one.group], one.campaign(), store, folder.at, options.shard)
                ran = run_missing(stages, work=work, store=store, listeners=listeners,
                                  options=_with_time_left(options, ends_s), minimise=False)  # fmt: skip
                broken += ran.broken
                folder.keep(one, measure(stages, group=one.group, repetition=one.repetition))
                if ran.stopped:
                    return StudyRun(asked, interrupted=True, broken=tuple(broken))
                done.add(one)
            asked[name] = Took(round(time.monotonic() - started, 1), options.jobs)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return StudyRun(asked, interrupted=False, broken=tuple(broken))


def _with_time_left(options: RunOptions, ends_s: float | None) -> RunOptions:
    if ends_s is None:
        return options
    return replace(options, limits=replace(options.limits, budget_s=max(ends_s - time.monotonic(), 0.0)))


@dataclass(frozen=True)
class Planned:
    """What a question would run: campaigns, runs that are in the store, known to be missing, and more at most.

    `longest_s`: one core's time for all that, at most.
    """

    shown = "question campaigns done to_run at_most_more one_core_s=longest_s:1"

    question: str
    campaigns: int
    done: int
    to_run: int
    at_most_more: int
    longest_s: float


def plan_study(names: Sequence[str], settings: StudySettings, cases: Cases, store: Store | None) -> tuple[Planned, ...]:
    """Return what each question would run; what an earlier one runs already is not counted again."""
    seen: set[str] = set()
    plans = []
    for name in names:
        counts: Counter[str] = Counter()
        seconds = 0.0
        wanted, _ = watched(wanted_by([name], settings))
        for one in wanted:
            campaign = one.campaign()
            stages = Stages(cases[one.group], campaign, store, Path())
            each_s = store.mean_wall_s(one.driver) if store is not None else {}
            for node, row in stages.walk():
                if node.step.key in seen:
                    continue
                seen.add(node.step.key)
                if row is not None:
                    counts["done"] += node.step.drives
                    continue
                counts["to run"] += node.step.drives
                clips, children = _following(node, one)
                counts["more"] += clips + children
                seconds += node.step.drives * each_s.get(node.step.kind, node.step.usual_s)
                seconds += clips * each_s.get("clip", _CLIP_S) + children * each_s.get("child", _CHILD_S)
                if node.step.kind == "seed":  # its forecast is another one's for each ranker
                    seen.discard(node.step.key)
        plans.append(Planned(name, len(wanted), counts["done"], counts["to run"], counts["more"], seconds))
    return tuple(plans)


def _following(node: Node, wanted: Wanted) -> tuple[int, int]:
    """Return how many clips and children follow from a step without a result, at most."""
    points = min(wanted.risky_points, _USUAL_POINTS)
    match node.step.kind:
        case "seed" | "forecast":
            return points, points * wanted.children
        case "clip" | "mutants":
            return 0, wanted.children
        case _:
            return 0, 0


_USUAL_POINTS = 45
"""Clips of a test case that is searched exhaustively, at most (paper, section 4.3: 45 of a run of 48 s)."""
_CLIP_S, _CHILD_S = 0.3, 0.12
"""Of a store that has none yet: wall time of a clip and of a child (ours: the bundled scenarios with `pdm`)."""
