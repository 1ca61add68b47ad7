"""The expected results in a file, and the comparison of a run with them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import StrEnum
from typing import get_args

from foresee_dsl.drivers.registry import recorded_address, recorded_driver
from foresee_dsl.language import model as m
from foresee_dsl.language.model.scenario import FailureName
from foresee_dsl.simulate.results.verdict import DOES_NOT_HOLD, RunRecord, Verdict

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
    STALE = ("stale", "magenta", "its parent's edit reaches it or cannot be traced, or its files have errors")
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


def expected_of(run: RunRecord, driver: str, case: str | None = None) -> m.Expected | None:
    """Return the statement that expects a run to end as it did; None if that cannot be expected (crash, invalid)."""
    if run.verdict in (Verdict.PASS, Verdict.GOAL):  # a broken expectation has no kind: see its `expect` line
        return m.Expected(driver=driver, case=case, outcome="passes" if run.passed else "fails")
    if run.verdict.value not in get_args(FailureName):
        return None
    is_name = re.fullmatch(
        m.NAME_PATTERN, run.with_
    )  # ids of background traffic on a foreign network may not be names of the language
    return m.Expected.model_validate(
        {
            "driver": driver,
            "case": case,
            "outcome": "fails",
            "failure": run.verdict.value,
            "actor": run.with_ if is_name else None,
        }
    )


def in_words(expected: m.Expected | None) -> str:
    """Return an expected result in words: `fails F2 with walker`, `passes`; "nothing" for None."""
    if expected is None:
        return "nothing"
    with_ = f" with {expected.actor}" if expected.actor else ""
    return f"{expected.outcome} {expected.failure or ''}".rstrip() + with_


def judge(expected: m.Expected | None, run: RunRecord) -> Status:
    """Return how a run compares with the expected result."""
    if run.verdict is Verdict.CRASH:
        return Status.CRASHED
    if expected is not None and not run.hangs and _is_met(expected, run):  # another machine may not have the hang
        return Status.AS_EXPECTED
    if run.verdict is Verdict.TIMEOUT:
        return Status.TIMED_OUT
    if expected is None:
        return Status.NEW
    if expected.outcome == "passes":
        return Status.CAME_BACK
    return Status.FIXED if run.passed else Status.CHANGED


def _is_met(expected: m.Expected, run: RunRecord) -> bool:
    if expected.outcome == "passes":
        return run.passed
    if expected.failure is None:
        return run.verdict.is_failure or (run.verdict is Verdict.PASS and not run.passed)
    return expected.failure == run.verdict.value and expected.actor in (None, run.with_)


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
    run = recorded_end(origin.found)
    version = (origin.driver or DRIVER).partition(" via ")[0]
    driver = version.rpartition(" ")[0] or version
    named = driver if driver != "unknown" else recorded_address(origin.driver or DRIVER)
    return expected_of(run, named) if run is not None else None


def recorded_end(reason: str) -> RunRecord | None:
    """Return the verdict and the other actor of a recorded sentence, or the expectation that it breaks; None if it is
    not that of a failure.
    """
    if reason.startswith(DOES_NOT_HOLD):
        return RunRecord(verdict=Verdict.PASS, broken_expectations=(reason,))
    word = re.split(r"\W", reason, maxsplit=1)[0]
    if word not in (*get_args(FailureName), Verdict.GOAL.value):
        return None
    verdict = next(candidate for candidate in Verdict if candidate.value == word)
    # Only a contact has another actor: a stuck ego stood "with nothing to wait for".
    actor = _ACTOR.search(reason.partition(" at ")[0]) if verdict.is_collision else None
    return RunRecord(verdict=verdict, with_=actor[1] if actor else "")
