"""The single steps of the method, each from files or values to values: what the commands and the workers both call."""

from __future__ import annotations

import os
from pathlib import Path

from foresee_dsl import __version__
from foresee_dsl.campaign.results import ChildOutcome
from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip as make_clip
from foresee_dsl.derive.clipping.fidelity import Deviation, deviation, with_fidelity
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.derive.preventability import Preventability, assess
from foresee_dsl.drivers.registry import load_driver, recorded_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.model import Clip, Mutant, Origin
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import Trace


def run_test_case(case: TestCase, driver: str, seed: int) -> RunResult:
    """Compile a test case and drive through it with a fresh driver."""
    bundle = compile_test_case(case)
    loaded = load_driver(driver)
    meta = {"test_case": case.id, "meaning": case.meaning, "tool": __version__, "seed": seed, "driver": driver}
    return run(bundle, loaded, seed=seed, meta=meta)


def case_name(case: TestCase) -> str:
    """Return the name that a test case's files begin with: `red_light_runner_r02`."""
    if case.mutant is not None:
        return case.mutant.name
    if case.clip is not None:
        return case.clip.name
    name = case.id.partition("::")[2]
    return f"{case.scenario.name}_{name}" if name else case.scenario.name


def clip_around(
    case: TestCase,
    trace: Trace,
    point: RiskyPoint,
    file: Path,
    *,
    before_s: float,
    after_s: float,
    handover_s: float = 0.0,
) -> Clip:
    """Cut the seconds around a risky point out of a run; `file` is where the clip will be written.

    Raises:
        ValueError: the hand-over is too long (see `derive.clip.clip`).
    """
    return make_clip(
        case,
        trace,
        point,
        before_s=before_s,
        after_s=after_s,
        name=file.stem,
        parent=relative_path(case.source, file.parent),
        handover_s=handover_s,
    )


def measure_clip(
    model: Clip, parent: TestCase, parent_trace: Trace, file: Path, *, driver: str, seed: int
) -> tuple[Clip, TestCase, RunResult, Deviation]:
    """Run a clip unmutated and write into it how far it strays from its parent.

    Returns:
        The clip with its `fidelity` line, its test case, the run, and the deviation.
    """
    clip_case = expand_clip(model, parent, source=file)
    result = run_test_case(clip_case, driver, seed)
    found = deviation(parent_trace, parent_trace.frame_at(model.start_s), result.trace)
    return with_fidelity(model, found), clip_case, result, found


def driver_of(clip_trace: Trace, driver: str) -> str:
    """Return how a mutant's file says what drove: the clip's own unmutated run tells the version."""
    return recorded_driver(driver, str(clip_trace.meta.get("driver_version", "")))


def run_child(
    mutant: Mutant, clip_case: TestCase, file: Path, shown_as: str, *, driver: str, seed: int
) -> tuple[ChildOutcome, RunResult]:
    """Run a mutant; write into it what was found and, of a failure, whether a careful driver would have avoided it."""
    case = expand_mutant(mutant, clip_case, source=file)
    result = run_test_case(case, driver, seed)
    avoided = assess(case, result) if result.verdict.is_failure else None
    mutant = with_found(mutant, result.reason, avoided)
    outcome = ChildOutcome(
        name=mutant.name,
        file=shown_as,
        text=print_model(mutant),
        operators=mutant.origin.operator if mutant.origin else (),
        verdict=result.verdict,
        with_=result.with_,
        reason=result.reason,
        time_s=result.time_s,
        duration_s=result.duration_s,
        digest=result.trace.digest,
        preventability=avoided,
        impact=result.impact,
        near=result.near_misses,
    )
    return outcome, result


def mutate_file(
    file: Path, *, preset: str, count: int, driver: str, seed: int, allow_outside: bool = True
) -> tuple[ChildOutcome, ...]:
    """Mutate a clip's file and run the children, whose files belong beside it.

    Raises:
        ForeseeError: the file is no clip.
    """
    clip_case = load_test_case(str(file), allow_outside=allow_outside)
    model = clip_case.clip
    if model is None or clip_case.mutant is not None:
        raise ForeseeError(f"{file} is no clip: `foresee clip` writes them")
    result = run_test_case(clip_case, driver, seed)
    drove = driver_of(result.trace, driver)
    mutants = mutate(clip_case, model, result.trace, preset=preset, count=count, seed=seed, driver=drove)
    outcomes = []
    for mutant in mutants:
        child = file.parent / f"{mutant.name}.foresee"
        outcomes.append(run_child(mutant, clip_case, child, str(child), driver=driver, seed=seed)[0])
    return tuple(outcomes)


def with_found(mutant: Mutant, found: str, avoided: Preventability | None = None) -> Mutant:
    """Return the mutant with what its run found in its origin block, and whether that was preventable."""
    told = {"found": found, "preventable": avoided.verdict.origin if avoided else None}
    body = tuple(item.model_copy(update=told) if isinstance(item, Origin) else item for item in mutant.body)
    return mutant.model_copy(update={"body": body})


def relative_path(target: Path, folder: Path) -> str:
    """Return how a file in `folder` names `target`: relative, with forward slashes."""
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()
