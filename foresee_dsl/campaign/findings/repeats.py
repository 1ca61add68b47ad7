"""Runs the findings of a campaign again in other processes: a driver that then drives differently is not
deterministic, and its findings get rates."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial

from foresee_dsl.campaign.driving import DriverSetup, longest_s
from foresee_dsl.campaign.grouping import Finding
from foresee_dsl.campaign.keys import key
from foresee_dsl.campaign.records import CaseRunOutcome, Repeats, decode, encode
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.inputs import clip_of, mutant_of
from foresee_dsl.campaign.steps.step import StepNode
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.workers.pool import BrokenTask, RunOptions, Task, WorkerPool
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.simulate.trace import Trace

RUNS = 10
"""Number of runs of a finding whose second run differs. Ours: a rate in tenths separates a failure that nearly always
happens from one that seldom does, for 4 s of computation each."""
_KIND = "repeat"
Ending = tuple[str, str]
"""Verdict and digest of a run."""


@dataclass(frozen=True)
class _FindingRun:
    """A finding's run: its test case, the driver's seed, the key of its result, and how it ended."""

    case: TestCase
    seed: int
    key: str
    first: Ending


def repeated(
    result: CampaignResult, traces: Mapping[str, tuple[str, str]], stages: Stages, store: Store, options: RunOptions
) -> dict[str, Repeats]:
    """Run each finding once more in another interpreter; if that run differs, run the finding `RUNS` times in all.

    Each interpreter has its own seed for the hashes of strings, unless `PYTHONHASHSEED` is set. A run that breaks or
    hangs says nothing, and its finding gets no entry. Results are stored; a finding is repeated once.

    Args:
        traces: blob by file of the campaign's folder.

    Returns:
        The repeats by the name of the finding.
    """
    nodes = {node.step.name: node for node in stages.named({_node_name(finding) for finding in result.findings})}
    subjects: dict[str, _FindingRun] = {}
    stored: dict[str, Repeats] = {}
    for finding in result.findings:
        subject = _subject(finding, nodes[_node_name(finding)], traces, stages, store)
        if subject is None:
            continue
        row = store.get(subject.key)
        record = decode(row.record, Repeats) if row is not None else None
        if isinstance(record, Repeats):
            stored[finding.name] = record
        else:
            subjects[finding.name] = subject
    endings = {name: [subject.first] for name, subject in subjects.items()}
    again = partial(_run_again, subjects, endings, result, options)
    again(subjects)
    differing = [name for name, ends in endings.items() if len(set(ends)) > 1]
    for _ in range(RUNS - 2 if differing else 0):
        again(differing)
    for name, ends in endings.items():
        if len(ends) > 1:
            record = Repeats(dict(sorted(Counter(verdict for verdict, _ in ends).items())), len(set(ends)) == 1)
            store.add(
                StoredResult(subjects[name].key, _KIND, name, encode(record), driver=result.settings.driver), None
            )
            stored[name] = record
    return stored


def _run_again(
    subjects: Mapping[str, _FindingRun],
    endings: Mapping[str, list[Ending]],
    result: CampaignResult,
    options: RunOptions,
    names: Collection[str],
) -> None:
    """Run findings once more, in interpreters that are started for this, and add how each run ended."""
    if not names:
        return
    limits, settings = options.limits, result.settings
    with WorkerPool(min(options.jobs, len(names)), memory_mb=limits.memory_mb, fresh=True) as pool:
        outcomes = pool.outcomes(
            Task(
                name,
                partial(_ending, DriverSetup(settings.driver, subjects[name].seed, limits.deadlines, settings.rules)),
                subjects[name].case,
                limits.for_run(longest_s(subjects[name].case)),
            )
            for name in names
        )
    for name, outcome in zip(names, outcomes, strict=True):
        if outcome is not None and not isinstance(outcome, BrokenTask):
            endings[name].append(outcome)


def _ending(setup: DriverSetup, case: TestCase) -> Ending | None:
    """Return how a run ends; None if it hangs, which depends on the machine."""
    result = setup.run(case)
    return None if result.notes.hang is not None else (result.verdict.value, result.trace.digest)


def _node_name(finding: Finding) -> str:
    """Return the name of a finding's step."""
    run = finding.representative
    trace = run.trace.removeprefix("traces/").removesuffix(".npz") if isinstance(run, CaseRunOutcome) else ""
    return trace or finding.name


def _subject(
    finding: Finding, node: StepNode, traces: Mapping[str, tuple[str, str]], stages: Stages, store: Store
) -> _FindingRun | None:
    """Return what is run for a finding; None if its run hung or left no trace."""
    run, seed = finding.run, node.step.seed
    if run.hangs:
        return None
    if isinstance(run, CaseRunOutcome):
        blob = store.blobs.get(traces[run.trace][0]) if run.trace else None
        if blob is None:
            return None
        case, digest = replace(node.case, document=None), Trace.load(io.BytesIO(blob)).digest
    else:
        if not isinstance(node.step, ChildStep):
            return None
        small, folder = finding.reduced, stages.out / node.folder
        clip_model = clip_of(small.clip_text if small is not None else node.step.draft.text)
        clip = expand_clip(clip_model, node.case, source=folder / f"{clip_model.name}.foresee")
        case = replace(expand_mutant(mutant_of(run.text), clip, source=folder / f"{run.name}.foresee"), document=None)
        digest = run.digest
    own = key(ChildStep, repeats=node.step.key, digest=digest)
    return _FindingRun(case, seed, own, (run.verdict.value, digest))
