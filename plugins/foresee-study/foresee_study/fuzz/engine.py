"""Runs DriveFuzz on many test cases: each is mutated cycle after cycle, and the worst drive of a cycle is mutated in
the next one.

The mutations of a cycle are independent of each other, and each result is stored under a key of all its inputs. So the
result is the same for any number of workers, and a stopped command continues with the missing runs. The mutations of a
cycle that come after a failing one do not count.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from foresee_dsl import __version__
from foresee_dsl.campaign.driving import case_name, longest_s
from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.execution.runs import broken_run
from foresee_dsl.campaign.import_closure import DIGITS
from foresee_dsl.campaign.keys import driver_identity, step_code
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.workers.pool import BrokenTask, Executor, RunOptions, Task, Update
from foresee_dsl.compile import placement_mistakes
from foresee_dsl.errors import InputError
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz import settings as s
from foresee_study.fuzz.folder import FOLDER, publish
from foresee_study.fuzz.records import Cycle, FuzzedCase, FuzzResult, FuzzRun, MutatedRun, decode, encode
from foresee_study.fuzz.texts import Original, file_text, original_of
from foresee_study.fuzz.worker import Job, run_job

KIND = "fuzz"
"""Kind of DriveFuzz's rows in a store, which campaigns do not use."""
_WORKER = "foresee_study.fuzz.worker"


def fuzz(
    cases: Sequence[TestCase],
    settings: s.FuzzSettings,
    *,
    out: Path,
    store: Store,
    listeners: Sequence[Listener] = (),
    options: RunOptions = RunOptions(),  # noqa: B008 - immutable
) -> FuzzResult:
    """Fuzz test cases; write `fuzz.json` and every mutated test case that was run.

    Args:
        cases: the original test cases: written or random scenarios, or results of an earlier fuzzing run. A test case
            that fails without mutation is not mutated.
        settings: settings of the run.
        out: folder in which `mutated` and `fuzz.json` are replaced.
        store: a store that is open for writing; the store of a campaign can be used. listeners: objects that are
            notified of each run.
        options: number of workers, limits, stop signal.

    Raises:
        InputError: a test case is impossible on its network; nothing was run.
        ForeseeError: a test case is a clip or a mutant; nothing was run.
        StoreError: the store cannot be written any more; it contains the finished runs.
    """
    started = time.monotonic()
    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)
    run = _Fuzzing(cases, settings, out, store, listeners, options, started)
    interrupted = run.until_done()
    result = FuzzResult(
        settings, tuple(progress.result() for progress in run.progress), interrupted, tuple(sorted(run.broken)),
        time.monotonic() - started,
    )  # fmt: skip
    publish(result, out)
    return result


@dataclass
class _Progress:
    """The progress of one test case."""

    case: TestCase
    original: Original
    name: str
    settings: s.FuzzSettings
    out: Path
    plain: MutatedRun | None = None
    cycles: list[dict[int, MutatedRun]] = field(default_factory=list)
    parents: list[str] = field(default_factory=lambda: [""])
    """For each cycle, the lines of the mutated test case that is mutated again in that cycle."""
    chosen: list[int] = field(default_factory=list)
    waits: set[int] = field(default_factory=set)
    """The numbers of the mutations of the cycle that are being run; 0 means the unmutated test case."""
    lost: bool = False
    """Whether the test case must be given up, because a run of it could not be done."""

    @property
    def over(self) -> bool:
        """Return whether no run remains for the test case."""
        if self.lost or self.plain is None:
            return self.lost
        return self.plain.verdict is not Verdict.PASS or self._failed() > 0 or len(self.chosen) == self.settings.cycles

    def _failed(self) -> int:
        """Return the number of the first failing mutation of the last cycle, which ends the test case; 0 if none
        failed."""
        runs = self.cycles[-1] if self.cycles else {}
        failed = min((k for k, outcome in runs.items() if outcome.verdict.is_failure), default=0)
        return failed if failed and all(k in runs for k in range(1, failed)) else 0

    def next(self, most: int) -> list[int]:
        """Return the numbers of the mutations that can begin now, at most `most`."""
        if self.over or self.waits:
            return []
        if self.plain is None:
            return [0]
        if not self.cycles or len(self.cycles) == len(self.chosen):
            self.cycles.append({})
        done = self.cycles[-1]
        return [k for k in range(1, self.settings.mutations + 1) if k not in done][:most]

    def take(self, number: int, outcome: MutatedRun) -> None:
        """Store the outcome of a mutation; at the end of a cycle, choose the test case that is mutated next."""
        self.waits.discard(number)
        if number == 0:
            self.plain = outcome
            return
        runs = self.cycles[-1]
        runs[number] = outcome
        if len(runs) == self.settings.mutations and not self._failed():
            # If the driver crashed, or the mutation was impossible, the score means nothing.
            usable = [k for k in sorted(runs) if runs[k].verdict in (Verdict.PASS, Verdict.TIMEOUT)]
            best = min(usable, key=lambda k: (runs[k].quality.score, k), default=0)
            self.chosen.append(best)
            self.parents.append(runs[best].lines if best else self.parents[-1])

    def result(self) -> FuzzedCase:
        """Return the result of the test case so far."""
        failed, cycles = self._failed(), []
        for k, runs in enumerate(self.cycles, start=1):
            last = k == len(self.cycles)
            counted = {n: outcome for n, outcome in sorted(runs.items()) if not (last and failed and n > failed)}
            if last and not failed:  # of a cycle that was stopped, only the runs before the first missing one count
                counted = {n: outcome for n, outcome in counted.items() if all(j in runs for j in range(1, n))}
            chosen = self.chosen[k - 1] if k <= len(self.chosen) else 0
            if counted:
                cycles.append(Cycle(k, tuple(self._named(k, n, outcome) for n, outcome in counted.items()), chosen))
        return FuzzedCase(self.case.id, self.case.family, self.plain, tuple(cycles))

    def _named(self, cycle: int, number: int, outcome: MutatedRun) -> FuzzRun:
        name = f"{self.name}_c{cycle:02d}_m{number}"
        file = f"{FOLDER}/{self.name}/{name}.foresee" if outcome.lines else ""
        about = (f"Cycle {cycle}, mutation {number} of {self.case.id}: {outcome.what}. Seed {self.settings.seed}, "
                 f"score {outcome.quality.score:.2f}: {outcome.reason or 'passed'}")  # fmt: skip
        if not file:
            return FuzzRun(name, cycle, number, "", "", outcome)
        text = file_text(name, self.original, self.out / file, outcome.lines, about=about, driver=self.settings.driver,
                         outcome=outcome)  # fmt: skip
        address = f"{file}::{self.original.case}" if self.original.case else file
        return FuzzRun(name, cycle, number, file, address, outcome, text)


class _Fuzzing:
    """The state of a fuzzing run."""

    def __init__(
        self, cases: Sequence[TestCase], settings: s.FuzzSettings, out: Path, store: Store,
        listeners: Sequence[Listener], options: RunOptions, started_s: float,
    ) -> None:  # fmt: skip
        self._settings, self._store, self._listeners, self._options = settings, store, listeners, options
        self._driver = driver_identity(settings.driver)
        self._folder = out.resolve() / FOLDER / "one"
        names = _names(cases)
        mine = [c for c in cases if options.shard.holds(hashlib.sha256(c.meaning.encode()).hexdigest())]
        self.progress = [_Progress(case, original_of(case), names[case.id], settings, out.resolve()) for case in mine]
        self.broken: list[str] = []
        self._executor: Executor | None = None
        self._running: dict[str, tuple[_Progress, int, Job]] = {}
        budget_s = options.limits.budget_s
        self._ends_s = math.inf if budget_s is None else started_s + budget_s

    def until_done(self) -> bool:
        """Run all missing mutations; return whether the fuzzing run was stopped before its end."""
        if self._options.retry:
            self._store.execute("DELETE FROM runs WHERE broken = 1 AND kind = ?", (KIND,))
        for listener in self._listeners:
            listener.planned(KIND, len(self.progress) * (1 + self._settings.cycles * self._settings.mutations))
        try:
            self._hand_out()
            if self._executor is not None:
                for update in chain.from_iterable(self._executor.updates(self._stop)):
                    self._handle(update)
                    self._hand_out()
            return any(not progress.over for progress in self.progress)
        finally:
            if self._executor is not None:
                self._executor.close()

    def _stop(self) -> bool:
        return self._options.stop() or time.monotonic() > self._ends_s

    def _hand_out(self) -> None:
        """Begin mutations: for each test case only as many as keep the workers busy, because a failure ends the test
        case.
        """
        ahead = True
        while ahead and not self._stop():
            ahead = False
            open_ = [progress for progress in self.progress if not progress.over]
            most = max(1, math.ceil(self._options.jobs / max(len(open_), 1)))
            for progress in open_:
                for number in progress.next(most):
                    ahead |= self._begin(progress, number)

    def _begin(self, progress: _Progress, number: int) -> bool:
        """Take the result of a mutation from the store, or pass the mutation to a worker; return whether the store had
        the result.
        """
        cycle = len(progress.cycles) if number else 0
        parent = progress.parents[-1] if number else ""
        job = Job(progress.original, parent, cycle, number, progress.case.meaning, self._settings, self._folder,
                  self._options.limits.deadlines)  # fmt: skip
        key = self._key(job)
        row = self._store.get(key)
        if row is not None:
            self._tell(row, new=False)
            progress.take(number, decode(row.record))
            return True
        progress.waits.add(number)
        # A mutation may need several attempts of some seconds each; only the last attempt has the full length.
        simulated_s = longest_s(progress.case) + s.TRIES * s.FIRST_S
        task = Task(job.name, run_job, job, self._options.limits.for_run(simulated_s), key)
        self._running[key] = progress, number, job
        if self._executor is None:
            self._executor = self._options.executor(self._options)
        self._executor.add([task], (cycle,))
        return False

    def _key(self, job: Job) -> str:
        seed, kind = self._settings.seed, (self._settings.together if job.cycle else None)
        parts = (KIND, __version__, step_code(_WORKER), self._driver, job.meaning, job.parent, job.cycle, job.number,
                 seed, kind)  # fmt: skip
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:DIGITS]

    def _handle(self, update: Update) -> None:
        progress, number, job = self._running.pop(update.task.key)
        outcome, broken = update.value, isinstance(update.value, BrokenTask)
        ended_outside = isinstance(update.value, BrokenTask) and update.value.how == "killed"
        if isinstance(update.value, BrokenTask):
            outcome = broken_run(MutatedRun, update.value, what="broke")
            self.broken.append(f"{job.name}: {outcome.reason}")
            for listener in self._listeners:
                listener.broken(self.broken[-1])
        row = StoredResult(
            key=update.task.key, kind=KIND, name=job.name, record=encode(outcome), driver=self._settings.driver,
            verdict=outcome.verdict.value, reason=outcome.reason, broken=broken, simulated_s=outcome.duration_s,
            wall_s=outcome.wall_s,
        )  # fmt: skip
        # If a process was ended from outside, its run has no result, and the next fuzzing run repeats it.
        self._tell(row if ended_outside else self._store.add(row), new=True)
        progress.take(number, outcome)

    def _tell(self, row: StoredResult, *, new: bool) -> None:
        for listener in self._listeners:
            listener.done(row, new=new)


def _names(cases: Sequence[TestCase]) -> dict[str, str]:
    """Return the file name of each test case: its scenario and case, with a number if two names are equal."""
    names: dict[str, str] = {}
    for case in cases:
        name, again = case_name(case), 1
        while name in names.values():
            again += 1
            name = f"{case_name(case)}_{again}"
        names[case.id] = name
    return names
