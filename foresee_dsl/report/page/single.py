"""The page of a single file: a test case, clip or mutant, which is run for the page, or a recorded trace."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.campaign.driving import DriverSetup, case_name, recorded_setup, run_test_case
from foresee_dsl.campaign.findings.named_failure import NamedFailure
from foresee_dsl.campaign.records import JudgedRun, WrittenFinding
from foresee_dsl.drivers.consent import may_start, without_parent
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.files import write_whole
from foresee_dsl.language.diff.addresses import parent_address
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.page.contents import Contents
from foresee_dsl.report.page.entries import FindingEntry
from foresee_dsl.report.page.html import rendered
from foresee_dsl.report.page.playback import Parent
from foresee_dsl.report.page.runs import FailingRun, Reader
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

_RECORDED = "as its file records"
_NO_FILE_NAME = re.compile(r"[^\w.-]+")


def write_view(
    address: str,
    file: Path | None = None,
    *,
    driver: str = "",
    seed: int | None = None,
    failure: NamedFailure | None = None,
    allow_outside: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> Path:
    """Write the page of a file, and return the page's path: `file`, or `out/view/NAME.html`.

    Args:
        address: a test case, clip or mutant, or a trace's file.
        driver: driver of the run; "" for the recorded driver, or `pdm`. seed: None for the recorded seed, or 0.
        failure: the failure of a campaign whose run it is; the campaign's settings stand for what its file does not
            record.
        say: function that is called with a note if a trace's parent is not shown because its driver is a program.

    Raises:
        InputError: the file, or what it builds on, has errors.
        ForeseeError: the file is not a trace, its recorded driver is a program, or the run cannot be set up.
    """
    if address.endswith(".npz"):
        trace = _trace(Path(address))
        case = load_test_case(str(trace.meta["test_case"]), check_pin=False)
        driver = str(trace.meta.get("driver", "pdm"))
        seed = int(trace.meta.get("seed", 0))
    else:
        case = load_test_case(address, allow_outside=allow_outside)
        recorded = failure.setup(case) if failure is not None else recorded_setup(case)
        driver = driver or _consented(case, recorded)
        seed = recorded.seed if seed is None else seed
        trace = run_test_case(case, driver, seed).trace
    origin = case.mutant.origin if case.mutant is not None else None
    careful = next((answer for answer in Preventable if origin and answer.origin == origin.preventable), None)
    ahead = next((answer for answer in Answer if origin and answer.origin == origin.anticipating), None)
    answers = (
        *((Preventability(careful, _RECORDED),) if careful else ()),
        *((Anticipation(ahead, _RECORDED),) if ahead else ()),
    )
    verdict = next((verdict for verdict in Verdict if verdict.value == trace.meta.get("verdict")), Verdict.INVALID)
    outcome = FailingRun(
        name=case_name(case),
        address=case.id,
        record=JudgedRun(verdict=verdict, reason=str(trace.meta.get("reason", "")), judgements=answers),
        driver=driver,
        seed=seed,
        trace=None,
        why_made=(origin.why or "") if origin is not None else "",
    )
    reader = Reader(reasons=not address.endswith(".npz"))  # viewing a trace starts no driver
    parent = None
    if case.clip is not None and not may_start(driver):
        say(without_parent(driver))
    else:
        parent = _parent(case, driver, seed)
    run = reader.run(outcome, case, trace, parent)
    record = WrittenFinding(
        name=outcome.name, sentence=run.title, class_=run.class_, verdict=verdict, test_case=case.id,
        family=case.family, file=address, count=1, siblings=(), sibling_files=(), preventability=careful, why=None,
        anticipation=ahead,
    )  # fmt: skip
    entry = FindingEntry(record, key=outcome.name, title=run.title, label=run.label, driver=driver, runs=(run,))
    headline = f"{outcome.name}: {outcome.record.reason}"
    contents = Contents(outcome.name, headline, f"driver {driver} · seed {seed}", (entry,), ())
    target = file or Path("out") / "view" / f"{_NO_FILE_NAME.sub('_', outcome.name)}.html"
    write_whole(target, rendered(contents, reader))
    return target


def _trace(file: Path) -> Trace:
    try:
        return Trace.load(file)
    except ValueError as err:
        raise ForeseeError(str(err)) from err


def _consented(case: TestCase, recorded: DriverSetup) -> str:
    """Return the recorded driver of a test case.

    Raises:
        DriverError: it is a program, which is not started only to view the file.
    """
    if ":" in recorded.driver:
        raise DriverError(
            f"{case.id} was recorded with a program as its driver ({recorded.driver}): `--driver '{recorded.driver}'` "
            "starts it"
        )
    return recorded.driver


def _parent(case: TestCase, driver: str, seed: int) -> Parent | None:
    """Run the parent of a clip or mutant (a test case or a clip) and return it; None if it has no parent."""
    if case.clip is None:
        return None
    parent = load_test_case(parent_address(str(case.source)), check_pin=False)
    start_s = 0.0 if case.mutant is not None else case.clip.start_s
    return Parent(run_test_case(parent, driver, seed).trace, start_s)
