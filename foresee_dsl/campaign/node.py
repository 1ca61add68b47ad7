"""One step of a campaign in its place: the test case that it has to do with, and the step that it follows from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from foresee_dsl.campaign.steps.step import Step
from foresee_dsl.language.project.document import TestCase

AnyStep = Step[Any, Any]


@dataclass(frozen=True, eq=False)
class Node:
    """One step of a campaign, and the test case and the step that it follows from."""

    step: AnyStep
    case: TestCase
    above: Node | None = None

    @property
    def folder(self) -> str:
        """Where the files of the clips and children are, relative to the campaign's folder."""
        return self.step.folder(self.case)

    @property
    def file(self) -> str:
        """Its own file there."""
        return f"{self.folder}/{self.step.name}.foresee"

    def over(self, kind: str) -> Node:
        """Return the step of a kind that it follows from (or itself).

        Raises:
            ValueError: it follows from none of that kind.
        """
        node: Node = self
        while node.step.kind != kind:
            if node.above is None:
                raise ValueError(f"{self.step.kind} {self.step.name} follows from no {kind}")
            node = node.above
        return node
