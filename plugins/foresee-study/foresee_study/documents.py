"""The JSON documents that the commands of this plug-in print; see `foresee_dsl.cli.documents`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from foresee_study.fuzz.records import FuzzResult
from foresee_study.planning import QuestionPlan
from foresee_study.tables.table import Table

DOCUMENTS: Mapping[str, Any] = MappingProxyType({
    "fuzz": FuzzResult,
    "study": ({"tables": list[Table]}, {"questions": list[QuestionPlan]}),
})  # fmt: skip
"""All documents by name, in the form that `foresee_dsl.documents.shape` takes."""
