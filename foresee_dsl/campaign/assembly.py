"""The result of a campaign, put together from what its store holds, under the names that it has in this campaign."""

from __future__ import annotations

import io
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import assert_never

from foresee_dsl.campaign.driving import relative_path
from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome, Forecast, Mutants, Record, SeedOutcome, decode
from foresee_dsl.campaign.results import sorted_outcomes
from foresee_dsl.campaign.stages import Node, Stages
from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.language.model import Clip, Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.simulate.trace import Trace


@dataclass
class Assembly:
    """What was found.

    Attributes:
        seeds, clips: sorted by name. traces: the blobs to show, by their file in the campaign's folder; each with
            the id of its test case where another campaign knew it by another one, else "".
        missing: steps that have no result.
    """

    seeds: tuple[SeedOutcome, ...] = ()
    clips: tuple[ClipOutcome, ...] = ()
    traces: dict[str, tuple[str, str]] = field(default_factory=dict)
    missing: list[Node] = field(default_factory=list)


def assemble(stages: Stages, out: Path) -> Assembly:
    """Collect the results of all steps that have one; `out` is the campaign's folder, where its texts will be."""
    found = Assembly()
    seeds: dict[Node, SeedOutcome] = {}
    clips: dict[Node, ClipOutcome] = {}
    children: dict[Node, list[ChildOutcome]] = {}
    for node, row in stages.walk():
        if row is None:
            found.missing.append(node)
            continue
        record: Record = decode(row.record, node.step.record)
        match record:
            case SeedOutcome():
                seeds[node] = _seed(node, record, row, found)
            case Forecast():
                seed = node.over("seed")
                seeds[seed] = replace(seeds[seed], risky_points=record.points)
            case ClipOutcome():
                clips[node] = replace(record, seed=node.case.id, family=node.case.family, name=node.step.name,
                                      file=node.file, rank=node.step.rank)  # fmt: skip
                children[node] = []
            case Mutants():
                pass  # their children are steps of their own
            case ChildOutcome():
                children[node.over("clip")].append(_child(node, record, row, found, out))
            case _:
                assert_never(record)
    whole = (replace(clip, children=tuple(children[node])) for node, clip in clips.items())
    named = (_headed(clip, node, out) for clip, node in zip(whole, clips, strict=True))
    found.seeds, found.clips = sorted_outcomes(seeds.values(), named)
    return found


def _seed(node: Node, made: SeedOutcome, row: Row, found: Assembly) -> SeedOutcome:
    case = node.case
    trace = f"traces/{node.step.name}.npz" if row.trace else ""
    if trace:
        found.traces[trace] = (row.trace, case.id if made.id != case.id else "")
    return replace(made, id=case.id, family=case.family, scenario=case.scenario.name, trace=trace)


def _child(node: Node, made: ChildOutcome, row: Row, found: Assembly, out: Path) -> ChildOutcome:
    if row.trace:
        file = (out / node.file).as_posix()
        found.traces[f"traces/{node.step.name}.npz"] = (row.trace, file if made.file != file else "")
    return replace(made, name=node.step.name, file=node.file)


def _headed(clip: ClipOutcome, node: Node, out: Path) -> ClipOutcome:
    """Give the texts that will be files (a failing child's and its clip's) the names that they have here."""
    if not clip.failing:
        return clip
    parent = relative_path(node.case.source, out / node.folder)
    text = headed(clip.text, "clip", node.step.name, parent, node.case.id.partition("::")[2])
    children = (
        replace(child, text=headed(child.text, "mutant", child.name, f"{node.step.name}.foresee"))
        if child.verdict.is_failure
        else child
        for child in clip.children
    )
    return replace(clip, text=text, children=tuple(children))


def headed(text: str, kind: str, name: str, parent: str, case: str = "") -> str:
    """Return a clip's or mutant's text as it is called in this campaign: another one may have written it."""
    begins = f'{kind} {name} of "{parent}"{f" case {case}" if case else ""} pin '
    if text.split("\n", 3)[2:3] and text.split("\n", 3)[2].startswith(begins):
        return text
    model = parse(text, name).model
    if isinstance(model, Clip):
        return print_model(model.model_copy(update={"name": name, "parent": parent, "case": case or None}))
    if isinstance(model, Mutant):
        return print_model(model.model_copy(update={"name": name, "parent": parent}))
    raise TypeError(f"{name} is neither clip nor mutant")


def trace_of(data: bytes, test_case: str) -> bytes:
    """Return a packed trace that says that it is of this test case."""
    trace = Trace.load(io.BytesIO(data))
    return replace(trace, meta={**trace.meta, "test_case": test_case}).packed()
