"""The order of a campaign's steps: test cases, forecasts, clips, mutations, mutants, minimised findings."""

from __future__ import annotations

import pickle
import pkgutil
from collections import defaultdict
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from itertools import chain, count
from pathlib import Path

from foresee_dsl.campaign import steps
from foresee_dsl.campaign.allocation.earlier import EarlierMutants
from foresee_dsl.campaign.allocation.rounds import Rounds
from foresee_dsl.campaign.driving import case_name
from foresee_dsl.campaign.goal import with_goal
from foresee_dsl.campaign.keys import judged_identity, key, operators_identity, ranker_identity
from foresee_dsl.campaign.records import FAILED, decode
from foresee_dsl.campaign.settings import CampaignLimits, CampaignSettings, Shard
from foresee_dsl.campaign.steps.case_run import CaseStep
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.clip import ClipStep
from foresee_dsl.campaign.steps.inputs import CaseRef, InputRef
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.requests import RoundRequest
from foresee_dsl.campaign.steps.step import AnyStep, ClipPart, KeyInputs, Step, StepNode, Work, run_steps
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.storage.traces import Blobs
from foresee_dsl.campaign.workers.pool import Task
from foresee_dsl.derive.presets import preset
from foresee_dsl.language.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import DriverNotes, Verdict


def _steps() -> tuple[type[AnyStep], ...]:
    """Return the step classes in the modules of `campaign.steps`, each after the one that it follows from."""
    modules = [
        import_module(f"{steps.__name__}.{module_info.name}") for module_info in pkgutil.iter_modules(steps.__path__)
    ]
    classes = [
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Step) and value.__module__ == module.__name__
        if hasattr(value, "kind")
    ]
    ordered: list[type[AnyStep]] = []
    above = [""]
    while above:
        following = sorted((c for c in classes if c.follows == above[0]), key=lambda c: (c.after_all, c.kind))
        ordered += following
        above = [*above[1:], *(step.kind for step in following)]
    return tuple(ordered)


STEPS = _steps()
"""All classes of steps, each after the class that it follows from."""
_NEXT = {kind: tuple(step for step in STEPS if step.follows == kind) for kind in (step.kind for step in STEPS)}
"""The classes of steps that follow from each kind of step."""


def _next(node: StepNode, row: StoredResult) -> Iterator[type[AnyStep]]:
    """Yield the classes that may follow from a step with this result; its record is not read, which would take
    longer."""
    return (step for step in _NEXT[node.step.kind] if row.verdict in FAILED or not step.of_failures)


class Stages:
    """The steps of one campaign."""

    @Part.ENGINE.measured
    def __init__(
        self,
        cases: Sequence[TestCase],
        settings: CampaignSettings,
        store: Store | None,
        out: Path,
        shard: Shard = Shard(),  # noqa: B008 - immutable
    ) -> None:
        """Compute the keys of the test cases; `store` is None if there are no results yet.

        Test cases without the campaign's goal are left out.

        Raises:
            DriverError: there is no such driver.
            ForeseeError: no test case has the goal, or there are no mutants that should be run first.
        """
        self.settings = settings
        self._store, self.out = store, out
        self._campaign = KeyInputs(
            settings,
            judged_identity(settings.driver, settings.rules),
            ranker_identity(settings.ranker, settings.driver),
            operators_identity(),
            tuple((driver, judged_identity(driver, settings.rules)) for driver in settings.against),
            key,
            preset(settings.preset).draws_from_parent,
            preset(settings.preset).ends_early,
            EarlierMutants.in_folder(Path(settings.first_from), but=out).requests if settings.first_from else None,
        )
        self._after: dict[StepNode, tuple[StepNode, ...]] = {}
        """For each visited step, the steps that follow from it; a step is visited before and after it has run."""
        self._passed: set[StepNode] = set()
        """The visited mutants that did not fail."""
        self.seeds = tuple(node for node in self._seeds(with_goal(cases, settings.goal)) if shard.holds(node.step.key))
        self.last: tuple[StepNode, ...] = ()
        """The steps that `choose` has returned."""
        self.rounds = self._rounds(shard) if settings.in_rounds and settings.children else ()
        """The rounds of each part, if mutants are allocated in rounds."""

    @Part.ENGINE.measured
    def row(self, node: StepNode) -> StoredResult | None:
        """Return the result of a step, if there is one."""
        return self._store.get(node.step.key) if self._store is not None else None

    @Part.ENGINE.measured
    def has_more_time(self, node: StepNode, row: StoredResult, limits: CampaignLimits) -> bool:
        """Return whether a run was ended for lack of time, and would now get more time."""
        if not (row.broken and row.verdict == Verdict.TIMEOUT):
            return False
        notes = getattr(decode(row.record, node.step.record), "notes", None)
        hang = notes.hang if isinstance(notes, DriverNotes) else None
        if hang is None:  # the process was ended from outside, so there is no result
            return row.wall_s < self._deadline_s(node, limits)
        now = {"reset": limits.deadlines.for_reset_s, "step": limits.deadlines.for_step_s}
        return hang.limit_s < now.get(hang.call, self._deadline_s(node, limits))

    @Part.ENGINE.measured
    def after(self, node: StepNode, row: StoredResult) -> tuple[StepNode, ...]:
        """Return the steps that follow from a step with this result."""
        if node not in self._after:
            classes = [step for step in _next(node, row) if not step.after_all]
            result = decode(row.record, node.step.record) if classes else None
            self._after[node] = tuple(
                StepNode(step, node.case, node)
                for kind in classes
                if kind.wanted(result, self.settings)
                for step in kind.following(node.step, result, self._campaign)
            )
            if isinstance(node.step, ChildStep) and row.verdict not in FAILED:
                self._passed.add(node)
        return self._after[node]

    @Part.ENGINE.measured
    def choose(self, names: Container[str]) -> tuple[StepNode, ...]:
        """Return the steps that follow from the chosen ones among all visited steps; `walk` then ends with them.

        Such steps are known only after all others, because `names` are the names of the findings' representatives.
        """
        nodes_after = []
        for node in sorted(self.named(names), key=lambda node: node.step.name):
            row = self.row(node)
            if row is None:
                continue
            for step in self.chosen_after(node, row):
                result = decode(row.record, node.step.record)
                nodes_after += [
                    StepNode(new, node.case, node) for new in step.following(node.step, result, self._campaign)
                ]
        self.last = tuple(nodes_after)
        return self.last

    def named(self, names: Container[str]) -> Iterator[StepNode]:
        """Yield the visited steps with these names, of test cases, clips and mutants."""
        every = (node for nodes in (self.seeds, *self._after.values()) for node in nodes)
        return (node for node in every if node.step.name in names)

    def chosen_after(self, node: StepNode, row: StoredResult) -> tuple[type[AnyStep], ...]:
        """Return the classes of steps that follow from a step with this result if `choose` names it."""
        after_all = [step for step in _next(node, row) if step.after_all]
        result = decode(row.record, node.step.record) if after_all else None
        return tuple(step for step in after_all if step.wanted(result, self.settings))

    def further(self, clip: StepNode, step: MutantsStep, request: RoundRequest) -> StepNode:
        """Return the step that mutates an already mutated clip once more."""
        if not isinstance(clip.step, ClipStep):
            raise TypeError(f"{clip.step.name} is not a clip")
        return StepNode(step.again(request, clip.step, self._campaign), clip.case, clip)

    def walk(
        self, roots: Sequence[StepNode] | None = None, *, failures: bool = False
    ) -> Iterator[tuple[StepNode, StoredResult | None]]:
        """Yield every known step after the one that it follows from, with its result if there is one.

        `roots`: only these and the steps that follow. `failures`: skip mutants that are known not to have failed.
        """
        later = (node for rounds in self.rounds for node in rounds.nodes)
        ahead = list(reversed((*self.seeds, *later, *self.last) if roots is None else roots))
        while ahead:
            node = ahead.pop()
            if failures and node in self._passed:
                continue
            row = self.row(node)
            yield node, row
            if row is not None:
                ahead.extend(reversed(self.after(node, row)))

    def task_steps(self, node: StepNode) -> tuple[AnyStep, ...]:
        """Return the steps that a step's task runs: itself, and its followers in the same process."""
        same = (step for step in _NEXT[node.step.kind] if step.same_task)
        return node.step, *(new for step in same for new in step.following(node.step, None, self._campaign))

    @Part.ENGINE.measured
    def task(self, node: StepNode, files: CaseFiles, limits: CampaignLimits) -> Task:
        """Return the task for a step whose result is missing."""
        trace = self._trace(node.over(node.step.reads)) if node.step.reads else None
        case = files.ref(node.case)
        work = Work(self.task_steps(node), case, self.settings, self.out / node.folder, trace, limits.deadlines)
        clip = (node.step.draft.name,) if isinstance(node.step, ClipPart) else ()
        name = node.step.name if clip else node.case.id
        shares = (case.shared.name, node.case.id, *clip)
        return Task(name, run_steps, work, self._deadline_s(node, limits), node.step.key, shares)

    def _rounds(self, shard: Shard) -> tuple[Rounds, ...]:
        """Divide the test cases into parts, each with its rounds."""
        parts: defaultdict[int, list[StepNode]] = defaultdict(list)
        for node in self.seeds:
            parts[shard.part(node.step.key)].append(node)
        return tuple(Rounds(self, tuple(parts[number])) for number in sorted(parts))

    def _seeds(self, cases: Sequence[TestCase]) -> Iterator[StepNode]:
        """Yield a step for each test case, with a unique name for its files.

        The name is the scenario's and the case's (`red_light_runner_r02`); if several files have scenarios of one name,
        a number follows.
        """
        owners: dict[str, str] = {}
        for case in cases:
            base = case_name(case)
            names = chain([base], (f"{base}_{number}" for number in count(2)))
            name = next(name for name in names if owners.setdefault(name, case.id) == case.id)
            yield StepNode(CaseStep.of_case(case, name, self._campaign), case)

    def _deadline_s(self, node: StepNode, limits: CampaignLimits) -> float:
        return limits.for_run(node.step.simulated_s(node.case, self.settings)) * node.step.runs

    def _trace(self, node: StepNode) -> InputRef | None:
        """Return the trace of a step's run; of a step without a run, the one that it read."""
        row = self.row(node)
        if row is None or self._store is None:
            return None
        if not row.trace:
            return self._trace(node.over(node.step.reads)) if node.step.reads else None
        return InputRef(row.trace, self._store.blobs.path(row.trace))


class CaseFiles:
    """Stores test cases for workers, as they were loaded, even if their files are edited meanwhile.

    The files are pickles, for processes of this campaign only, and are deleted with its working folder.
    """

    def __init__(self, folder: Path) -> None:
        self._blobs = Blobs(folder)
        self._refs: dict[str, CaseRef] = {}
        self._shared: dict[int, tuple[object, InputRef]] = {}

    def ref(self, case: TestCase) -> CaseRef:
        """Return the reference of a test case, writing its file if it is new."""
        if case.id not in self._refs:
            own = replace(case, document=None, network=Path(), models={})
            self._refs[case.id] = CaseRef(self._put(own), self._shared_ref(case))
        return self._refs[case.id]

    def _shared_ref(self, case: TestCase) -> InputRef:
        # Searched by identity first, because the cases of a project share the network object, and pickling it is slow.
        entry = self._shared.get(id(case.network))
        if entry is None or entry[0] is not case.network or isinstance(case.network, Path):
            self._shared[id(case.network)] = entry = (case.network, self._put((case.network, dict(case.models))))
        return entry[1]

    def _put(self, value: object) -> InputRef:
        name = self._blobs.put(pickle.dumps(value))
        return InputRef(name, self._blobs.path(name))
