"""Every JSON document that a command prints, from which `docs/schemas` is generated.

A document's first keys are `schema`, its number, and `document`, its name: `docs/schemas/NAME-NUMBER.json` describes
it. The number increases when a key is removed or changes its meaning; new keys may appear at any time, so readers must
ignore keys that they do not know.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal, NotRequired

from pydantic import TypeAdapter

from foresee_dsl.campaign.assessment import Assessment
from foresee_dsl.campaign.conformance.records import Conformance
from foresee_dsl.campaign.findings.diagnosing import DiagnosedFailure
from foresee_dsl.campaign.findings.sureness import Sureness
from foresee_dsl.campaign.grouping import Finding
from foresee_dsl.campaign.plan import CampaignPlan
from foresee_dsl.campaign.profiling.profile import Profile
from foresee_dsl.campaign.records import Minimised
from foresee_dsl.campaign.regression.comparison import CampaignComparison
from foresee_dsl.campaign.regression.expectations import Status
from foresee_dsl.campaign.regression.keeping import Report as Kept
from foresee_dsl.campaign.regression.verify import Recheck
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.storage.maintenance import MergeCounts, Statistics, Swept
from foresee_dsl.campaign.triage.decisions import Decision
from foresee_dsl.campaign.triage.history import CampaignChange
from foresee_dsl.campaign.triage.standing import Standing
from foresee_dsl.cli.about import InstallationCheck
from foresee_dsl.cli.options.common import SCHEMA_NUMBERS
from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.documents import shape
from foresee_dsl.drivers.following import Deviation
from foresee_dsl.drivers.registry import DriverInfo
from foresee_dsl.errors import Diagnostic
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.codes import Code
from foresee_dsl.language.diff.addresses import Differences
from foresee_dsl.language.repinning.repin import DerivedFile
from foresee_dsl.report.page.contents import Contents
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import DriverNotes, ExpectationResult, Impact, UnfiredTrigger, Verdict

_STANDING = {"standing": NotRequired[shape(Standing)]}
"""The key that `foresee campaign` prints but `campaign.json` does not have, with its type."""
_PROFILE = {"profile": NotRequired[shape(Profile)]}
"""The keys that are present only with `--profile`, with their types."""
_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_RUN = {
    "test_case": str, "driver": str, "seed": int, "verdict": Verdict, "time_s": float, "with": str, "reason": str,
    "impact": Impact | None, "near_misses": NearMisses, "duration_s": float, "steps": int,
    "expectations": list[ExpectationResult], "unfired": list[UnfiredTrigger],
    "tracking": Deviation | None,
    **shape(DriverNotes).__annotations__, "trace": str | None, "digest": str,
}  # fmt: skip
_MUTANT = {"file": str, "operators": list[str], "verdict": Verdict, "with": str, "reason": str, "digest": str}
_CASE = {"name": str, "values": dict[str, str]}
_REACH = {"name": str, "smallest": str, "largest": str, "reached": int, "bins": int, "of": str}
_REPINNED = {**shape(DerivedFile).__annotations__, "verdict": list[str] | None}
_MUTATION = {"name": str, "changes": list[str], "verdict": Verdict, "reason": str, "margins": NearMisses | None}
_MINIMISED = {"mutant": str, "full": Literal[False], "files": list[str], "runs_now": int} | {
    key: kind for key, kind in shape(Minimised).__annotations__.items() if key not in ("file", "clip")
}
_CAMPAIGN = {"folder": str, **shape(CampaignResult).__annotations__, **_STANDING}
_PLAN = {"driver": str, "ranker": str, **shape(CampaignPlan).__annotations__}

DOCUMENTS: Mapping[str, Any] = MappingProxyType({
    "assess": Assessment,
    "campaign": {**shape(CampaignResult).__annotations__, **_STANDING, **_PROFILE},
    "campaigns": {"campaigns": [_CAMPAIGN], **_PROFILE},
    "check": {"ok": bool, "files": int, "test_cases": int, "diagnostics": list[Diagnostic]},
    "clip": {"clip": str, "fidelity_m": float, "fidelity_ego_m": float, **shape(RiskyPoint).__annotations__},
    "compare": CampaignComparison,
    "conform": Conformance,
    "compile": {"test_case": str, "key": str, "files": list[str]},
    "diagnose": {"diagnoses": list[DiagnosedFailure]},
    "diff": Differences,
    "doctor": {"ok": bool, "findings": list[InstallationCheck]},
    "drivers": {"drivers": list[DriverInfo]},
    "error": {"ok": Literal[False], "message": str, "diagnostics": list[Diagnostic]},
    "explain": {"codes": list[Code]},
    "export": Imported,
    "forecast": {"trace": str, "ranker": str, "risky_points": list[RiskyPoint]},
    "history": {"campaigns": [CampaignChange]},
    "import": Imported,
    "keep": Kept,
    "minimise": (_MINIMISED, {"mutant": str, "full": Literal[True], "files": list[str]}),
    "models": {"models": list[ModelSpec]},
    "mutate": {"clip": str, "preset": str, "children": [_MUTANT]},
    "plan": CampaignPlan,
    "plans": {"plans": [_PLAN]},
    "repin": {"ok": bool, "written": list[str], "children": [_REPINNED]},
    "report": Contents,
    "review": ({
        "finding": Finding, "asked": str, "others": [_MUTATION], "withstood": list[str],
        "files": {"as_found": str, "to_look_at": str}, "commands": list[str],
        "diagnosis": str | None, "sure": Sureness | None, "standing": str | None, "why": NotRequired[str],
    }, {"findings": [Finding], "standing": Standing}),
    "run": {**_RUN, **_PROFILE},
    "runs": {"runs": [_RUN], **_PROFILE},
    "sample": {
        "file": str, "scenario": str, "cases": [_CASE], "distinct": int,
        "parameters": [_REACH], "pairs": {"reached": int, "of": int},
    },
    "store": (Statistics, MergeCounts, Swept, {"rows": int, "file": str}),
    "sure": Sureness,
    "triage": {"file": str, "entries": [Decision], "standing": Standing},
    "verify": {"ok": bool, "counts": dict[Status, int], "written": list[str], "tests": list[Recheck]},
})  # fmt: skip
"""Every document by name, in the form that `foresee_dsl.documents.shape` takes: the record that is printed, a mapping
of keys to types, a list of one of these, or a tuple of alternatives."""


def schemas(documents: Mapping[str, Any] = DOCUMENTS) -> dict[str, str]:
    """Return the text of each schema file by its name; a plug-in passes its own documents."""
    numbers = {name: SCHEMA_NUMBERS.get(name, 1) for name in documents}
    return {f"{name}-{number}.json": _schema(name, number, documents[name]) for name, number in numbers.items()}


def _schema(name: str, number: int, document: Any) -> str:  # noqa: ANN401 - a type, in the form of `shape`
    body = TypeAdapter(shape(document, name.title())).json_schema()
    head = {"schema": {"const": number}, "document": {"const": name}}
    whole = {
        "$schema": _DIALECT,
        "title": f"foresee {name}, schema {number}",
        "type": "object",
        "properties": head,
        "required": list(head),
        "$defs": body.pop("$defs", {}),
        "allOf": [body],
    }
    return json.dumps(whole, indent=2) + "\n"
