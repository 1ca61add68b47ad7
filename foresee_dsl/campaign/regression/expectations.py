"""What a file expects of a driver, and how a run compares with that."""

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
"""What drives a test case that names no driver."""
_ACTOR = re.compile(r" with (\w+)")
"""Who a recorded failure was with: `F2 collision with walker (pedestrian) at 4.75 s, 6.4 m/s`."""


class Status(StrEnum):
    """How a run compares with what is expected; in the order in which they are told.

    Attributes:
        label: in words. style: how a terminal shows it. meaning: in a sentence.
    """

    _value_: str
    style: str
    meaning: str

    def __new__(cls, value: str, style: str, meaning: str) -> Status:
        """Make a member."""
        made = str.__new__(cls, value)
        made._value_, made.style, made.meaning = value, style, meaning
        return made

    CRASHED = "crashed", "bold red", "the driver or the simulator broke, so nothing is known of the test case"
    TIMED_OUT = "timed_out", "bold yellow", "it did not arrive in time, or the driver took too long"
    CAME_BACK = "came_back", "bold red", "it is expected to pass, and fails"
    CHANGED = "changed", "yellow", "it fails in another way, or with another actor"
    STALE = ("stale", "magenta", "its parent's edit reaches it or cannot be traced, or its files have mistakes")
    NEW = "new", "cyan", "nothing is recorded for this driver"
    FIXED = "fixed", "green", "it is expected to fail, and passes"
    AS_EXPECTED = "as_expected", "dim", "it ends as recorded"

    @property
    def label(self) -> str:
        """In words: `came back`."""
        return self.value.replace("_", " ")

    @property
    def can_be_recorded(self) -> bool:
        """Whether `--update` writes the run as what is expected from now on."""
        return self in (Status.CAME_BACK, Status.CHANGED, Status.NEW, Status.FIXED)


@dataclass(frozen=True)
class Ending:
    """How a run ended: the verdict, the other party's id or "", whether the driver took too much wall time, and whether
    it passed otherwise but broke an `expect` line."""

    verdict: Verdict
    actor: str = ""
    hangs: bool = False
    breaks: bool = False

    @classmethod
    def of(cls, result: RunResult) -> Ending:
        """Return how a run ended."""
        breaks = result.verdict is Verdict.PASS and not result.passed
        return cls(result.verdict, result.with_, hangs=result.notes.hang is not None, breaks=breaks)

    @property
    def passes(self) -> bool:
        """Whether nothing failed."""
        return self.verdict is Verdict.PASS and not self.breaks

    def expected_of(self, driver: str, case: str | None = None) -> m.Expected | None:
        """Return the statement that expects just this; None of what cannot be expected (crash, invalid)."""
        if self.verdict is Verdict.PASS:  # a broken expectation has no kind: its own `expect` line says what is asked
            return m.Expected(driver=driver, case=case, outcome="fails" if self.breaks else "passes")
        if self.verdict.value not in get_args(FailureName):
            return None
        known = re.fullmatch(m.NAME_PATTERN, self.actor)  # background traffic of a foreign network may have other ids
        return m.Expected.model_validate(
            {
                "driver": driver,
                "case": case,
                "outcome": "fails",
                "failure": self.verdict.value,
                "actor": self.actor if known else None,
            }
        )


def in_words(expected: m.Expected | None) -> str:
    """Return `fails F2 with walker`, `passes`; "nothing" for None."""
    if expected is None:
        return "nothing"
    with_ = f" with {expected.actor}" if expected.actor else ""
    return f"{expected.outcome} {expected.failure or ''}".rstrip() + with_


def judge(expected: m.Expected | None, ending: Ending) -> Status:
    """Return how a run compares with what is expected of it."""
    verdict = ending.verdict
    if verdict is Verdict.CRASH:
        return Status.CRASHED
    if expected is not None and not ending.hangs and _is_met(expected, ending):  # in time on another machine, perhaps
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
    """Return what a driver may be called in `expected`, the most exact first: `pdm 2`, `pdm`."""
    recorded = recorded_driver(address, version)
    own = recorded.partition(" via ")[0]
    return tuple(dict.fromkeys((recorded, own, address, own.rpartition(" ")[0] or own)))


def name_to_record(address: str, version: str) -> str:
    """Return what a driver is called in a new `expected` line: by its own name, without its version.

    Every version is meant then, so that the next one is compared with this one.
    """
    own = recorded_driver(address, version).partition(" via ")[0]
    name = own.rpartition(" ")[0] or own
    return name if ":" not in address or (name and own != "unknown") else recorded_text(address)


def recorded_text(address: str) -> str:
    """Return an address as a text of the language can hold it, without double quotes."""
    return recorded_driver(address, "").partition(" via ")[2] or address


def expected_in(
    items: Sequence[m.Item], case: str | None, names: Sequence[str], origin: m.Origin | None = None
) -> m.Expected | None:
    """Return the statement that is about a driver and a case: the most exact name first, then the case.

    Without a statement, a mutant's `origin` says it of the driver that found the failure.
    """
    stated = [item for item in items if isinstance(item, m.Expected) and item.case in (None, case)]
    for name in names:
        about = sorted((item for item in stated if item.driver == name), key=lambda item: item.case is None)
        if about:
            return about[0]
    recorded = recorded_in(origin)
    return recorded if recorded is not None and recorded.driver in names else None


def recorded_in(origin: m.Origin | None) -> m.Expected | None:
    """Return what a mutant's `driver` and `found` amount to; None where they are not there, or are no failure."""
    if origin is None or not origin.found:
        return None
    ending = ending_of(origin.found)
    version = (origin.driver or DRIVER).partition(" via ")[0]
    driver = version.rpartition(" ")[0] or version
    named = driver if driver != "unknown" else recorded_address(origin.driver or DRIVER)
    return ending.expected_of(named) if ending is not None else None


def ending_of(reason: str) -> Ending | None:
    """Return how a run ended by its recorded sentence; None of what is no failure."""
    word = re.split(r"\W", reason, maxsplit=1)[0]
    if word not in get_args(FailureName):
        return None
    verdict = next(one for one in Verdict if one.value == word)
    # Only a contact is with somebody: a stuck ego stood "with nothing to wait for".
    actor = _ACTOR.search(reason.partition(" at ")[0]) if verdict.is_collision else None
    return Ending(verdict, actor[1] if actor else "")
