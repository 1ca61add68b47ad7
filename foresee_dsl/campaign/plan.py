"""Plans a campaign before it runs: its steps as a graph, which of them have results, and the time for the rest."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

import networkx as nx

from foresee_dsl.campaign.allocation.rounds import METHODS, Round
from foresee_dsl.campaign.assembly import choose_representatives
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import STEPS, Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.step import AnyStep, StepNode
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.documents import or_null, rounded


@dataclass(frozen=True)
class StagePlan:
    """All steps of one class: those in the store, the missing ones, and the maximum number that may follow from these.

    `each_s`: wall time of one step, s. `measured`: whether this is the mean of the stored steps.
    """

    step: type[AnyStep]
    done: int
    to_run: int
    at_most: int
    each_s: float
    measured: bool

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "stage": self.kind,
            "done": self.done,
            "to_run": self.to_run,
            "at_most_more": self.at_most,
            "each_s": rounded(self.each_s, 3),
            "measured": self.measured,
        }

    @property
    def kind(self) -> str:
        """Return the kind of the steps."""
        return self.step.kind


@dataclass(frozen=True)
class AllocationPlan:
    """The allocation of mutants in rounds: the number of rounds, and the later ones known so far.

    rounds: number of rounds, including the first, which gives each clip `first` mutants.
    later_rounds: those that have begun, of each part of the campaign. words: who gets the further mutants.
    """

    rounds: int
    first: int
    later_rounds: tuple[Round, ...]
    words: str

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"rounds": self.rounds, "first": self.first, "known": self.later_rounds}

    @property
    def sentence(self) -> str:
        """Return the allocation and its known rounds, in sentences."""
        begins = f"children are allocated in {self.rounds} rounds: {self.first} per clip, then {self.words}"
        return "\n".join((begins, *(later.sentence for later in self.later_rounds)))


class ToDo(NamedTuple):
    """Number of missing runs, and of further runs that may follow from them."""

    to_run: int
    at_most_more: int


@dataclass(frozen=True)
class CampaignPlan:
    """The plan of a whole campaign: a graph of steps (nodes with `kind`, `name`, `state`, `count`), and a row per
    stage."""

    graph: nx.DiGraph[str]
    stages: tuple[StagePlan, ...]
    jobs: int
    allocation: AllocationPlan | None = None
    """The rounds so far, if mutants are allocated in rounds."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "stages": self.stages,
            "runs": self.runs_to_do,
            "jobs": self.jobs,
            "at_most_s": rounded(self.estimated_s, 1),
            "measured": self.measured,
            "allocation": or_null(self.allocation),
            "graph": self.links,
        }

    @property
    def estimated_s(self) -> float:
        """Return an estimate of the wall time of the remaining steps, s.

        How many steps follow from the results is not known: their largest number is multiplied by the usual share of
        it, so the steps may take longer.
        """
        return (
            sum((stage.to_run + stage.at_most * stage.step.share) * stage.each_s for stage in self.stages) / self.jobs
        )

    @property
    def measured(self) -> bool:
        """Return whether all times come from the store."""
        return all(stage.measured or not stage.to_run + stage.at_most for stage in self.stages)

    @property
    def runs_to_do(self) -> ToDo:
        """Return the number of runs known to be missing, and of further runs that may follow."""
        stages = [stage for stage in self.stages if stage.step.drives]
        return ToDo(sum(s.to_run for s in stages), sum(s.at_most for s in stages))

    @property
    def links(self) -> dict[str, Any]:
        """Return the graph as nodes and links."""
        return dict(nx.node_link_data(self.graph, edges="links"))

    def as_dot(self) -> str:
        """Return the graph for Graphviz: done steps green, missing ones white, possible ones dashed."""
        looks = {"done": 'style=filled fillcolor="#c7e9c0"', "to_run": "style=solid", "at_most": "style=dashed"}
        lines = ["digraph campaign {", "  rankdir=LR", "  node [shape=box fontsize=10]"]
        titles = {step.kind: step.title for step in STEPS}
        for name, data in self.graph.nodes(data=True):
            more = f"at most {data['count']} {titles[data['kind']]}"
            label = more if data["state"] == "at_most" else f"{data['kind']}\\n{data['name']}"
            lines.append(f'  "{name}" [label="{label}" {looks[data["state"]]}]')
        lines += [f'  "{above}" -> "{below}"' for above, below in self.graph.edges]
        return "\n".join((*lines, "}"))


def plan_campaign(stages: Stages, store: Store | None, *, jobs: int) -> CampaignPlan:
    """Return the plan of a campaign; `store` is None if there is none, `jobs` is the number of workers."""
    graph: nx.DiGraph[str] = nx.DiGraph()
    for rounds in stages.rounds:
        while rounds.ready and rounds.next():
            pass
    all_done = all(row is not None for _, row in stages.walk())
    if all_done:
        choose_representatives(stages)
    for node, row in stages.walk():
        state = "to_run" if row is None else "done"
        graph.add_node(_name(node), kind=node.step.kind, name=node.step.name, key=node.step.key, state=state, count=1)
        if node.above is not None:
            graph.add_edge(_name(node.above), _name(node))
        if row is None or (not all_done and stages.chosen_after(node, row)):
            _add_followers(graph, node, stages.settings, is_done=row is not None)
    allocated = None
    if stages.rounds:
        if left := sum(rounds.left for rounds in stages.rounds):
            _add_children(graph, "children of later rounds", left, stages.settings)
        begun = tuple(later for rounds in stages.rounds for later in rounds.begun)
        method = METHODS[stages.settings.allocation]
        allocated = AllocationPlan(method.rounds, stages.settings.first_children, begun, method.words)
    return CampaignPlan(graph, _stage_plans(graph, store, stages.settings), jobs, allocated)


def _name(node: StepNode) -> str:
    step = node.step
    if not isinstance(step, MutantsStep):
        return f"{step.kind} {step.name}"
    later = f" round {step.request.round}" if step.request.round > 1 else ""
    return f"{step.kind} {step.name} seed {step.seed}{later}"


def _add_followers(graph: nx.DiGraph[str], node: StepNode, settings: CampaignSettings, *, is_done: bool) -> None:
    """Add the steps that may follow from a step: one node per stage, which stands for all of them.

    `is_done`: the step has been run, so only steps that follow from chosen ones are still open.
    """
    step = node.step
    if isinstance(step, MutantsStep) and step.request.children:
        name, count = f"{ChildStep.kind} of {_name(node)}", len(step.request.children)
        _add_children(graph, name, count, settings)
        graph.add_edge(_name(node), name)
        return
    _add_below(graph, step.kind, _name(node), 1, settings, is_done=is_done)


def _add_children(graph: nx.DiGraph[str], name: str, count: int, settings: CampaignSettings) -> None:
    """Add mutants that are not known yet, and the steps that may follow from them."""
    graph.add_node(name, kind=ChildStep.kind, name="", key="", state="at_most", count=count)
    _add_below(graph, ChildStep.kind, name, count, settings, is_done=False)


def _add_below(
    graph: nx.DiGraph[str], kind: str, name: str, many: int, settings: CampaignSettings, *, is_done: bool
) -> None:
    above = {kind: (name, many)}
    for step in STEPS:
        if step.follows not in above or (is_done and step.follows == kind and not step.after_all):
            continue
        over, count = above[step.follows]
        count *= step.at_most(settings)
        if count:
            below = f"{step.kind} of {name}"
            graph.add_node(below, kind=step.kind, name="", key="", state="at_most", count=count)
            graph.add_edge(over, below)
            above[step.kind] = below, count


def _stage_plans(graph: nx.DiGraph[str], store: Store | None, settings: CampaignSettings) -> tuple[StagePlan, ...]:
    counts: Counter[tuple[str, str]] = Counter()
    keys: set[str] = set()
    for _, data in graph.nodes(data=True):
        if data["key"] and data["key"] in keys:
            continue  # two names for the same run
        keys.add(data["key"])
        counts[data["kind"], data["state"]] += data["count"]
    measured = store.mean_wall_s(settings.driver) if store is not None else {}
    return tuple(
        StagePlan(step, counts[step.kind, "done"], counts[step.kind, "to_run"], counts[step.kind, "at_most"],
                  each_s=measured.get(step.kind, step.usual_s), measured=step.kind in measured)
        for step in STEPS
    )  # fmt: skip
