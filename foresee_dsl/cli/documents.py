"""The shape of every JSON document that a command prints, from which `docs/schemas` is generated.

A document's first keys are `schema`, its number, and `document`, its name: `docs/schemas/NAME-NUMBER.json` describes
it. The number goes up when a key goes or means something else; new keys may come at any time, so readers ignore keys
that they do not know.
"""

from __future__ import annotations

import json
from types import MappingProxyType
from typing import (
    Any,
    Literal,
    NotRequired,  # pydantic brings it along, and takes no other before Python 3.12
)

from pydantic import TypeAdapter
from typing_extensions import TypedDict

from foresee_dsl.campaign.regression.expectations import Status
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.maintenance import Statistics
from foresee_dsl.derive.minimise.outcome import Dropped, Tried
from foresee_dsl.derive.preventability import Preventability, Preventable
from foresee_dsl.errors import Span
from foresee_dsl.simulate.results.verdict import ExpectationResult, Hang, Verdict
from foresee_dsl.story import ContactClass

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


class Message(TypedDict):
    """One mistake or warning; `span` is null where the whole file is meant, lines and columns begin at 1."""

    code: str
    severity: Literal["error", "warning"]
    message: str
    help: str
    path: str
    span: Span | None


class Error(TypedDict):
    """What a command prints in place of its own document when what it was given has mistakes; its exit code is 1."""

    ok: Literal[False]
    message: str
    diagnostics: list[Message]


class Check(TypedDict):
    """`foresee check --json`."""

    ok: bool
    files: int
    test_cases: int
    diagnostics: list[Message]


class Code(TypedDict):
    """What a code means, with a wrong and a right example."""

    code: str
    severity: Literal["error", "warning"]
    title: str
    explanation: str
    within: str
    wrong: str
    right: str


class Explain(TypedDict):
    """`foresee explain --json`."""

    codes: list[Code]


Near = TypedDict("Near", {"value": float | None, "time_s": float, "with": str})
"""The smallest value of one measure, when, and with whom; null where it is infinite."""


class NearMisses(TypedDict):
    """How near a run came to a failure, by measure."""

    distance_m: Near | None
    ttc_s: Near | None
    pet_s: Near | None
    drac_mps2: Near | None


Impact = TypedDict(
    "Impact",
    {
        "with": str, "side": str, "other_side": str, "ahead_m": float, "left_m": float, "turned_deg": float,
        "struck_by": Literal["ego", "other", "both", "neither"], "relative_mps": float, "closing_mps": float,
        "ego_mps": float, "other_mps": float,
    },
)  # fmt: skip
"""How the ego and another touched."""

Run = TypedDict(
    "Run",
    {
        "test_case": str, "driver": str, "seed": int, "verdict": Verdict, "time_s": float, "with": str, "reason": str,
        "impact": Impact | None, "near_misses": NearMisses, "duration_s": float, "steps": int,
        "expectations": list[ExpectationResult], "output": str, "traceback": str, "hang": Hang | None,
        "trace": str | None, "digest": str,
    },
)  # fmt: skip
"""`foresee run --json` of one test case; `digest` is empty where the driver ended its process. `output`: what the
driver printed; `traceback`: of its exception."""


class Runs(TypedDict):
    """`foresee run --json` of several test cases."""

    runs: list[Run]


class RiskyPoint(TypedDict):
    """A moment around which a failure may hide; `distance_m` is null where the ranker knows none."""

    rank: int
    time_s: float
    frame: int
    actor: str
    group: str
    distance_m: float | None
    why: str


class Forecast(TypedDict):
    """`foresee forecast --json`."""

    trace: str
    ranker: str
    risky_points: list[RiskyPoint]


class Clip(RiskyPoint):
    """`foresee clip --json`."""

    clip: str
    fidelity_m: float
    fidelity_ego_m: float


MutantRun = TypedDict(
    "MutantRun",
    {"file": str, "operators": list[str], "verdict": Verdict, "with": str, "reason": str, "digest": str},
)


class Mutate(TypedDict):
    """`foresee mutate --json`."""

    clip: str
    preset: str
    children: list[MutantRun]


class Compile(TypedDict):
    """`foresee compile --json`."""

    test_case: str
    key: str
    files: list[str]


class DrawnCase(TypedDict):
    """A case and the values of its parameters, as they are written."""

    name: str
    values: dict[str, str]


class Reach(TypedDict):
    """How much of a parameter's range the cases reach."""

    name: str
    smallest: str
    largest: str
    reached: int
    bins: int
    of: str


class Pairs(TypedDict):
    """How many pairs of values occur together."""

    reached: int
    of: int


class Sample(TypedDict):
    """`foresee sample --format json`."""

    file: str
    scenario: str
    cases: list[DrawnCase]
    distinct: int
    parameters: list[Reach]
    pairs: Pairs


class Change(TypedDict):
    """One difference in meaning."""

    group: str
    path: str
    kind: str
    was: Any
    now: Any
    note: str


class TextChange(TypedDict):
    """A difference that means nothing: of a `doc`, of tags, of an origin."""

    path: str
    was: str | None
    now: str | None


class Diff(TypedDict):
    """`foresee diff --json`."""

    old: str
    new: str
    groups: list[str]
    changes: list[Change]
    texts: list[TextChange]


class RepinMistake(TypedDict):
    """Why a child does not fit its edited parent."""

    code: str
    message: str
    help: str


class RepinChild(TypedDict):
    """What a parent's edit does to one child."""

    file: str
    state: str
    parent: str
    pin: str
    new_pin: str | None
    reaching: list[Change]
    overridden: list[Change]
    mistakes: list[RepinMistake]
    verdict: list[str] | None


class Repin(TypedDict):
    """`foresee repin --json`."""

    ok: bool
    written: list[str]
    children: list[RepinChild]


class DriverRow(TypedDict):
    """The runs of one driver, and of one family or of all; shares of the cases."""

    driver: str
    family: str
    cases: int
    verdicts: dict[Verdict, int]
    arrived: float
    failed: float
    mean_mps: float
    hard_brakings_per_km: float
    step_ms: float


class DriverRun(TypedDict):
    """One test case with one driver."""

    case: str
    family: str
    driver: str
    version: str
    verdict: Verdict
    reason: str
    duration_s: float
    way_m: float
    hard_brakings: int
    step_ms: float
    digest: str
    output: str
    traceback: str
    hang: Hang | None


class Assess(TypedDict):
    """`foresee assess --json`."""

    seed: int
    drivers: list[DriverRow]
    families: list[DriverRow]
    runs: list[DriverRun]
    broken: list[str]


class Moment(TypedDict):
    """A moment of a story."""

    time_s: float
    actor: str
    kind: str
    text: str


Story = TypedDict(
    "Story",
    {
        "sentence": str, "class": ContactClass, "opponent": str | None, "opponent_kind": str | None,
        "ego_manoeuvre": str, "opponent_manoeuvre": str, "place": str, "moments": list[Moment],
    },
)  # fmt: skip
"""What happened in a run that failed."""


class _Details(TypedDict):
    impact: Impact | None
    near_misses: NearMisses | None
    preventability: Preventability | None
    story: Story | None


class Notes(TypedDict):
    """What a driver printed and raised in a run, and what it was ended in; `hang` is null where it was not."""

    output: str
    traceback: str
    hang: Hang | None


class CampaignCase(_Details):
    """A test case of a campaign, run unmutated."""

    test_case: str
    family: str
    verdict: Verdict
    reason: str
    duration_s: float
    risky_points: int
    trace: str
    notes: Notes | None


CampaignChild = TypedDict(
    "CampaignChild",
    {
        "mutant": str, "operators": list[str], "changes": list[str], "verdict": Verdict, "with": str, "reason": str,
        "digest": str, "file": str | None, "impact": Impact | None, "near_misses": NearMisses | None,
        "preventability": Preventability | None, "story": Story | None,
    },
)  # fmt: skip
"""A mutant of a campaign; `file` is null where it did not fail."""


class CampaignClip(TypedDict):
    """A clip of a campaign, run unmutated, and its mutants."""

    clip: str
    test_case: str
    verdict: Verdict
    children: list[CampaignChild]


class FindingBoundary(TypedDict):
    """Where a number begins to fail; `also_fails`: in another way. `tried`: what was run, from `was` outwards."""

    change: str
    unit: str
    step: float
    was: float
    first: float
    fails: float
    also_fails: float
    passes: float
    sharp: bool
    sentence: str
    tried: list[Tried]


class Minimised(TypedDict):
    """What minimising a mutant gave. `changed`: its change lines. `complete`: whether its budget was enough."""

    changed: list[str]
    reason: str
    sentence: str | None
    preventability: Preventable | None
    dropped: Dropped
    changes: dict[Literal["before", "now"], int]
    actors: dict[Literal["before", "now"], int]
    clip_lines: dict[Literal["before", "now"], int]
    boundary: list[FindingBoundary]
    runs: int
    complete: bool
    note: str


class MinimisedFinding(Minimised):
    """The representative of a finding, minimised; paths are relative to the campaign's folder."""

    file: str
    clip: str


Finding = TypedDict(
    "Finding",
    {
        "name": str, "sentence": str, "class": ContactClass, "verdict": Verdict, "test_case": str, "family": str,
        "file": str, "clip": str | None, "count": int, "siblings": list[str], "sibling_files": list[str],
        "preventability": Preventable | None, "why": str | None, "minimised": MinimisedFinding | None,
    },
)  # fmt: skip
"""Failures that tell the same story, by the simplest of them; a test case that fails unmutated is not minimised."""


class MinimisedMutant(Minimised):
    """`foresee minimise --json`; `runs_now`: 0 where the result was known."""

    mutant: str
    full: Literal[False]
    files: list[str]
    runs_now: int


class UnreducedMutant(TypedDict):
    """`foresee minimise --full --json`."""

    mutant: str
    full: Literal[True]
    files: list[str]


class ReviewedMutation(TypedDict):
    """Another mutation of a finding's clip; `margins`: its near misses."""

    name: str
    changes: list[str]
    verdict: Verdict
    reason: str
    margins: NearMisses | None


class Review(TypedDict):
    """`foresee review --json`; `asked`: the name that was asked for. `withstood`: names of mutations that passed."""

    finding: Finding
    asked: str
    others: list[ReviewedMutation]
    withstood: list[str]
    files: dict[Literal["as_found", "to_look_at"], str]
    commands: list[str]


class Seeds(TypedDict):
    """How many test cases passed."""

    total: int
    passed: int
    failed: int


class Campaign(TypedDict):
    """`campaign.json`, and `foresee campaign --json`; paths of files are relative to the campaign's folder."""

    driver: str
    ranker: str
    preset: str
    settings: CampaignSettings
    seeds: Seeds
    risky_points: int
    clips: int
    children: int
    failures: dict[Verdict, int]
    preventability: dict[Preventable, int]
    simulated_s: float
    wall_s: float
    interrupted: bool
    broken: list[str]
    test_cases: list[CampaignCase]
    clip_runs: list[CampaignClip]
    findings: list[Finding]
    open_first: list[str]


class CampaignOfSeveral(Campaign):
    """One of several campaigns, and its folder."""

    folder: str


class Campaigns(TypedDict):
    """`foresee campaign --json` with several drivers or rankers."""

    campaigns: list[CampaignOfSeveral]


class PlanStage(TypedDict):
    """A kind of step of a campaign."""

    stage: str
    done: int
    to_run: int
    at_most_more: int
    each_s: float
    measured: bool


class Plan(TypedDict):
    """`foresee plan --format json`; `graph` has nodes and links."""

    stages: list[PlanStage]
    runs: dict[str, int]
    jobs: int
    at_most_s: float
    measured: bool
    graph: dict[str, Any]


class PlanOfSeveral(Plan):
    """One of several plans."""

    driver: str
    ranker: str


class Plans(TypedDict):
    """`foresee plan --format json` with several drivers or rankers."""

    plans: list[PlanOfSeveral]


Verified = TypedDict(
    "Verified",
    {
        "file": str, "status": Status, "driver": str, "expected": str, "verdict": Verdict | None, "with": str | None,
        "now": str, "line": int | None, "note": str,
    },
)  # fmt: skip
"""One test case, compared with what is expected."""


class Verify(TypedDict):
    """`foresee verify --json`."""

    ok: bool
    counts: dict[Status, int]
    written: list[str]
    tests: list[Verified]


class KeptTest(TypedDict):
    """One test of a suite; `new`: it was not there before."""

    file: str
    new: bool
    minimised: bool
    sentence: str


class Keep(TypedDict):
    """`foresee keep --json`."""

    tests: list[KeptTest]
    copied: list[str]
    notes: list[str]
    removed: list[str]


class Ended(TypedDict):
    """How a test case ended on one side of a comparison."""

    verdict: Verdict
    reason: str


class Nearer(TypedDict):
    """A near miss that came nearer; `was` is null where it had no value."""

    measure: Literal["distance_m", "ttc_s", "pet_s", "drac_mps2"]
    was: float | None
    now: float
    actor: str
    share: float


class ComparedCase(TypedDict):
    """One test case on both sides."""

    test_case: str
    family: str
    base: Ended
    new: Ended
    nearer: Nearer | None


class ComparedRow(TypedDict):
    """Figures of all test cases, a family, or a kind of failure; `p`: of McNemar's exact test."""

    label: str
    kind: bool
    pairs: int
    base_failed: int
    new_failed: int
    new_failures: int
    fixed: int
    p: float


class Compare(TypedDict):
    """`foresee compare --json`."""

    base: str
    new: str
    ok: bool
    sentence: str
    pairs: int
    only_base: list[str]
    only_new: list[str]
    edited: list[str]
    broken: list[str]
    new_failures: list[ComparedCase]
    fixed: list[ComparedCase]
    still_failing: list[ComparedCase]
    nearer: list[ComparedCase]
    rows: list[ComparedRow]


class StoreMerge(TypedDict):
    """`foresee store merge --json`."""

    new: int
    known: int


class StoreSweep(TypedDict):
    """`foresee store gc --json`."""

    rows: int
    files: int
    size: int


class StoreExport(TypedDict):
    """`foresee store export --json`."""

    rows: int
    file: str


class Driver(TypedDict):
    """An installed driver; `version` is empty where it is broken."""

    name: str
    version: str
    about: str
    package: str


class Drivers(TypedDict):
    """`foresee drivers --json`."""

    drivers: list[Driver]


class Model(TypedDict):
    """A model of a vehicle, a pedestrian or an obstacle."""

    name: str
    length_m: float
    width_m: float
    height_m: float
    max_speed_mps: float
    acceleration_mps2: float
    braking_mps2: float
    rear_overhang_m: float


class Models(TypedDict):
    """`foresee models --json`."""

    models: list[Model]


class Examined(TypedDict):
    """One thing that `foresee doctor` looked at; `mend` says what to do."""

    what: str
    ok: bool
    detail: str
    mend: str


class Doctor(TypedDict):
    """`foresee doctor --json`."""

    ok: bool
    findings: list[Examined]


class Exchanged(TypedDict):
    """`foresee import FORMAT --json` and `foresee export FORMAT --json`."""

    files: list[str]
    cases: int
    taken: dict[str, int]
    left_out: dict[str, int]
    notes: NotRequired[list[str]]


class ReportedRun(TypedDict):
    """A failing run of a finding; `unreduced`: the changes before they were minimised."""

    name: str
    file: str
    verdict: str
    reason: str
    sentence: str
    moments: list[Moment]
    changes: list[str]
    unreduced: list[str]
    why: str | None
    commands: list[str]
    missing: list[str]


ReportedFinding = TypedDict(
    "ReportedFinding",
    {
        "name": str, "sentence": str, "class": str, "verdict": str, "family": str, "driver": str,
        "preventability": str, "test_case": str, "runs": list[ReportedRun], "more": list[str],
    },
)  # fmt: skip
"""Failures that tell one story; `more` are the names of runs that are not shown."""


class Report(TypedDict):
    """`foresee report --format json`."""

    headline: str
    notes: list[str]
    findings: list[ReportedFinding]


DOCUMENTS: MappingProxyType[str, tuple[int, Any]] = MappingProxyType({
    "assess": (1, Assess),
    "campaign": (1, Campaign),
    "campaigns": (1, Campaigns),
    "check": (1, Check),
    "clip": (1, Clip),
    "compare": (1, Compare),
    "compile": (1, Compile),
    "diff": (1, Diff),
    "doctor": (1, Doctor),
    "drivers": (1, Drivers),
    "error": (1, Error),
    "explain": (1, Explain),
    "export": (1, Exchanged),
    "forecast": (1, Forecast),
    "import": (1, Exchanged),
    "keep": (1, Keep),
    "minimise": (1, MinimisedMutant | UnreducedMutant),
    "models": (1, Models),
    "mutate": (1, Mutate),
    "plan": (1, Plan),
    "plans": (1, Plans),
    "repin": (1, Repin),
    "report": (1, Report),
    "review": (1, Review),
    "run": (1, Run),
    "runs": (1, Runs),
    "sample": (1, Sample),
    "store": (1, Statistics | StoreMerge | StoreSweep | StoreExport),
    "verify": (2, Verify),
})  # fmt: skip
"""Every document by its name: the number of its schema, and its shape."""


def schemas() -> dict[str, str]:
    """Return the text of each file in `docs/schemas`, by its name."""
    return {f"{name}-{number}.json": _schema(name, number, shape) for name, (number, shape) in DOCUMENTS.items()}


def _schema(name: str, number: int, shape: Any) -> str:  # noqa: ANN401 - whatever pydantic takes
    # As written: computed defaults and aliases are those of the reader's side.
    body = TypeAdapter(shape).json_schema(mode="serialization")
    head = {"schema": {"const": number}, "document": {"const": name}}
    parts = {"$defs": body.pop("$defs")} if "$defs" in body else {}
    whole = {
        "$schema": _DIALECT,
        "title": f"foresee {name}, schema {number}",
        "type": "object",
        "properties": head,
        "required": list(head),
        "allOf": [body],
        **parts,
    }
    return json.dumps(whole, indent=2) + "\n"
