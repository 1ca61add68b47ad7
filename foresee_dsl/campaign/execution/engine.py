"""The campaign: what is not in the store yet is run, and everything found is put together.

A step is run once for its key, however many campaigns have it. Its result is stored before it is reported and before
anything follows from it: whenever this process ends, the same command continues from there.
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
from foresee_dsl.campaign.assembly import assemble
from foresee_dsl.campaign.execution.pool import Broken, Executor, RunOptions, Update
from foresee_dsl.campaign.execution.pool import Part as TaskPart
from foresee_dsl.campaign.execution.runs import broken_verdict
from foresee_dsl.campaign.findings.representatives import choose_representatives
from foresee_dsl.campaign.folder import CampaignFolder
from foresee_dsl.campaign.node import Node
from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome, Minimised, SeedOutcome, encode
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import CaseFiles, Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.step import Made
from foresee_dsl.campaign.storage.store import Row, Store
from foresee_dsl.compile import placement_mistakes
from foresee_dsl.errors import InputError
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import DriverNotes, Verdict

_MENDED = 3
"""How many times a campaign whose results are changed on the disk meanwhile runs what is missing (ours)."""
_AWAITED_TURN = ChildStep.turn
"""What comes after the children has no round waiting for it."""


class Listener:
    """Is told while a campaign runs (a progress bar, a log); this one does nothing."""

    def planned(self, kind: str, count: int) -> None:
        """So many more steps of a kind are known of."""

    def done(self, row: Row, *, new: bool = True) -> None:
        """One of them is in the store; `new`: it was not there before."""

    def broken(self, what: str) -> None:
        """One of them cannot be done."""

    def round(self, begun: Round) -> None:
        """A later round of children begins, where they are allocated in rounds."""


@contextmanager
def _no_search_for_cycles() -> Iterator[None]:
    """Let Python not look for cycles of objects meanwhile.

    Results are in none, and while they are put together all that are there are looked through again and again: 4 to 9 %
    of the time for 35,611 of them.
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
) -> CampaignResult:
    """Run a whole campaign and write its folder.

    Args:
        out: the campaign's folder; its `children` and `traces` are replaced, all at once, at the end.
        store: open to be written.

    Returns:
        The result; when it was stopped, with what was finished and `interrupted` set.

    Raises:
        InputError: a test case is impossible on its network; nothing was run or written.
        StoreError: the store cannot be written any more; what was finished is in it.
    """
    started = time.monotonic()
    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)
    stages = Stages(cases, settings, store, out, options.shard)
    folder = CampaignFolder(out)
    with folder.working() as work:
        ran = run_missing(stages, work=work, store=store, listeners=listeners, options=options)
        with _no_search_for_cycles():
            found = assemble(stages, out)
            wall_s = time.monotonic() - started
            result = CampaignResult(
                settings, found.seeds, found.clips, wall_s, ran.stopped, ran.broken, found.minimised
            )
            folder.publish(result, found.traces, store.blobs)
    return result


class Ran(NamedTuple):
    """How a campaign's runs went. `broken`: what could not be done, sorted. `stopped`: before the end."""

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
) -> Ran:
    """Run those steps of a campaign that the store does not have, and write no folder.

    Args:
        stages: its steps; its test cases are possible on their networks.
        work: a folder for the files that workers read; the caller removes it.
        minimise: whether the findings' representatives are made smaller at the end.

    Raises:
        StoreError: the store cannot be written any more; what was finished is in it.
    """
    run = _Run(stages, store, CaseFiles(work / "cases"), listeners, options)
    broken, stopped = run.until_done(minimise=minimise)
    return Ran(tuple(sorted(broken)), stopped)


class _Run:
    """What is under way in a campaign."""

    def __init__(
        self, stages: Stages, store: Store, files: CaseFiles, listeners: Sequence[Listener], options: RunOptions
    ) -> None:
        self._stages, self._store, self._files = stages, store, files
        self._listeners, self._options = listeners, options
        self._executor: Executor | None = None
        self._running: dict[str, Node] = {}
        """The step of each task that is under way, by its key."""
        self._waiting: dict[str, list[Node]] = {}
        """Steps whose result a task under way may give, by key."""
        self._expected: Counter[str] = Counter()
        """Keys that tasks under way may give, and how many of these tasks."""
        self._broken: list[str] = []
        self._begun_again: set[str] = set()
        """Keys of steps that broke as what they read had been changed."""
        self._then: dict[str, list[Node]] = {}
        """These steps, by the key of what they read."""
        self._rounds = {node: rounds for rounds in stages.rounds for node in rounds.seeds}
        """The rounds that a test case belongs to, where children are allocated in rounds."""
        self._awaited: Counter[tuple[int, int]] = Counter()
        """How many steps are handed out for which a round waits, by part of the campaign and round."""
        budget_s = options.limits.budget_s
        self._ends_s = math.inf if budget_s is None else time.monotonic() + budget_s
        self._stopped_early = False
        """Whether it was stopped while it looked at what there is to do."""

    def until_done(self, *, minimise: bool) -> tuple[list[str], bool]:
        """Run what is missing; return what could not be done, and whether it was stopped before the end."""
        if self._options.retry:
            self._store.execute("DELETE FROM runs WHERE broken = 1")
        try:
            roots: Sequence[Node] = self._stages.seeds
            for _ in range(_MENDED):
                self._run_through(roots)
                # What is a finding is known once all children are.
                if minimise and not self._stopped:
                    with _no_search_for_cycles():
                        chosen = choose_representatives(self._stages)
                    self._run_through(chosen)
                roots = self._changed_meanwhile()
                if self._stopped or not roots:
                    break
                self._broken.clear()
            return self._broken, self._stopped
        finally:
            if self._executor is not None:
                self._executor.close()

    @property
    def _stopped(self) -> bool:
        unfinished = any(not rounds.finished for rounds in self._stages.rounds)
        return self._stopped_early or bool(self._running) or unfinished

    def _run_through(self, nodes: Iterable[Node]) -> None:
        """Run what is missing of steps and of what follows from them."""
        with _no_search_for_cycles():
            self._visit(nodes)
        self._begin_rounds()
        if self._executor is not None:
            for update in self._executor.updates(self._stop):
                self._handle(update)
                self._begin_rounds()

    def _changed_meanwhile(self) -> list[Node]:
        """Return the steps without a result, where one of these was changed on the disk since it was stored."""
        if self._executor is None:
            return []
        self._store.read_again()
        missing = [node for node, row in self._stages.walk() if row is None]
        return missing if any(node.step.key in self._store.damaged for node in missing) else []

    def _begin_rounds(self) -> None:
        """Begin each round for which all results are there."""
        for rounds in self._stages.rounds:
            while not (rounds.finished or self._stop() or self._stopped_early or self._awaits(rounds)):
                begun = len(rounds.begun)
                nodes = rounds.next()
                for new in rounds.begun[begun:]:
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

    def _visit(self, nodes: Iterable[Node]) -> None:
        """Go through steps and what follows from them as far as it is known; hand out what is missing."""
        ahead = list(reversed(tuple(nodes)))
        while ahead and not self._stop():
            node = ahead.pop()
            for listener in self._listeners:
                listener.planned(node.step.kind, 1)
            row = self._stages.row(node)
            if row is not None and self._stages.has_more_time(node, row, self._options.limits):
                self._store.drop(row.key)
                row = None
            if row is None:
                self._hand_out(node)
            else:
                self._tell(row, new=False)
                ahead.extend(reversed(self._stages.after(node, row)))
        self._stopped_early |= bool(ahead)

    def _awaited_by(self, node: Node) -> tuple[int, int]:
        """Return the part of the campaign and its first round that waits for a step's result."""
        rounds = self._rounds.get(node.over("seed"))
        return id(rounds), awaited_by(node)

    def _hand_out(self, node: Node) -> None:
        waiting = self._waiting.setdefault(node.step.key, [])
        if node in waiting:
            return
        waiting.append(node)
        self._awaited[self._awaited_by(node)] += 1
        if self._expected[node.step.key]:
            return  # a task that is under way gives it
        task = self._stages.task(node, self._files, self._options.limits)
        self._running[node.step.key] = node
        self._expected.update(step.key for step in self._stages.task_steps(node))
        if self._executor is None:
            self._executor = self._options.executor(self._options)
        # Test cases first, so that it is soon known how much there is to do; then the clips of first rank with their
        # children before those of second rank: where time runs out, the best points were studied. Of one rank a process
        # goes on with the clip that it has at hand.
        turn = node.step.turn
        # With rounds, all that the next one waits for comes before what none waits for.
        apart = (int(turn > _AWAITED_TURN), 0) if self._rounds else (0, node.step.rank)
        self._executor.add([task], (int(turn > 0), *apart, turn))

    def _handle(self, update: Update) -> None:
        if isinstance(update.value, TaskPart):
            self._add(_row(update.value.value), update.value.value.trace)
            return
        node = self._running.pop(update.task.key)
        keys = [step.key for step in self._stages.task_steps(node)]
        self._expected.subtract(keys)
        if isinstance(update.value, Broken) and self._begins_again(node):
            return
        if isinstance(update.value, Broken):
            # The part that it was at is the first that it has not given.
            key = next((k for k in keys if not self._store.has(k)), node.step.key)
            row = _broken_row(node, update.value) if key == node.step.key else None
            if row is not None:
                self._add(row, None)
            else:
                self._end_waiting(key)
                self._broken.append(f"{node.step.kind} {update.task.name}: {update.value.reason}")
                for listener in self._listeners:
                    listener.broken(self._broken[-1])

    def _begins_again(self, node: Node) -> bool:
        """Run once more what a step that broke had read, if that was changed on the disk; the step follows from it."""
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

    def _add(self, row: Row, trace: bytes | None) -> None:
        row = self._store.add(row, trace)
        for k, node in enumerate(self._end_waiting(row.key)):
            self._tell(row, new=k == 0)
            self._visit((*self._then.pop(row.key, ()), *self._stages.after(node, row)))

    def _end_waiting(self, key: str) -> list[Node]:
        """Return the steps that waited for a result."""
        nodes = self._waiting.pop(key, [])
        self._awaited.subtract(self._awaited_by(node) for node in nodes)
        return nodes

    def _tell(self, row: Row, *, new: bool) -> None:
        for listener in self._listeners:
            listener.done(row, new=new)


def _row(made: Made, *, broken: bool = False) -> Row:
    record = made.record.child if isinstance(made.record, Minimised) else made.record
    run = record if isinstance(record, SeedOutcome | ClipOutcome | ChildOutcome) else None
    hangs = run is not None and run.notes is not None and run.notes.hang is not None
    return Row(
        key=made.key,
        kind=made.kind,
        name=made.name,
        record=encode(made.record),
        driver=made.driver,
        verdict=run.verdict.value if run else "",
        reason=run.reason if run else "",
        broken=broken or hangs,
        simulated_s=run.duration_s if run else 0.0,
        wall_s=made.wall_s,
    )


def _broken_row(node: Node, broken: Broken) -> Row | None:
    """Return the row of a run that gave no result.

    None where no run broke, but a forecast or a mutation; and where the process was ended from outside: that is no
    result, and the next campaign runs it.
    """
    if broken.how == "killed":
        return None
    verdict, reason = broken_verdict(broken)
    record = node.step.broken(node.case, node.file, verdict, reason)
    if record is None:
        return None
    if broken.output and isinstance(record, SeedOutcome | ChildOutcome):
        record = replace(record, notes=DriverNotes(output=broken.output))
    wall_s = (broken.task.deadline_s or 0.0) if verdict is Verdict.TIMEOUT else 0.0
    return _row(Made(node.step.key, node.step.kind, node.step.name, record, wall_s=wall_s), broken=True)
