"""Implements `foresee mutate`: mutates a clip's file and runs the mutants."""

from __future__ import annotations

import os
from pathlib import Path

from foresee_dsl.campaign.driving import DriverSetup, relative_path
from foresee_dsl.campaign.folder import PARTS
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.steps.child import run_child
from foresee_dsl.campaign.steps.mutants import driver_of
from foresee_dsl.campaign.written import JSON
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_case


def mutate_file(
    file: Path, *, preset: str, count: int, driver: str, seed: int, out: Path | None = None, allow_outside: bool = True
) -> tuple[ChildOutcome, ...]:
    """Mutate a clip's file and run the mutants, whose files belong into the folder `out`, by default beside the clip.

    Raises:
        ForeseeError: the file is not a clip, or the folder has the mutants of a campaign, which would be replaced.
    """
    folder = out or file.parent
    if (campaign := _campaign_of(folder)) is not None:
        raise ForeseeError(
            f"the new mutants would replace those of the campaign in {campaign}: "
            "name another folder for them with `--out`"
        )
    clip_case = load_test_case(str(file), allow_outside=allow_outside)
    model = clip_case.clip
    if model is None or clip_case.mutant is not None:
        raise ForeseeError(f"{file} is not a clip: write one with `foresee clip`")
    setup = DriverSetup(driver, seed)
    result = setup.run(clip_case)
    drove = driver_of(result.trace, driver)
    mutants = mutate(clip_case, model, result.trace, preset=preset, count=count, seed=seed, driver=drove)
    placed = (mutant.model_copy(update={"parent": relative_path(file, folder)}) for mutant in mutants)
    return tuple(run_child(mutant, clip_case, folder / f"{mutant.name}.foresee", setup)[0] for mutant in placed)


def _campaign_of(folder: Path) -> Path | None:
    """Return the folder of the campaign to whose results a folder belongs; None if it belongs to none."""
    for part in (folder.absolute(), *folder.absolute().parents):
        if part.name in PARTS and (part.parent / JSON).is_file():
            return Path(os.path.relpath(part.parent))
    return None
