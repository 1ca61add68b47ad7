"""The expected results in a file, and the comparison of a run with them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import get_args

from foresee_dsl.drivers.registry import recorded_address, recorded_driver
from foresee_dsl.language import model as m
from foresee_dsl.language.model.expected import FailureName
from foresee_dsl.simulate.results.verdict import RunResult, Verdict

DRIVER = "pdm"
"""Driver of a test case that names none."""
_ACTOR = re.compile(r" with (\w+)")
"""Matches the other actor of a recorded failure: `F2 collision with walker (pedestrian) at 4.75 s, 6.4 m/s`."""


class Status(StrEnum):
    """How a run compares with the expected result, in the order of the report.

    Attributes:
        label: its name in words. style: its style in a terminal. meaning: its meaning in one sentence.
    """

    _value_: str
    style: str
    meaning: str

    def __new__(cls, value: str, style: str, meaning: str) -> Status:
        """Create a member."""
        status = str.__new__(cls, value)
        status._value_, status.style, status.meaning = value, style, meaning
        return status

    CRASHED = "crashed", "bold red", "the driver or the simulator broke, so there is no result for the test case"
    TIMED_OUT = "timed_out", "bold yellow", "it did not arrive in time, or the driver took too long"
    CAME_BACK = "came_back", "bold red", "it is expected to pass, and fails"
    CHANGED = "changed", "yellow", "it fails in another way, or with another actor"
    STALE = ("stale", "magenta", "its parent's edit reaches it or cannot be traced, or its files have mistakes")
    NEW = "new", "cyan", "the file records no result of this driver"
    FIXED = "fixed", "green", "it is expected to fail, and passes"
    AS_EXPECTED = "as_expected", "dim", "it ends as recorded"

    @property
    def label(self) -> str:
        """Return the name in words, such as `came back`."""
        return self.value.replace("_", " ")

    @property
    def can_be_recorded(self) -> bool:
        """Return whether `--update` records this result as the expected one."""
        return self in (Status.CAME_BACK, Status.CHANGED, Status.NEW, Status.FIXED)


@dataclass(frozen=True)
class Ending:
    """How a run ended: verdict, the other actor's id or "", whether the driver exceeded its wall time, and whether a
    passed run broke an `expect` line."""

    verdict: Verdict
    actor: str = ""
    hangs: bool = False
    breaks: bool = False

    @classmethod
    def of(cls, result: RunResult) -> Ending:
        """Return the ending of a run."""
        breaks = result.verdict is Verdict.PASS and not result.passed
        return cls(result.verdict, result.with_, hangs=result.notes.hang is not None, breaks=breaks)

    @property
    def passes(self) -> bool:
        """Return whether the run passed and all expectations hold."""
        return self.verdict is Verdict.PASS and not self.breaks

    def expected_of(self, driver: str, case: str | None = None) -> m.Expected | None:
        """Return the statement that expects this ending; None for one that cannot be expected (crash, invalid)."""
        if self.verdict in (Verdict.PASS, Verdict.GOAL):  # a broken expectation has no kind: see its `expect` line
            return m.Expected(driver=driver, case=case, outcome="passes" if self.passes else "fails")
        if self.verdict.value not in get_args(FailureName):
            return None
        is_name = re.fullmatch(
            m.NAME_PATTERN, self.actor
        )  # ids of background traffic on a foreign network may not be names of the language
        return m.Expected.model_validate(
            {
                "driver": driver,
                "case": case,
                "outcome": "fails",
                "failure": self.verdict.value,
                "actor": self.actor if is_name else None,
            }
        )


def in_words(expected: m.Expected | None) -> str:
    """Return an expected result in words: `fails F2 with walker`, `passes`; "nothing" for None."""
    if expected is None:
        return "nothing"
    with_ = f" with {expected.actor}" if expected.actor else ""
    return f"{expected.outcome} {expected.failure or ''}".rstrip() + with_


def judge(expected: m.Expected | None, ending: Ending) -> Status:
    """Return how a run compares with the expected result."""
    verdict = ending.verdict
    if verdict is Verdict.CRASH:
        return Status.CRASHED
    if expected is not None and not ending.hangs and _is_met(expected, ending):  # another machine may not have the hang
        return Status.AS_EXPECTED
    if verdict is Verdict.TIMEOUT:
        return Status.TIMED_OUT
    if expected is None:
        return Status.NEW
    if expected.outcome == "passes":
        return Status.CAME_BACK
    return Status.FIXED if ending.passes else Status.CHANGED


def _is_met(expected: m.Expected, ending: Ending) -> bool:
    if expected.outcome == "passes":
        return ending.passes
    if expected.failure is None:
        return ending.verdict.is_failure or ending.breaks
    return expected.failure == ending.verdict.value and expected.actor in (None, ending.actor)


def names_of(address: str, version: str) -> tuple[str, ...]:
    """Return the possible names of a driver in `expected` lines, the most specific first: `pdm 2`, `pdm`."""
    recorded = recorded_driver(address, version)
    own = recorded.partition(" via ")[0]
    return tuple(dict.fromkeys((recorded, own, address, own.rpartition(" ")[0] or own)))


def name_to_record(address: str, version: str) -> str:
    """Return the name of a driver in a new `expected` line: its own name without a version. So the line applies to
    every version, and a later version is compared with the present one.
    """
    own = recorded_driver(address, version).partition(" via ")[0]
    name = own.rpartition(" ")[0] or own
    return name if ":" not in address or (name and own != "unknown") else recorded_text(address)


def recorded_text(address: str) -> str:
    """Return an address in the form of a text of the language, without double quotes."""
    return recorded_driver(address, "").partition(" via ")[2] or address


def expected_in(
    items: Sequence[m.Item], case: str | None, names: Sequence[str], origin: m.Origin | None = None
) -> m.Expected | None:
    """Return the statement for a driver and a case. One with the most specific name comes first; among equal names, one
    for this case comes before one for all cases.

    Without a statement, a mutant's `origin` gives it for the driver that found the failure.
    """
    stated = [item for item in items if isinstance(item, m.Expected) and item.case in (None, case)]
    for name in names:
        about = sorted((item for item in stated if item.driver == name), key=lambda item: item.case is None)
        if about:
            return about[0]
    recorded = recorded_in(origin)
    return recorded if recorded is not None and recorded.driver in names else None


def recorded_in(origin: m.Origin | None) -> m.Expected | None:
    """Return the result that a mutant's `driver` and `found` record; None if they are missing or not a failure."""
    if origin is None or not origin.found:
        return None
    ending = ending_of(origin.found)
    version = (origin.driver or DRIVER).partition(" via ")[0]
    driver = version.rpartition(" ")[0] or version
    named = driver if driver != "unknown" else recorded_address(origin.driver or DRIVER)
    return ending.expected_of(named) if ending is not None else None


def ending_of(reason: str) -> Ending | None:
    """Return the ending that a recorded sentence describes; None if it is not a failure."""
    word = re.split(r"\W", reason, maxsplit=1)[0]
    if word not in (*get_args(FailureName), Verdict.GOAL.value):
        return None
    verdict = next(candidate for candidate in Verdict if candidate.value == word)
    # Only a contact has another actor: a stuck ego stood "with nothing to wait for".
    actor = _ACTOR.search(reason.partition(" at ")[0]) if verdict.is_collision else None
    return Ending(verdict, actor[1] if actor else "")
