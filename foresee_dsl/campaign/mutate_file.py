"""Implements `foresee mutate`: mutates a clip's file and runs the mutants."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from foresee_dsl.campaign.driving import DriverSetup, relative_path
from foresee_dsl.campaign.folder import PARTS
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.steps.child import run_child
from foresee_dsl.campaign.steps.mutants import driver_of
from foresee_dsl.campaign.written import JSON
from foresee_dsl.derive import presets
from foresee_dsl.derive.mutate import UNPROMISING, mutate
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside
from foresee_dsl.language.project.addresses import kind_of, parse_address
from foresee_dsl.language.project.loading import load_test_case


def mutate_file(
    file: Path, *, preset: str, count: int, driver: str, seed: int, out: Path | None = None, allow_outside: bool = True
) -> tuple[ChildOutcome, ...]:
    """Mutate a clip's file and run the mutants, whose files belong into the folder `out`, by default beside the clip.

    Raises:
        ForeseeError: the file is not a clip, or mutants would be replaced: those of a campaign, or a file of the folder
            that has the name of a new one and other content.
    """
    not_a_clip = ForeseeError(f"{file} is not a clip: write one with `foresee clip`")
    if kind_of(parse_address(str(file))[0]) not in ("clip", ""):  # "": loading it reports what is wrong
        raise not_a_clip
    folder = out or file.parent
    if (campaign := _campaign_of(folder)) is not None:
        raise ForeseeError(
            f"the new mutants would replace those of the campaign in {campaign}: "
            "name another folder for them with `--out`"
        )
    clip_case = load_test_case(str(file), allow_outside=allow_outside)
    model = clip_case.clip
    if model is None or clip_case.mutant is not None:
        raise not_a_clip
    setup = DriverSetup(driver, seed)
    result = setup.run(clip_case)
    drove = driver_of(result.trace, driver)
    mutants = mutate(clip_case, model, result.trace, preset=preset, count=count, seed=seed, driver=drove)
    placed = (mutant.model_copy(update={"parent": relative_path(file, folder)}) for mutant in mutants)
    outcomes = tuple(run_child(mutant, clip_case, folder / f"{mutant.name}.foresee", setup)[0] for mutant in placed)
    _refuse_others(outcomes)
    return outcomes


def why_fewer(preset: str) -> str:
    """Return why a preset makes fewer mutants of a clip than were asked for."""
    if presets.preset(preset).search is None:
        return "the operators have no further change for the actors of this clip"
    return (
        f"the preset {preset} makes one for each candidate that its search finds, "
        f"and {UNPROMISING:.0%} of the number asked for if it finds none"
    )


def _refuse_others(outcomes: Sequence[ChildOutcome]) -> None:
    """Raise if a mutant's file is there with other content, such as a mutant of another preset."""
    others = [child.file for child in outcomes if _has_other_text(Path(child.file), child.text)]
    if others:
        raise ForeseeError(
            f"nothing was written: {', '.join(others)} {'is' if len(others) == 1 else 'are'} there already with other "
            "content; give another --out, or delete or rename what is there"
        )


def _has_other_text(file: Path, text: str) -> bool:
    return file.exists() and not (file.is_file() and read_outside(file) == text.encode())


def _campaign_of(folder: Path) -> Path | None:
    """Return the folder of the campaign to whose results a folder belongs; None if it belongs to none."""
    for part in (folder.absolute(), *folder.absolute().parents):
        if part.name in PARTS and (part.parent / JSON).is_file():
            return Path(os.path.relpath(part.parent))
    return None
