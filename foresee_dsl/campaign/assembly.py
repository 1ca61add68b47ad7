"""Assembles a campaign's result from the results in its store, with the names of this campaign, and chooses from it the
failures to minimise."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypedDict, assert_never

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.allocation.rounds import FIRST_WHY
from foresee_dsl.campaign.driving import relative_path
from foresee_dsl.campaign.grouping import findings_of
from foresee_dsl.campaign.records import (
    FAILED,
    CaseRunOutcome,
    ChildOutcome,
    ClipOutcome,
    Forecast,
    Minimised,
    Mutants,
    Record,
    Repeats,
    decode,
)
from foresee_dsl.campaign.results import CampaignResult, sorted_outcomes
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.minimise import MinimiseStep
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.step import StepNode
from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.language.model import Clip, Mutant, Origin
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.trace import Trace

_NO_FILE_NAME = re.compile(r"[^\w+-]")


Traces = dict[str, tuple[str, str]]
"""The stored traces to copy into the campaign's folder, by their files in it. Each trace comes with the id that its
test case has here if another campaign stored the trace under another id, otherwise with ""."""


def reference_trace(file: str, driver: str) -> str:
    """Return the file of a reference driver's run of the failure in a file: `NAME.idm.npz` beside `NAME.foresee`."""
    return f"{file.rpartition('.')[0]}.{_NO_FILE_NAME.sub('_', driver)}.npz"


@Part.FOLDER.measured
def assemble(stages: Stages, out: Path, *, failures: bool = False) -> tuple[CampaignResult, Traces]:
    """Return the result of all steps that have one, without its wall time, and the traces of its runs.

    Args:
        stages: the steps. out: the campaign's folder.
        failures: skip mutants that did not fail, so that their results need not be read.
    """
    seeds: dict[StepNode, CaseRunOutcome] = {}
    clips: dict[StepNode, ClipOutcome] = {}
    children: dict[StepNode, dict[StepNode, ChildOutcome]] = {}
    traces: Traces = {}
    minimised: dict[StepNode, Minimised] = {}
    references: dict[StepNode | None, tuple[ReferenceRun, ...]] = {}
    for node, row in _results(stages, failures=failures):
        record: Record = decode(row.record, node.step.record)
        case, trace = node.case, f"traces/{node.step.name}.npz"
        match record:
            case CaseRunOutcome():
                if row.trace:
                    traces[trace] = (row.trace, case.id if record.id != case.id else "")
                seeds[node] = replace(record, id=case.id, family=case.family, scenario=case.scenario.name,
                                      trace=trace if row.trace else "", meaning=case.meaning)  # fmt: skip
            case Forecast():
                seed = node.over("seed")
                seeds[seed] = replace(seeds[seed], risky_points=record.points)
            case ClipOutcome():  # of the clip itself, or of its later check, which takes its place
                clip = node.over("clip")
                clips[clip] = replace(record, seed=case.id, family=case.family, name=clip.step.name, file=clip.file,
                                      rank=clip.step.rank)  # fmt: skip
                children.setdefault(clip, {})
            case Mutants() | Repeats():
                pass  # mutants are separate steps, and repeats are stored beside the steps
            case ChildOutcome():
                if row.trace:
                    file = (out / node.file).as_posix()
                    traces[trace] = (row.trace, file if record.file != file else "")
                children[node.over("clip")][node] = replace(record, name=node.step.name, file=node.file,
                                                            **_allocated(node))  # fmt: skip
            case ReferenceRun():
                references[node.above] = (*references.get(node.above, ()), record)
                traces |= _run_beside(node, row, record.driver)
            case Minimised():
                minimised[node] = _here(record, node, out)
                if row.trace:
                    file = (out / node.file).as_posix()
                    renamed = file if record.child.file != file else ""
                    traces[node.file.replace(".foresee", ".npz")] = (row.trace, renamed)
            case _:
                assert_never(record)
    _drop_untrusted(clips, children, traces, stages.settings.fidelity_limit_m)
    completed = {node: replace(seed, references=references.get(node, ())) for node, seed in seeds.items()}
    whole = (
        _with_headers(replace(clip, children=_with_references(children[node], references)), node, out)
        for node, clip in clips.items()
    )
    small = (_answered(small_finding, references.get(node, ())) for node, small_finding in minimised.items())
    by_name = tuple(sorted(small, key=lambda small_finding: small_finding.child.name))
    seed_runs, clip_runs = sorted_outcomes(completed.values(), whole)
    return CampaignResult(stages.settings, seed_runs, clip_runs, 0.0, minimised=by_name), traces


def _drop_untrusted(
    clips: dict[StepNode, ClipOutcome], children: dict[StepNode, dict[StepNode, ChildOutcome]], traces: Traces,
    limit_m: float,
) -> None:  # fmt: skip
    """Remove the mutants of each clip that was run after them and that fails or deviates too far; the clip states
    their number.
    """
    for clip, outcome in clips.items():
        if not outcome.trusted(limit_m):
            for node in children[clip]:
                traces.pop(f"traces/{node.step.name}.npz", None)
            clips[clip], children[clip] = replace(outcome, dropped=len(children[clip])), {}


def _run_beside(node: StepNode, row: StoredResult, driver: str) -> Traces:
    """Return the stored trace of a reference driver's run; the key is the file, beside the failure's, that the trace
    gets. The result is empty if no trace is stored.
    """
    if not row.trace or node.above is None:
        return {}
    above = node.above
    return {reference_trace(above.file if above.step.kind == MinimiseStep.kind else f"traces/{above.step.name}.npz",
                            driver): (row.trace, "")}  # fmt: skip


def _results(stages: Stages, *, failures: bool) -> Iterator[tuple[StepNode, StoredResult]]:
    for node, row in stages.walk(failures=failures):
        if row is not None and not (failures and isinstance(node.step, ChildStep) and row.verdict not in FAILED):
            yield node, row


class _Allocated(TypedDict, total=False):
    round: int | None
    drawn_near: str
    why: str


def _allocated(node: StepNode) -> _Allocated:
    """Return the round in which a mutant was drawn, the mutant whose changes it uses, and why it was drawn; empty
    without rounds and without mutants of earlier campaigns.
    """
    step, above = node.step, node.over("mutants").step
    if not isinstance(above, MutantsStep) or not isinstance(step, ChildStep):
        return {}
    request = above.request
    wanted = next((child for child in request.children if child.number == step.mutant.number), None)
    if wanted is None:
        return {"round": request.round, "why": FIRST_WHY} if request.round else {}
    near = f"{step.name.removesuffix(wanted.suffix)}{wanted.near_suffix}" if wanted.near_suffix else ""
    return {"round": request.round or None, "drawn_near": near, "why": wanted.why}


def _answered(small: Minimised, references: tuple[ReferenceRun, ...]) -> Minimised:
    """Return a minimised mutant with the reference drivers' runs, and with the drivers that avoid its failure in its
    text.
    """
    child = replace(small.child, references=references)
    return replace(small, child=replace(child, text=_with_origin(child.text, child)))


def _with_references(
    children: dict[StepNode, ChildOutcome], references: dict[StepNode | None, tuple[ReferenceRun, ...]]
) -> tuple[ChildOutcome, ...]:
    pairs = ((child, references.get(node, ())) for node, child in children.items())
    return tuple(child if runs == child.references else replace(child, references=runs) for child, runs in pairs)


def _with_headers(clip: ClipOutcome, node: StepNode, out: Path) -> ClipOutcome:
    """Write this campaign's names into the texts of a clip and of its mutants that are written to files."""
    if not clip.written:
        return clip
    parent = relative_path(node.case.source, out / node.folder)
    text = with_header(clip.text, "clip", node.step.name, parent, node.case.id.partition("::")[2])
    children = (
        replace(
            child, text=_with_origin(with_header(child.text, "mutant", child.name, f"{node.step.name}.foresee"), child)
        )
        if child.is_written
        else child
        for child in clip.children
    )
    return replace(clip, text=text, children=tuple(children))


def _with_origin(text: str, child: ChildOutcome) -> str:
    """Write into a mutant's origin why it was made, and which reference drivers avoid its failure."""
    if not (child.avoided or child.why):
        return text
    document = parse(text, child.name)
    avoided = "; ".join(run.sentence for run in child.avoided) or None

    def written(origin: Origin) -> Origin:
        why = "; ".join(part for part in (origin.why, child.why.replace('"', "'")) if part) or None
        return origin.model_copy(update={"avoided": avoided or origin.avoided, "why": why})

    body = tuple(written(item) if isinstance(item, Origin) else item for item in document.model.body)
    return print_model(document.model.model_copy(update={"body": body}), document.comments)


def _here(small: Minimised, node: StepNode, out: Path) -> Minimised:
    """Write this campaign's names into a minimised mutant and its clip."""
    name, clip = node.step.name, node.over("clip").step.name
    parent = relative_path(node.case.source, out / node.folder)
    text = with_header(small.clip_text, "clip", clip, parent, node.case.id.partition("::")[2])
    own = with_header(small.child.text, "mutant", name, f"{clip}.foresee")
    child = replace(small.child, name=name, file=node.file, text=own, why=_allocated(node.over("child")).get("why", ""))
    return replace(small, clip=clip, clip_text=text, child=child)


def with_header(text: str, kind: str, name: str, parent: str, case: str = "") -> str:
    """Return a clip's or mutant's text with this campaign's names; another campaign may have written it."""
    begins = f'{kind} {name} of "{parent}"{f" case {case}" if case else ""} pin '
    if "".join(text.split("\n", 3)[2:3]).startswith(begins):
        return text
    document = parse(text, name)
    model, comments = document.model, document.comments
    if isinstance(model, Clip):
        return print_model(model.model_copy(update={"name": name, "parent": parent, "case": case or None}), comments)
    if isinstance(model, Mutant):
        return print_model(model.model_copy(update={"name": name, "parent": parent}), comments)
    raise TypeError(f"{name} is neither clip nor mutant")


def trace_of(data: bytes, test_case: str) -> bytes:
    """Return a packed trace whose metadata names this test case."""
    trace = Trace.load(io.BytesIO(data))
    return replace(trace, meta={**trace.meta, "test_case": test_case}).packed()


def choose_representatives(stages: Stages) -> tuple[StepNode, ...]:
    """Return the steps that minimise the findings' representatives; a test case that fails without mutation has none.

    With a shard, only its own findings count.
    """
    result, _ = assemble(stages, stages.out, failures=True)
    findings = findings_of(result.seeds, result.clips)
    return stages.choose({f.name for f in findings if isinstance(f.representative, ChildOutcome)})
