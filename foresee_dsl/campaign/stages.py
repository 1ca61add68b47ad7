"""What follows from what in a campaign: test case, forecast, clips, mutants, children; each step with its key."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.campaign.execution.pool import Task
from foresee_dsl.campaign.keys import driver_identity, key, operators_identity, ranker_identity
from foresee_dsl.campaign.results import ClipOutcome
from foresee_dsl.campaign.settings import CampaignSettings, Limits, Shard
from foresee_dsl.campaign.steps import case_name
from foresee_dsl.campaign.storage.attachments import CaseFiles, Ref
from foresee_dsl.campaign.storage.records import Draft, Forecast, Kind, MutantDraft, Mutants, decode
from foresee_dsl.campaign.storage.store import Row, Store
from foresee_dsl.campaign.work import ChildWork, ClipWork, SeedWork, run_clip, run_mutant, run_seed, worth_mutating
from foresee_dsl.compile.placement.scene import DEFAULT_END_S
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.language.model import End, Quantity
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Node:
    """One step of a campaign.

    Attributes:
        kind: of step. key: of its result. name: of its file, without folder and suffix. case: the test case that all
            began with. seed: of its run, or of the lots that it draws. above: the step that it follows from.
        draft: of a clip and what follows. mutant: of a child.
    """

    kind: Kind
    key: str
    name: str
    case: TestCase
    seed: int
    above: Node | None = None
    draft: Draft | None = None
    mutant: MutantDraft | None = None

    @property
    def folder(self) -> str:
        """Where the files of the clips and children are, relative to the campaign's folder."""
        return f"children/{self.case.source.stem}"

    @property
    def file(self) -> str:
        """Its own file there."""
        return f"{self.folder}/{self.name}.foresee"

    def over(self, kind: Kind) -> Node:
        """Return the step of a kind that it follows from (or itself).

        Raises:
            ValueError: it follows from none of that kind.
        """
        node: Node | None = self
        while node is not None:
            if node.kind == kind:
                return node
            node = node.above
        raise ValueError(f"{self.kind} {self.name} follows from no {kind}")


class Stages:
    """The steps of one campaign."""

    def __init__(
        self,
        cases: Sequence[TestCase],
        settings: CampaignSettings,
        store: Store | None,
        out: Path,
        shard: Shard = Shard(),  # noqa: B008 - immutable
    ) -> None:
        """Work out the keys of the test cases.

        Args:
            cases: loaded. settings: what to do. store: where results are; None: there are none yet.
            out: the campaign's folder. shard: which of the test cases are meant.

        Raises:
            DriverError: there is no such driver.
        """
        self.settings = settings
        self._store, self._out = store, out
        self._driver = driver_identity(settings.driver)
        self._ranker = ranker_identity(settings.ranker)
        self._operators = operators_identity()
        self._after: dict[Node, tuple[Node, ...]] = {}
        """What follows from the steps looked at so far: a step is looked at before and after the run."""
        self.seeds = tuple(node for node in self._seeds(cases) if shard.holds(node.key))

    def row(self, node: Node) -> Row | None:
        """Return the result of a step, if there is one."""
        return self._store.get(node.key) if self._store is not None else None

    def has_more_time(self, node: Node, row: Row, limits: Limits) -> bool:
        """Say whether a run was ended because it took too long, and would now be given more time."""
        return row.broken and row.verdict == Verdict.TIMEOUT and row.wall_s < self._deadline_s(node, limits)

    def after(self, node: Node, row: Row) -> tuple[Node, ...]:
        """Return the steps that follow from one with this result."""
        follow = {"seed": self._forecast, "forecast": self._clips, "clip": self._mutants, "mutants": self._children}
        if node not in self._after and node.kind in follow:
            self._after[node] = tuple(follow[node.kind](node, row))
        return self._after.get(node, ())

    def walk(self) -> Iterator[tuple[Node, Row | None]]:
        """Yield every step that is known of, what it follows from before it, with its result if there is one."""
        ahead = list(reversed(self.seeds))
        while ahead:
            node = ahead.pop()
            row = self.row(node)
            yield node, row
            if row is not None:
                ahead.extend(reversed(self.after(node, row)))

    def expected(self, node: Node) -> tuple[str, ...]:
        """Return the keys of all that the task of a step may give, in order."""
        if node.kind == "seed":
            return node.key, self._forecast_key(node)
        if node.kind == "clip":
            return node.key, *(k for k, _ in self._mutant_keys(node))
        return (node.key,)

    def task(self, node: Node, files: CaseFiles, limits: Limits) -> Task:
        """Return what a worker has to do for a step whose result is missing."""
        case, settings, folder = files.ref(node.case), self.settings, self._out / node.folder
        if node.kind in ("seed", "forecast"):
            seed = node.over("seed")
            trace = self._trace(seed) if node.kind == "forecast" else None
            work = SeedWork(seed.key, self._forecast_key(seed), case, seed.name, seed.seed, settings, folder, trace)
            return Task(node.case.id, run_seed, work, self._deadline_s(node, limits), node.key)
        draft, deadline_s = self._draft(node), self._deadline_s(node, limits)
        if node.kind == "child":
            if node.mutant is None:
                raise ValueError(f"child {node.name} has no mutant")
            child = ChildWork(node.key, node.name, case, draft, node.mutant, node.seed, settings, folder)
            return Task(node.name, run_mutant, child, deadline_s, node.key)
        clip, seed = node.over("clip"), node.over("seed")
        mutants = self._mutant_keys(clip) if node.kind == "clip" else ((node.key, node.seed),)
        own = self._trace(clip) if node.kind == "mutants" else None
        parent = self._trace(seed) if node.kind == "clip" else None
        return Task(
            node.name,
            run_clip,
            ClipWork(clip.key, mutants, case, draft, clip.seed, settings, folder, parent, own),
            deadline_s,
            node.key,
        )

    def _seeds(self, cases: Sequence[TestCase]) -> Iterator[Node]:
        """Yield a step for each test case, with a name of its own for its files.

        The name is the scenario's and the case's (`red_light_runner_r02`); when two files hold scenarios of one name,
        a number follows.
        """
        owners: dict[str, str] = {}
        for case in cases:
            base = case_name(case)
            name, number = base, 2
            while owners.setdefault(name, case.id) != case.id:
                name, number = f"{base}_{number}", number + 1
            # A clip's window is in no scenario, and decides which noise its sensors have.
            window = clip_pin(case.clip, case.clip.pin) if case.clip is not None else ""
            found = key("seed", meaning=case.meaning, window=window, driver=self._driver, seed=self.settings.seed)
            yield Node("seed", found, name, case, self.settings.seed)

    def _forecast_key(self, seed: Node) -> str:
        s = self.settings
        return key("forecast", seed=seed.key, ranker=self._ranker, before_s=s.before_s, after_s=s.after_s,
                   handover_s=s.handover_s, count=s.risky_points, lots=seed.seed)  # fmt: skip

    def _mutant_keys(self, clip: Node) -> tuple[tuple[str, int], ...]:
        """Return the keys of the mutations of a clip, each with its seed."""
        s = self.settings
        risk = clip.draft.risk if clip.draft else ""
        seeds = range(s.seed, s.seed + s.repeat) if s.children else ()
        return tuple(
            (
                key("mutants", clip=clip.key, risk=risk, preset=s.preset, count=s.children, seed=seed,
                    operators=self._operators),
                seed,
            )
            for seed in seeds
        )  # fmt: skip

    def _forecast(self, node: Node, row: Row) -> Iterator[Node]:
        if row.verdict == Verdict.PASS:
            yield replace(node, kind="forecast", key=self._forecast_key(node), above=node)

    def _clips(self, node: Node, row: Row) -> Iterator[Node]:
        seed = node.over("seed")
        for draft in decode(row.record, "forecast", Forecast).drafts:
            name = f"{seed.name}_p{draft.rank}"
            found = key("clip", seed=seed.key, pin=draft.pin)
            yield Node("clip", found, name, node.case, seed.seed, node, draft)

    def _mutants(self, node: Node, row: Row) -> Iterator[Node]:
        if row.verdict == Verdict.PASS and worth_mutating(decode(row.record, "clip", ClipOutcome), self.settings):
            for found, seed in self._mutant_keys(node):
                yield replace(node, kind="mutants", key=found, seed=seed, above=node)

    def _children(self, node: Node, row: Row) -> Iterator[Node]:
        again = f"_s{node.seed}" if node.seed != self.settings.seed else ""
        pin = self._draft(node).pin
        for mutant in decode(row.record, "mutants", Mutants).drafts:
            found = key("child", clip=pin, meaning=mutant.meaning, driver=self._driver, seed=node.seed)
            name = f"{node.name}{again}_m{mutant.number}"
            yield replace(node, kind="child", key=found, name=name, above=node, mutant=mutant)

    def _deadline_s(self, node: Node, limits: Limits) -> float:
        s = self.settings
        seed = node.kind in ("seed", "forecast")
        return limits.for_run(_longest_s(node.case) if seed else s.before_s + s.after_s)

    def _trace(self, node: Node) -> Ref | None:
        row = self.row(node)
        if row is None or not row.trace or self._store is None:
            return None
        return Ref(row.trace, self._store.blobs.path(row.trace))

    @staticmethod
    def _draft(node: Node) -> Draft:
        if node.draft is None:
            raise ValueError(f"{node.kind} {node.name} comes before any clip")
        return node.draft


def _longest_s(case: TestCase) -> float:
    """Return for how long a test case is simulated at most."""
    end = case.scenario.one(End)
    return float(end.after.si) if end is not None and isinstance(end.after, Quantity) else DEFAULT_END_S
