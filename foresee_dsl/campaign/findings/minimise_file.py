"""Implements `foresee minimise` for a mutant's file; stored results are reused."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from foresee_dsl.campaign.assembly import with_header
from foresee_dsl.campaign.driving import DriverSetup, recorded_setup, relative_path
from foresee_dsl.campaign.findings.named_failure import NamedFailure
from foresee_dsl.campaign.goal import only_expectation
from foresee_dsl.campaign.keys import judged_identity, key
from foresee_dsl.campaign.records import Minimised, decode, encode
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.child import ChildStep, run_length
from foresee_dsl.campaign.steps.inputs import risk_hash
from foresee_dsl.campaign.steps.minimise import MinimiseStep, minimised
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.derive.minimise.candidate import Subject
from foresee_dsl.derive.minimise.minimise import CannotMinimiseError
from foresee_dsl.derive.presets import preset
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.files import absolute, cache_folder, read_outside_text, write_whole
from foresee_dsl.language.campaign_values import RULES_MODE
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip, Mutant
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.addresses import relative_to
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict


def minimise_file(
    wanted: NamedFailure, store_folder: Path | None = None, *, driver: str = "", budget: int,
    run_programs: bool = False, allow_outside: bool = True,
) -> tuple[Minimised, TestCase, int]:  # fmt: skip
    """Minimise a mutant's file, with the driver and seed that it records.

    Args:
        store_folder: where results are stored; by default its campaign's store, otherwise one in the user's cache.
        driver: replaces the recorded one. run_programs: start a program that the file records as its driver.

    Returns:
        The result, the test case that the clip was cut from, and the number of runs now: 0 if the result was stored.

    Raises:
        DriverError: the file records a program, which is not allowed; or the driver ended its process.
        InputError: the file has errors or is stale. CannotMinimiseError: the mutant does not fail.
        StoreError: the store cannot be written.
    """
    case, clip, mutant = _loaded(wanted.file, allow_outside=allow_outside)
    setup = recorded_setup(case)
    if driver:
        setup = replace(setup, driver=driver)
    else:
        refuse_programs(
            [(setup.driver, Path(wanted.file))],
            "--run-programs starts it; --driver chooses another driver",
            unless=run_programs,
        )
    folder = store_folder or wanted.store
    settings = wanted.campaign.settings if wanted.campaign is not None else CampaignSettings(seed=setup.seed)
    limit_m, run_seed = settings.fidelity_limit_m, settings.seed
    identity = judged_identity(setup.driver, RULES_MODE)
    # The keys are those of the steps of a campaign, whose results are found by them.
    length = run_length(preset(settings.preset).ends_early)
    child = key(ChildStep, clip=mutant.pin, meaning=case.meaning, driver=identity, seed=setup.seed, **length)
    its = key(MinimiseStep, child=child, risk=risk_hash(clip), run_seed=run_seed, limit_m=limit_m, budget=budget)
    parent = _parent_of(wanted.file, clip, mutant, allow_outside=allow_outside)
    folder = folder or cache_folder("minimised")
    if (stored := _stored_result(folder, its)) is not None:
        # The stored result may have the names of another campaign.
        return _checked(replace(stored, clip=clip.name, child=replace(stored.child, name=mutant.name))), parent, 0
    work = _Work(parent, clip, mutant, absolute(wanted.file).parent, setup, run_seed, limit_m, budget)
    with Store(folder) as store:
        result, packed = _apart(work)
        if result.runs:
            row = StoredResult(
                key=its, kind=MinimiseStep.kind, name=mutant.name, record=encode(result), driver=setup.driver,
                verdict=result.child.verdict.value, reason=result.child.reason,
            )  # fmt: skip
            store.drop(its)
            store.add(row, packed)
        return _checked(result), parent, result.runs


@dataclass(frozen=True)
class _Work:
    """The input of the process that minimises a mutant; `folder` is the folder of the mutant's file."""

    parent: TestCase
    clip: Clip
    mutant: Mutant
    folder: Path
    setup: DriverSetup
    run_seed: int
    limit_m: float
    budget: int


def _apart(work: _Work) -> tuple[Minimised, bytes | None]:
    """Minimise in a separate process, so that a driver's effects do not reach this one.

    Returns:
        The result, and the packed trace of its last run, if any.

    Raises:
        DriverError: the process died or was ended.
    """
    with WorkerPool(1, deaths=1, once=True) as pool:
        (outcome,) = pool.outcomes([Task(work.mutant.name, _minimise, work)])
    if isinstance(outcome, BrokenTask):
        printed = f"; its output was: {outcome.output.strip()}" if outcome.output.strip() else ""
        raise DriverError(f"{work.mutant.name} cannot be minimised with {work.setup.driver}: {outcome.reason}{printed}")
    result: tuple[Minimised, bytes | None] = outcome
    return result


def _minimise(work: _Work) -> tuple[Minimised, bytes | None]:
    trace = replace(work.setup, seed=work.run_seed).run(work.parent).trace
    subject = Subject(work.parent, work.clip, work.mutant, trace, work.folder)
    result, last = minimised(subject, work.setup, limit_m=work.limit_m, budget=work.budget)
    return result, last.packed() if last is not None else None


@dataclass(frozen=True)
class Texts:
    """A mutant and its clip as texts with names, and the test case that the clip was cut from."""

    mutant: str
    mutant_text: str
    clip: str
    clip_text: str
    parent: TestCase

    @classmethod
    def of(cls, result: Minimised, parent: TestCase) -> Self:
        """Return the mutant and clip of a minimisation as texts."""
        return cls(result.child.name, result.child.text, result.clip, result.clip_text, parent)

    @classmethod
    def unreduced(cls, wanted: NamedFailure, *, allow_outside: bool = True) -> Self:
        """Return the texts of the mutant in its original form.

        Raises:
            InputError: the file has errors or is stale.
        """
        case, clip, mutant = _loaded(wanted.file, allow_outside=allow_outside)
        parent = _parent_of(wanted.file, clip, mutant, allow_outside=allow_outside)
        clip_text = read_outside_text(wanted.file.parent / mutant.parent)
        own = case.mutant is not None and mutant.changes == case.mutant.changes
        text = read_outside_text(wanted.file) if own else print_model(mutant)
        return cls(mutant.name, text, clip.name, clip_text, parent)

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write the mutant and the clip into a folder; return their files, the mutant's first."""
        mutant, clip = folder / f"{self.mutant}.foresee", folder / f"{self.clip}.foresee"
        above, case = relative_path(self.parent.source, folder), self.parent.id.partition("::")[2]
        write_whole(clip, with_header(self.clip_text, "clip", self.clip, above, case))
        write_whole(mutant, with_header(self.mutant_text, "mutant", self.mutant, clip.name))
        return mutant, clip


def _checked(result: Minimised) -> Minimised:
    child = result.child
    if child.verdict is Verdict.PASS and child.broken_expectations:
        raise CannotMinimiseError(only_expectation(child.name, child.reason, "minimised"))
    if not child.verdict.is_failure:
        raise CannotMinimiseError(
            f"{child.name} does not fail with this driver: {child.reason}. There is no failure to "
            "keep, so nothing is minimised"
        )
    return result


def _stored_result(folder: Path, its: str) -> Minimised | None:
    """Return a store's result; reading needs no lock, so this works while a campaign runs."""
    if not (folder / "runs.sqlite").is_file():
        return None
    with Store(folder, write=False) as store:
        row = store.get(its)
    record = decode(row.record, Minimised) if row is not None and not row.broken else None
    return record if isinstance(record, Minimised) else None


def _loaded(file: Path, *, allow_outside: bool) -> tuple[TestCase, Clip, Mutant]:
    case = load_test_case(str(file), allow_outside=allow_outside)
    if case.mutant is None or case.clip is None:
        raise ForeseeError(f"{file} does not contain a mutant, so there is nothing to minimise")
    mutant, above = case.mutant, absolute(file.parent / case.mutant.parent)
    while isinstance(
        other := load(above).model, Mutant
    ):  # a mutant of a mutant is treated as one mutant of the clip, with all changes
        mutant = mutant.model_copy(update={"pin": other.pin, "body": (*other.changes, *mutant.body)})
        above = absolute(above.parent / other.parent)
    return case, case.clip, mutant.model_copy(update={"parent": relative_to(absolute(file).parent, above)})


def _parent_of(file: Path, clip: Clip, mutant: Mutant, *, allow_outside: bool) -> TestCase:
    above = absolute(absolute(file.parent / mutant.parent).parent / clip.parent)
    address = f"{above}::{clip.case}" if clip.case else str(above)
    return load_test_case(address, allow_outside=allow_outside)
