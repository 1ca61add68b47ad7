"""What a campaign would do, before anything runs: its steps as a graph, what is done already, and how long it takes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

import networkx as nx

from foresee_dsl.campaign.allocation.rounds import ROUNDS, Round
from foresee_dsl.campaign.findings.representatives import choose_representatives
from foresee_dsl.campaign.node import AnyStep, Node
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import STEPS, Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.storage.store import Store


@dataclass(frozen=True)
class StagePlan:
    """All steps of one class: those in the store, those that are missing, and how many may follow from these at most.

    `each_s`: wall time of one step; `measured`: whether it is the mean of those in the store.
    """

    step: type[AnyStep]
    done: int
    to_run: int
    at_most: int
    each_s: float
    measured: bool

    shown = "stage=kind done to_run at_most_more=at_most each_s:3 measured"

    @property
    def kind(self) -> str:
        """The steps' kind."""
        return self.step.kind


@dataclass(frozen=True)
class Allocated:
    """Where children are allocated in rounds: how many rounds there are, and those that are known so far.

    Attributes:
        rounds: how many, the first included, which gives each clip `first` children. known: the later ones that have
            begun, of each part of the campaign.
    """

    rounds: int
    first: int
    known: tuple[Round, ...]

    shown = "rounds first known"

    @property
    def told(self) -> str:
        """How children are allocated, and the last rounds that are known, in sentences."""
        begins = (f"children are allocated in {self.rounds} rounds: {self.first} a clip, then to those clips that the "
                  "rounds before say will pay")  # fmt: skip
        return "\n".join((begins, *(one.told for one in self.known)))


class ToDo(NamedTuple):
    """How many runs are missing, and how many more may follow from them."""

    to_run: int
    at_most_more: int


@dataclass(frozen=True)
class CampaignPlan:
    """The whole campaign: a graph of steps (nodes with `kind`, `name`, `state` and `count`), and a row a stage."""

    graph: nx.DiGraph[str]
    stages: tuple[StagePlan, ...]
    jobs: int
    allocation: Allocated | None = None
    """Where children are allocated in rounds: how far these are."""

    shown = "stages runs=runs_to_do jobs at_most_s=longest_s:1 measured allocation? graph=links"

    @property
    def longest_s(self) -> float:
        """Wall time of what is to run, at most: what follows from a run is not known before it.

        Of the failures that are minimised it is a usual share.
        """
        return (
            sum((stage.to_run + stage.at_most * stage.step.share) * stage.each_s for stage in self.stages) / self.jobs
        )

    @property
    def measured(self) -> bool:
        """Whether all times are the store's own."""
        return all(stage.measured or not stage.to_run + stage.at_most for stage in self.stages)

    @property
    def runs_to_do(self) -> ToDo:
        """How many runs are known to be missing, and how many more may follow."""
        stages = [stage for stage in self.stages if stage.step.drives]
        return ToDo(sum(s.to_run for s in stages), sum(s.at_most for s in stages))

    @property
    def links(self) -> dict[str, Any]:
        """The graph as nodes and links."""
        return dict(nx.node_link_data(self.graph, edges="links"))

    def as_dot(self) -> str:
        """Return the graph for Graphviz: done steps green, missing ones white, what may follow dashed."""
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
    """Look at what there is to do; `store` is None where nothing was run, `jobs` are the workers, for the time."""
    graph: nx.DiGraph[str] = nx.DiGraph()
    for rounds in stages.rounds:
        while rounds.known and rounds.next():
            pass
    known = all(row is not None for _, row in stages.walk())
    if known:
        choose_representatives(stages)
    for node, row in stages.walk():
        state = "to_run" if row is None else "done"
        graph.add_node(_name(node), kind=node.step.kind, name=node.step.name, key=node.step.key, state=state, count=1)
        if node.above is not None:
            graph.add_edge(_name(node.above), _name(node))
        if row is None or (not known and stages.may_be_chosen(node, row)):
            _add_followers(graph, node, stages.settings, known=row is not None)
    allocated = None
    if stages.rounds:
        if left := sum(rounds.left for rounds in stages.rounds):
            _add_children(graph, "children of later rounds", left, stages.settings)
        begun = tuple(one for rounds in stages.rounds for one in rounds.begun)
        allocated = Allocated(ROUNDS, stages.settings.first_children, begun)
    return CampaignPlan(graph, _stage_plans(graph, store, stages.settings), jobs, allocated)


def _name(node: Node) -> str:
    step = node.step
    if not isinstance(step, MutantsStep):
        return f"{step.kind} {step.name}"
    later = f" round {step.asked.round}" if step.asked.round > 1 else ""
    return f"{step.kind} {step.name} seed {step.seed}{later}"


def _add_followers(graph: nx.DiGraph[str], node: Node, settings: CampaignSettings, *, known: bool) -> None:
    """Add what may follow from a step: a node a stage, which stands for that many.

    `known`: the step has been run, so that only what follows from chosen ones is still open.
    """
    step = node.step
    if isinstance(step, MutantsStep) and step.asked.children:
        name, count = f"{ChildStep.kind} of {_name(node)}", len(step.asked.children)
        _add_children(graph, name, count, settings)
        graph.add_edge(_name(node), name)
        return
    _add_below(graph, step.kind, _name(node), 1, settings, known=known)


def _add_children(graph: nx.DiGraph[str], name: str, count: int, settings: CampaignSettings) -> None:
    """Add children that are not known yet, and what may follow from them."""
    graph.add_node(name, kind=ChildStep.kind, name="", key="", state="at_most", count=count)
    _add_below(graph, ChildStep.kind, name, count, settings, known=False)


def _add_below(
    graph: nx.DiGraph[str], kind: str, name: str, many: int, settings: CampaignSettings, *, known: bool
) -> None:
    above = {kind: (name, many)}
    for step in STEPS:
        if step.follows not in above or (known and step.follows == kind and not step.after_all):
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
            continue  # two names of one run
        keys.add(data["key"])
        counts[data["kind"], data["state"]] += data["count"]
    measured = store.mean_wall_s(settings.driver) if store is not None else {}
    return tuple(
        StagePlan(step, counts[step.kind, "done"], counts[step.kind, "to_run"], counts[step.kind, "at_most"],
                  each_s=measured.get(step.kind, step.usual_s), measured=step.kind in measured)
        for step in STEPS
    )  # fmt: skip
