"""Implements `foresee mutate`: mutates a clip's file and runs the mutants."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.steps.child import run_child
from foresee_dsl.campaign.steps.mutants import driver_of
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_case


def mutate_file(
    file: Path, *, preset: str, count: int, driver: str, seed: int, allow_outside: bool = True
) -> tuple[ChildOutcome, ...]:
    """Mutate a clip's file and run the mutants, whose files belong beside it.

    Raises:
        ForeseeError: the file is not a clip.
    """
    clip_case = load_test_case(str(file), allow_outside=allow_outside)
    model = clip_case.clip
    if model is None or clip_case.mutant is not None:
        raise ForeseeError(f"{file} is not a clip: write one with `foresee clip`")
    setup = DriverSetup(driver, seed)
    result = setup.run(clip_case)
    drove = driver_of(result.trace, driver)
    mutants = mutate(clip_case, model, result.trace, preset=preset, count=count, seed=seed, driver=drove)
    return tuple(run_child(mutant, clip_case, file.parent / f"{mutant.name}.foresee", setup)[0] for mutant in mutants)
