"""Chooses the failures to minimise: the representative of each finding, once all mutants have run."""

from __future__ import annotations

from foresee_dsl.campaign.assembly import assemble
from foresee_dsl.campaign.findings.grouping import findings_of
from foresee_dsl.campaign.node import StepNode
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.stages import Stages


def choose_representatives(stages: Stages) -> tuple[StepNode, ...]:
    """Return the steps that minimise the findings' representatives; a test case that fails without mutation has none.

    With a shard, only its own findings count.
    """
    findings = findings_of(assemble(stages, stages.out, failures=True))
    return stages.choose({f.name for f in findings if isinstance(f.representative, ChildOutcome)})
