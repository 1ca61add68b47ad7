"""What a campaign would do, before anything runs: its steps as a graph, what is done already, and how long it takes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

import networkx as nx

from foresee_dsl.campaign.findings.representatives import choose_representatives
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import STEPS, AnyStep, Node, Stages
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

    shown = "stages runs=runs_to_do jobs at_most_s=longest_s:1 measured graph=links"

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
    return CampaignPlan(graph, _stage_plans(graph, store, stages.settings), jobs)


def _name(node: Node) -> str:
    return f"{node.step.kind} {node.step.name}" + (f" seed {node.step.seed}" if node.step.kind == "mutants" else "")


def _add_followers(graph: nx.DiGraph[str], node: Node, settings: CampaignSettings, *, known: bool) -> None:
    """Add what may follow from a step: a node a stage, which stands for that many.

    `known`: the step has been run, so that only what follows from chosen ones is still open.
    """
    above = {node.step.kind: (_name(node), 1)}
    for step in STEPS:
        if step.follows not in above or (known and step.follows == node.step.kind and not step.after_all):
            continue
        over, count = above[step.follows]
        count *= step.at_most(settings)
        if count:
            below = f"{step.kind} of {_name(node)}"
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
