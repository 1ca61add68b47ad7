"""How reports call the two careful drivers, whose answers stand side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from foresee_dsl.campaign.findings.grouping import Finding

R157 = "R157's driver"
"""The model of UN Regulation 157 (`derive.preventability`)."""
ANTICIPATING = "an anticipating driver"
"""The other one (`derive.anticipating`)."""


def answers_of(finding: Finding) -> Iterator[tuple[str, str, str]]:
    """Yield who, what it answers, and why, of each of the two that was asked."""
    if finding.preventability is not None:
        yield R157, finding.preventability.verdict.value, finding.preventability.why
    if finding.anticipation is not None:
        yield ANTICIPATING, finding.anticipation.answer.value, finding.anticipation.why
