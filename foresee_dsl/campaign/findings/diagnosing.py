"""The command `foresee diagnose`: it drives a failure again with ideal parts of its driver.

It keeps the result in the folder of the failure's campaign, where the page and the review read it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from foresee_dsl.avoidance.causes import Diagnosis, diagnosed
from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.findings.named_failure import NamedFailure, find_failure
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.campaign.written import JSON, read_campaign_file
from foresee_dsl.compile import compile_test_case
from foresee_dsl.documents import plain
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.drivers.parts import DriverPart, ideal_parts, parts_of, with_ideal
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside, write_whole
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.addresses import is_file, kind_of
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult

FILE = "diagnoses.json"
"""Name of the file in a campaign's folder with the diagnoses of its findings, by name."""


@dataclass(frozen=True)
class Failing:
    """A failing test case or mutant with its driver.

    Attributes:
        name: name of the finding or the test case. campaign: folder in which the diagnosis is kept; None if it is not
            kept. number: number of the failure's finding; 0 if there is no finding.
    """

    name: str
    case: TestCase
    setup: DriverSetup
    campaign: Path | None = None
    number: int = 0


@dataclass(frozen=True)
class DiagnosedFailure:
    """A diagnosis with the failure that it is about. `note`: why there is no diagnosis; "" if there is one."""

    failing: Failing
    diagnosis: Diagnosis | None
    note: str = ""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"name": self.name, "number": self.number, "diagnosis": self.diagnosis, "note": self.note}

    @property
    def name(self) -> str:
        """Return the name of the failure."""
        return self.failing.name

    @property
    def number(self) -> int:
        """Return the number of the finding; 0 if there is no finding."""
        return self.failing.number


def failing_named(
    wanted: str, campaign: Path, *, driver: str = "", seed: int | None = None, run_programs: bool = False
) -> Failing:
    """Return the failure of a finding's number or name, of a derived file, or of `FILE::CASE`.

    Args:
        campaign: folder in which findings are looked up. driver, seed: replace the recorded ones.
        run_programs: start a program that a file records as its driver.

    Raises:
        ForeseeError: there is no such failure. InputError: its file has errors.
    """
    path = Path(wanted)
    if "::" in wanted or (is_file(path) and kind_of(path) != "mutant"):
        return Failing(wanted, load_test_case(wanted), DriverSetup(driver or "pdm", seed or 0))
    return _of_finding(find_failure(wanted, campaign, tests=True), driver, seed, run_programs=run_programs)


def all_failing(campaign: Path, *, driver: str = "", run_programs: bool = False) -> list[Failing]:
    """Return the representatives of all findings of a campaign, in its order.

    Raises:
        ForeseeError: there is no campaign in the folder.
    """
    written = read_campaign_file(campaign / JSON)
    if written is None:
        raise ForeseeError(f"there is no campaign in {campaign}: `foresee campaign PATH --out {campaign}` runs one")
    failures = (find_failure(finding.name, campaign, tests=True, written=written) for finding in written.grouped)
    return [_of_finding(failure, driver, None, run_programs=run_programs) for failure in failures]


def _of_finding(wanted: NamedFailure, driver: str, seed: int | None, *, run_programs: bool) -> Failing:
    file = wanted.minimised or wanted.file
    case = load_test_case(str(file))
    settings = wanted.campaign.settings if wanted.campaign is not None else CampaignSettings()
    setup = wanted.setup(case)
    if case.mutant is None:
        case = replace(case, goal=settings.goal)  # a mutant's file states its goal
    if not driver:
        instead = "--run-programs starts it; --driver chooses another driver"
        refuse_programs([(setup.driver, Path(file))], instead, unless=run_programs)
    finding = wanted.finding
    own = finding is not None and finding.name == wanted.name
    return Failing(
        wanted.name,
        case,
        DriverSetup(driver or setup.driver, setup.seed if seed is None else seed, rules=settings.rules),
        wanted.campaign.folder if wanted.campaign is not None and own and not driver and seed is None else None,
        finding.number if finding is not None and own else 0,
    )


def diagnose(failures: Sequence[Failing], jobs: int = 1) -> Iterator[DiagnosedFailure]:
    """Diagnose failures in processes of their own, in their order, and keep the results beside their campaigns."""
    with WorkerPool(jobs, once=len(failures) == 1) as pool:
        outcomes = pool.outcomes(Task(failing.name, _diagnosed, failing) for failing in failures)
    for failing, outcome in zip(failures, outcomes, strict=True):
        result = outcome
        if isinstance(outcome, BrokenTask):
            result = DiagnosedFailure(failing, None, f"it cannot be driven: {outcome.reason}")
        _keep(result)
        yield result


def _diagnosed(failing: Failing) -> DiagnosedFailure:
    """Diagnose one failure in this process."""
    setup, case = failing.setup, failing.case
    ideal = ideal_parts(setup.driver)

    def drive(parts: frozenset[DriverPart]) -> RunResult:
        return replace(setup, driver=with_ideal(setup.driver, ideal | parts)).run(case)

    failed, driver = replace(setup, driver=with_ideal(setup.driver, ideal)).run_in(lambda driver: driver, case)
    if not failed.verdict.is_failure:
        return DiagnosedFailure(failing, None, f"it does not fail with {setup.driver}: {failed.reason}")
    declared = tuple(part for part in parts_of(driver) if part not in ideal)
    bundle = compile_test_case(case)
    diagnosis = diagnosed(failed, bundle, drive, driver=setup.driver, seed=setup.seed, declared=declared)
    return DiagnosedFailure(failing, diagnosis)


def _keep(result: DiagnosedFailure) -> None:
    """Write a diagnosis into the file beside its campaign."""
    folder = result.failing.campaign
    if folder is None or result.diagnosis is None:
        return
    kept = kept_diagnoses(folder)
    kept[result.name] = plain(result.diagnosis)
    text = json.dumps(dict(sorted(kept.items())), indent=1)
    write_whole(folder / FILE, text + "\n")


def kept_diagnoses(campaign: Path) -> dict[str, dict[str, Any]]:
    """Return the kept diagnoses of a campaign's findings by name; {} if there are none.

    Raises:
        ForeseeError: the file cannot be read.
    """
    file = campaign / FILE
    try:
        data: dict[str, dict[str, Any]] = json.loads(read_outside(file, "results"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as err:
        raise ForeseeError(f"{file} cannot be read: {err}; remove it, and `foresee diagnose` writes it again") from err
    good = isinstance(data, dict) and all(isinstance(d, dict) and isinstance(d.get("text"), str) for d in data.values())
    if not good:
        raise ForeseeError(f"{file} was not written by `foresee diagnose`: remove it, and run the command again")
    return data


def diagnosis_of(campaign: Path, name: str, reason: str) -> str:
    """Return the kept diagnosis of a finding in words; "" if there is none of this run.

    Args:
        reason: how the finding's run ended. A diagnosis of a run that ended differently is out of date.
    """
    kept = kept_diagnoses(campaign).get(name)
    return str(kept["text"]) if kept is not None and kept.get("reason") == reason else ""
