"""Runs that gave nothing: the process died, hung, took all memory or raised. Each is a result with its reason."""

from __future__ import annotations

from foresee_dsl.campaign.execution.pool import Broken
from foresee_dsl.campaign.results import ChildOutcome, ClipOutcome, SeedOutcome
from foresee_dsl.campaign.stages import Node
from foresee_dsl.campaign.storage.records import Record, encode
from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.simulate.results.verdict import Verdict

_LONGEST_REASON = 1000
"""As of a driver that raises (`simulate.runner`)."""


def broken_row(key: str, node: Node, broken: Broken) -> Row | None:
    """Return the row of a run that broke; None where no run did, but a forecast or a mutation.

    Args:
        key: of the part of the step's task that broke. node: the step. broken: how.
    """
    if key != node.key or node.kind not in ("seed", "clip", "child"):
        return None
    verdict = Verdict.TIMEOUT if broken.how == "timeout" else Verdict.CRASH
    said = {"raised": f"the run raised {broken.reason}", "crash": broken.reason}.get(
        broken.how, f"the run {broken.reason}"
    )
    # A reason is one line, and goes into texts between double quotes.
    reason = " ".join(said.split()).replace('"', "'")[:_LONGEST_REASON]
    return Row(
        key=key,
        kind=node.kind,
        name=node.name,
        record=encode(_record(node, verdict, reason), node.kind),
        verdict=verdict.value,
        reason=reason,
        broken=True,
        wall_s=(broken.task.deadline_s or 0.0) if verdict is Verdict.TIMEOUT else 0.0,
    )


def _record(node: Node, verdict: Verdict, reason: str) -> Record:
    case = node.case
    if node.kind == "seed":
        return SeedOutcome(case.id, case.family, case.scenario.name, verdict, reason, 0.0, 0.0)
    text = node.draft.text if node.draft else ""
    if node.kind == "clip":
        return ClipOutcome(
            seed=case.id, family=case.family, name=node.name, file=node.file, text=text,
            rank=node.draft.rank if node.draft else 0, verdict=verdict, reason=reason, duration_s=0.0, wall_s=0.0,
            largest_m=0.0, median_m=0.0, within=1.0,
        )  # fmt: skip
    mutant = node.mutant.text if node.mutant else ""
    return ChildOutcome(node.name, node.file, mutant, (), verdict, "", reason, 0.0, 0.0, "")
