"""A step of a campaign with its test case and the step on whose result it depends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from foresee_dsl.campaign.steps.step import Step
from foresee_dsl.language.project.document import TestCase

AnyStep = Step[Any, Any]


@dataclass(frozen=True, eq=False)
class StepNode:
    """One step of a campaign, its test case, and the step on whose result it depends (`above`)."""

    step: AnyStep
    case: TestCase
    above: StepNode | None = None

    @property
    def folder(self) -> str:
        """Return the folder of the files of clips and mutants, relative to the campaign's folder."""
        return self.step.folder(self.case)

    @property
    def file(self) -> str:
        """Return the step's file, relative to the campaign's folder."""
        return f"{self.folder}/{self.step.name}.foresee"

    def over(self, kind: str) -> StepNode:
        """Return the nearest step of a kind: this step, or one on which it depends.

        Raises:
            ValueError: it follows from no step of that kind.
        """
        node: StepNode = self
        while node.step.kind != kind:
            if node.above is None:
                raise ValueError(f"{self.step.kind} {self.step.name} follows from no {kind}")
            node = node.above
        return node
