"""The failing mutants of earlier campaigns, with this or another driver, which a campaign runs first.

A mutant's file states the pin of its clip, and the clip's file the pin of its test case. So a mutant belongs to a test
case of this campaign if the pins are equal, wherever the files are. Its changes are run in those clips of the test case
that begin at about the same time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.campaign.steps.inputs import clip_of
from foresee_dsl.campaign.steps.requests import RequestedMutant
from foresee_dsl.derive.mutate import SEARCHED, Draw, How
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import absolute
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Change, Clip, Mutant, Quantity
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.addresses import SUFFIX, is_inside

WITHIN_S = 2.0
"""Largest time between the beginnings of two clips in which the same changes are run, s. Ours: as `APART_S` of the
ranker `careful`: clips of 10 s that begin within this time show the same.
"""
AT_MOST = 2
"""Maximum number of earlier mutants of one clip. Ours: half of the default number of children."""


class _Failure(NamedTuple):
    """A failing mutant of an earlier campaign, and the beginning of its clip in the test case's run, s."""

    mutant: Mutant
    start_s: float


class EarlierMutants:
    """The failing mutants in a folder, by the pin of their test case."""

    def __init__(self, failures: Iterable[tuple[Mutant, Clip]]) -> None:
        """Sort the mutants; of those of one name and driver, as a finding and its minimised form, the first counts."""
        by_case: defaultdict[str, dict[tuple[str, str], _Failure]] = defaultdict(dict)
        for mutant, clip in failures:
            driver = (mutant.origin.driver if mutant.origin is not None else None) or ""
            by_case[clip.pin].setdefault((mutant.name, driver), _Failure(mutant, clip.start_s))
        self._by_case = {pin: tuple(failures.values()) for pin, failures in by_case.items()}

    @property
    def count(self) -> int:
        """Return the number of mutants."""
        return sum(len(failures) for failures in self._by_case.values())

    @classmethod
    def in_folder(cls, folder: Path, *, but: Path) -> EarlierMutants:
        """Read a campaign's folder or a folder of kept failures.

        Mutants without a recorded result do not count; those that only broke an expectation do. A minimised mutant
        comes before the one that it was made of.
        `but`: the folder of the campaign that asks, which it will replace.

        Raises:
            ForeseeError: there is no such folder, it has no failing mutant, it is `but`, or a clip lies outside it.
            InputError: a file in it has errors.
        """
        if absolute(folder) == absolute(but):
            raise ForeseeError(
                f"{folder} is the folder of this campaign, which replaces its mutants: name another --out"
            )
        if not folder.is_dir():
            raise ForeseeError(f"there is no folder {folder}: name the folder of a campaign, or of kept failures")
        earlier = cls(_failures(folder))
        if not earlier.count:
            raise ForeseeError(f"{folder} has no failing mutants: name the folder of a campaign, or of kept failures")
        return earlier

    def left_out(self, cases: Iterable[TestCase]) -> int:
        """Return how many of the mutants are of none of these test cases, or of another version of one of them."""
        pins = {case.meaning for case in cases}
        return sum(len(failures) for pin, failures in self._by_case.items() if pin not in pins)

    def requests(self, clip: str) -> tuple[RequestedMutant, ...]:
        """Return the mutants that are run first in a clip with this text, at most `AT_MOST`; the clips that begin
        nearest to this one come first.
        """
        own = clip_of(clip)
        failures = [
            failure for failure in self._by_case.get(own.pin, ()) if abs(failure.start_s - own.start_s) <= WITHIN_S
        ]
        failures.sort(key=lambda failure: (abs(failure.start_s - own.start_s), failure.mutant.name))
        moved = ((failure, _moved(failure, own.start_s)) for failure in failures)
        texts = {print_model(mutant): failure for failure, mutant in moved if mutant is not None}
        return tuple(
            RequestedMutant(k + 1, Draw(SEARCHED, k), How.EARLIER, text, why=_why(failure.mutant))
            for k, (text, failure) in enumerate(list(texts.items())[:AT_MOST])
        )


def _failures(folder: Path) -> Iterator[tuple[Mutant, Clip]]:
    for file in sorted(folder.rglob(f"*{SUFFIX}"), key=lambda file: ("children" in file.parts, file)):
        mutant = load(file).model
        if not isinstance(mutant, Mutant) or mutant.origin is None or not mutant.origin.found:
            continue
        above = absolute(file.parent / mutant.parent)
        if not is_inside(above, (folder,)):  # the folder may come from elsewhere
            raise ForeseeError(f"{file}: its clip '{mutant.parent}' lies outside {folder}, which must hold all clips")
        clip = load(above).model
        if isinstance(clip, Clip):
            yield mutant, clip


def _moved(failure: _Failure, start_s: float) -> Mutant | None:
    """Return a mutant whose changes begin at the same times of the test case's run in a clip that begins at `start_s`;
    None if one would begin before the clip.
    """
    shift_s = failure.start_s - start_s
    changes: list[Change] = []
    for change in failure.mutant.changes:
        if isinstance(change.start, Quantity):
            at_s = change.start.si + shift_s
            if at_s < 0:
                return None
            changes.append(change.model_copy(update={"start": Quantity.of(at_s, "time", 2)}))
        else:
            changes.append(change)
    origin = failure.mutant.origin
    return failure.mutant.model_copy(update={"body": (*changes, *([origin] if origin is not None else ()))})


def _why(mutant: Mutant) -> str:
    origin = mutant.origin
    driver = f" with {origin.driver}" if origin is not None and origin.driver else ""
    return f"{mutant.name} failed in this test case{driver}: {origin.found if origin is not None else ''}"
