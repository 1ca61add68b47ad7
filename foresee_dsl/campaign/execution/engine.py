"""The engine of a campaign: it runs the steps whose results the store lacks, and assembles the campaign's result.

A step is run once per key, even if several campaigns share it. Its result is stored before it is reported and before
any step follows from it: whenever this process ends, the same command continues from there.
"""

from __future__ import annotations

import gc
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.campaign.allocation.rounds import Round, Rounds, awaited_by
from foresee_dsl.campaign.assembly import assemble, choose_representatives
from foresee_dsl.campaign.execution.runs import broken_verdict
from foresee_dsl.campaign.findings.repeats import repeated
from foresee_dsl.campaign.folder import CampaignFolder
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome, Minimised, encode
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import CaseFiles, Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.step import StepNode, StepResult
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.workers.pool import BrokenTask, Executor, RunOptions, TaskPart, Update
from foresee_dsl.compile import placement_mistakes
from foresee_dsl.errors import InputError
from foresee_dsl.language.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import DriverNotes, Verdict

_MENDED = 3
"""Maximum number of times that a campaign goes through its steps if stored results change on the disk while it runs
(ours)."""
_AWAITED_TURN = ChildStep.turn
"""Turns after this one belong to steps that no round waits for."""


class Listener:
    """Receives the events of a campaign, such as for a progress bar or a log; this base class ignores them."""

    def planned(self, kind: str, count: int) -> None:
        """Called when `count` more steps of a kind are known to be needed."""

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        """Called when a step's result is in the store; `new`: it was not there before."""

    def broken(self, what: str) -> None:
        """Called when a step could not be run."""

    def round(self, begun: Round) -> None:
        """Called when a later round of mutants begins, if mutants are allocated in rounds."""


class StoredCounts(Listener):
    """Counts the results that a campaign found in its store."""

    def __init__(self) -> None:
        self._reused: set[str] = set()
        self._new: set[str] = set()

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        """Record a result; two steps of this campaign may share one."""
        (self._new if new else self._reused).add(row.key)

    @property
    def count(self) -> int:
        """Return the number of results that were in the store before."""
        return len(self._reused - self._new)


@contextmanager
def _no_search_for_cycles() -> Iterator[None]:
    """Switch off Python's search for reference cycles inside this context.

    Results contain no cycles, and the search visits all of them again and again while they are assembled: 4 to 9 % of
    the time for 35,611 results.
    """
    searched = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if searched:
            gc.enable()


def run_campaign(
    cases: Sequence[TestCase],
    settings: CampaignSettings,
    *,
    out: Path,
    store: Store,
    listeners: Sequence[Listener] = (),
    options: RunOptions = RunOptions(),  # noqa: B008 - immutable
    repeat: bool = False,
) -> CampaignResult:
    """Run a whole campaign and write its folder.

    Args:
        out: the campaign's folder; its `children` and `traces` are replaced together at the end.
        store: open for writing.
        repeat: run each finding again in another process, to see whether the driver is deterministic.

    Returns:
        The result; if it was stopped, the finished part of it, with `interrupted` set.

    Raises:
        InputError: a test case is impossible on its network; no run was started and no file written.
        StoreError: the store can no longer be written; it has the finished results.
    """
    started = time.monotonic()
    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)
    stages = Stages(cases, settings, store, out, options.shard)
    folder = CampaignFolder(out)
    with folder.working() as work:
        ran = run_missing(stages, work=work, store=store, listeners=listeners, options=options)
        with _no_search_for_cycles():
            result, traces = assemble(stages, out)
            result = replace(result, interrupted=ran.stopped, broken=ran.broken, shard=options.shard)
            if repeat and not ran.stopped:
                result = replace(result, repeats=repeated(result, traces, stages, store, options))
            result = replace(result, wall_s=time.monotonic() - started)
            folder.publish(result, traces, store.blobs)
    return result


class CampaignEnd(NamedTuple):
    """The end of a campaign's runs.

    `broken`: steps that could not be run, sorted. `stopped`: whether the campaign was stopped before its end.
    """

    broken: tuple[str, ...]
    stopped: bool


@Part.ENGINE.measured
def run_missing(
    stages: Stages,
    *,
    work: Path,
    store: Store,
    listeners: Sequence[Listener] = (),
    options: RunOptions = RunOptions(),  # noqa: B008 - immutable
    minimise: bool = True,
) -> CampaignEnd:
    """Run the steps of a campaign that the store lacks; no folder is written.

    Args:
        stages: its steps; all test cases are possible on their networks.
        work: folder for the files that workers read; the caller removes it.
        minimise: minimise the findings' representatives at the end.

    Raises:
        StoreError: the store can no longer be written; it has the finished results.
    """
    return _CampaignRun(stages, store, CaseFiles(work / "cases"), listeners, options).until_done(minimise=minimise)


class _CampaignRun:
    """The state of a running campaign."""

    def __init__(
        self, stages: Stages, store: Store, files: CaseFiles, listeners: Sequence[Listener], options: RunOptions
    ) -> None:
        self._stages, self._store, self._files = stages, store, files
        self._listeners, self._options = listeners, options
        self._executor: Executor | None = None
        self._running: dict[str, StepNode] = {}
        """The steps of the tasks that are running, by key."""
        self._waiting: dict[str, list[StepNode]] = {}
        """The steps that wait for the result of a running task, by key."""
        self._expected: Counter[str] = Counter()
        """Number of running tasks that may give a result, by the result's key."""
        self._unreported: set[str] = set()
        """Keys of the results that have arrived together with the present one and are reported after it."""
        self._broken: list[str] = []
        self._begun_again: set[str] = set()
        """Keys of the steps that failed because their input had changed on the disk."""
        self._then: dict[str, list[StepNode]] = {}
        """The steps that failed because their input had changed on the disk, by the key of this input."""
        self._rounds = {node: rounds for rounds in stages.rounds for node in rounds.seeds}
        """The rounds of each test case, if mutants are allocated in rounds."""
        self._awaited: Counter[tuple[int, int]] = Counter()
        """Number of running steps that a round waits for, by part of the campaign and round."""
        budget_s = options.limits.budget_s
        self._ends_s = math.inf if budget_s is None else time.monotonic() + budget_s
        self._stopped_early = False
        """Whether the campaign was stopped while it was determining the missing steps."""

    def until_done(self, *, minimise: bool) -> CampaignEnd:
        """Run the missing steps."""
        if self._options.retry:
            self._store.execute("DELETE FROM runs WHERE broken = 1")
        try:
            roots: Sequence[StepNode] = self._stages.seeds
            for _ in range(_MENDED):
                self._run_through(roots)
                # The findings are known only after all mutants have run.
                if minimise and not self._stopped:
                    with _no_search_for_cycles():
                        chosen = choose_representatives(self._stages)
                    self._run_through(chosen)
                roots = self._changed_meanwhile()
                if self._stopped or not roots:
                    break
                self._broken.clear()
            return CampaignEnd(tuple(sorted(self._broken)), self._stopped)
        finally:
            if self._executor is not None:
                self._executor.close()

    @property
    def _stopped(self) -> bool:
        unfinished = any(not rounds.finished for rounds in self._stages.rounds)
        return self._stopped_early or bool(self._running) or unfinished

    def _run_through(self, nodes: Iterable[StepNode]) -> None:
        """Run those of some steps that have no result yet, and all steps that depend on them."""
        with _no_search_for_cycles():
            self._visit(nodes)
        self._begin_rounds()
        if self._executor is not None:
            for updates in self._executor.updates(self._stop):
                self._handle(updates)
                self._begin_rounds()

    def _changed_meanwhile(self) -> list[StepNode]:
        """Return the steps without a result if an input of theirs was changed on the disk after it was stored."""
        if self._executor is None:
            return []
        self._store.read_again()
        missing = [node for node, row in self._stages.walk() if row is None]
        return missing if any(node.step.key in self._store.damaged for node in missing) else []

    def _begin_rounds(self) -> None:
        """Begin each round whose required results are all available."""
        for rounds in self._stages.rounds:
            while not (rounds.finished or self._stopped_early or self._awaits(rounds)):
                begun = len(rounds.begun)
                nodes = rounds.next()
                for new in rounds.begun[begun:] if not self._stop() else ():
                    for listener in self._listeners:
                        listener.round(new)
                if not nodes:
                    break
                self._visit(nodes)

    def _awaits(self, rounds: Rounds) -> bool:
        """Return whether the next round still waits for results."""
        return any(self._awaited[id(rounds), number] for number in range(2, rounds.number + 2))

    def _stop(self) -> bool:
        return self._options.stop() or time.monotonic() > self._ends_s

    def _visit(self, nodes: Iterable[StepNode]) -> None:
        """Visit steps and all known steps that depend on them; start a task for each that has no result.

        A campaign that stops still visits what has a result: if nothing is missing, it was not stopped early.
        """
        ahead = list(reversed(tuple(nodes)))
        while ahead:
            node, stops = ahead.pop(), self._stop()
            row = None if node.step.key in self._unreported else self._stages.row(node)
            if row is None and stops:
                self._stopped_early = True
                continue
            for listener in self._listeners:
                listener.planned(node.step.kind, 1)
            if row is not None and not stops and self._stages.has_more_time(node, row, self._options.limits):
                self._store.drop(row.key)
                row = None
            if row is None:
                self._hand_out(node)
            else:
                self._tell(row, new=False)
                ahead.extend(reversed(self._stages.after(node, row)))

    def _awaited_by(self, node: StepNode) -> tuple[int, int]:
        """Return the part of the campaign, and the first round in it, that waits for a step's result."""
        rounds = self._rounds.get(node.over("seed"))
        return id(rounds), awaited_by(node)

    def _hand_out(self, node: StepNode) -> None:
        waiting = self._waiting.setdefault(node.step.key, [])
        if node in waiting:
            return
        waiting.append(node)
        self._awaited[self._awaited_by(node)] += 1
        if self._expected[node.step.key]:
            return  # a running task will give this result
        task = self._stages.task(node, self._files, self._options.limits)
        self._running[node.step.key] = node
        self._expected.update(step.key for step in self._stages.task_steps(node))
        if self._executor is None:
            self._executor = self._options.executor(self._options)
        # Test cases come first, so that the amount of work is known soon; then the clips of the first rank with their
        # mutants before those of the second rank, so that the best points are used if time runs out. Within a rank, a
        # process continues with the clip that it has loaded.
        turn = node.step.turn
        # With rounds, the steps that the next round waits for come before all others.
        apart = (int(turn > _AWAITED_TURN), 0) if self._rounds else (0, node.step.rank)
        self._executor.add([task], (int(turn > 0), *apart, turn))

    def _handle(self, updates: Sequence[Update]) -> None:
        """Store all results that have arrived, then report them and begin what follows from them."""
        results: list[StepResult] = [update.value.value for update in updates if isinstance(update.value, TaskPart)]
        rows = self._store.add_all((_row(result), result.trace) for result in results)
        self._unreported = {row.key for row in rows}
        following = iter(rows)
        for update in updates:
            if isinstance(update.value, TaskPart):
                self._go_on(next(following))
            else:
                self._end(update)

    def _end(self, update: Update) -> None:
        """Handle the end of a task."""
        node = self._running.pop(update.task.key)
        keys = [step.key for step in self._stages.task_steps(node)]
        self._expected.subtract(keys)
        if isinstance(update.value, BrokenTask) and self._begins_again(node):
            return
        if isinstance(update.value, BrokenTask):
            # The task failed at the first part that it has not delivered.
            key = next((k for k in keys if not self._store.has(k)), node.step.key)
            row = _broken_row(node, update.value) if key == node.step.key else None
            if row is not None:
                self._go_on(self._store.add(row))
            else:
                self._end_waiting(key)
                self._broken.append(f"{node.step.kind} {update.task.name}: {update.value.reason}")
                for listener in self._listeners:
                    listener.broken(self._broken[-1])

    def _begins_again(self, node: StepNode) -> bool:
        """Run again the step that made the input of a failed step, if that input was changed on the disk; return
        whether it was.
        """
        if not node.step.reads or node.step.key in self._begun_again:
            return False
        read = node.over(node.step.reads)
        self._store.read_again()
        if self._stages.row(read) is not None:
            return False
        self._begun_again.add(node.step.key)
        self._end_waiting(node.step.key)
        self._then.setdefault(read.step.key, []).append(node)
        self._hand_out(read)
        return True

    def _go_on(self, row: StoredResult) -> None:
        """Report a stored result, and begin the steps that follow from it."""
        self._unreported.discard(row.key)
        for k, node in enumerate(self._end_waiting(row.key)):
            self._tell(row, new=k == 0)
            self._visit((*self._then.pop(row.key, ()), *self._stages.after(node, row)))

    def _end_waiting(self, key: str) -> list[StepNode]:
        """Return the steps that waited for a result, and stop their waiting."""
        nodes = self._waiting.pop(key, [])
        self._awaited.subtract(self._awaited_by(node) for node in nodes)
        return nodes

    def _tell(self, row: StoredResult, *, new: bool) -> None:
        for listener in self._listeners:
            listener.done(row, new=new)


def _row(result: StepResult, *, broken: bool = False) -> StoredResult:
    record = result.record.child if isinstance(result.record, Minimised) else result.record
    run = record if isinstance(record, CaseRunOutcome | ClipOutcome | ChildOutcome) else None
    hangs = run is not None and run.notes is not None and run.notes.hang is not None
    return StoredResult(
        key=result.key,
        kind=result.kind,
        name=result.name,
        record=encode(result.record),
        driver=result.driver,
        verdict=run.verdict.value if run else "",
        reason=run.reason if run else "",
        broken=broken or hangs,
        simulated_s=run.duration_s if run else 0.0,
        wall_s=result.wall_s,
    )


def _broken_row(node: StepNode, broken: BrokenTask) -> StoredResult | None:
    """Return the stored record of a run that gave no result; None if nothing is stored for it: if the step is a
    forecast or a mutation, not a run, or if the process was ended from outside. The latter is not a result, so the next
    campaign runs the step again.
    """
    if broken.how == "killed":
        return None
    verdict, reason = broken_verdict(broken)
    record = node.step.broken(node.case, node.file, verdict, reason)
    if record is None:
        return None
    if broken.output and isinstance(record, CaseRunOutcome | ChildOutcome):
        record = replace(record, notes=DriverNotes(output=broken.output))
    wall_s = (broken.task.deadline_s or 0.0) if verdict is Verdict.TIMEOUT else 0.0
    return _row(StepResult(node.step.key, node.step.kind, node.step.name, record, wall_s=wall_s), broken=True)
