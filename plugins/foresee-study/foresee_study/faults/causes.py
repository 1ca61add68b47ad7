"""Measures how often a diagnosis names the part of a driver into which a fault was seeded.

A fault causes a failure if the healthy driver passes the same run. Each fault states its part (`Fault.part`); for a
fault of the planning, which no ideal part replaces, the right answer is that no part makes the failure go away.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.findings.diagnosing import Failing, diagnose
from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.faults.plug_in_path import address, healthy
from foresee_study.faults.sampling import library, name
from foresee_study.faults.table import table_lines
from foresee_study.halves import Half

NONE = "none"
"""The answer that no ideal part makes a failure disappear."""
SEVERAL = "several"
"""The answer that only several ideal parts together make a failure disappear."""


@dataclass(frozen=True)
class Named:
    """A failure that a fault caused, with its diagnosis.

    Attributes:
        fault, case: the fault and the test case. right: the part with the fault, or `NONE`. answer: the part that the
            diagnosis names, `NONE` or `SEVERAL`. text: the diagnosis in words.
    """

    fault: str
    case: str
    right: str
    answer: str
    text: str


def measure_causes(
    faults: Sequence[str],
    parts: Mapping[str, DriverPart | None],
    *,
    half: Half,
    strength: float,
    cases: int,
    failures: int,
    ends_s: float,
    jobs: int,
    say: Callable[[str], None],
) -> tuple[Named, ...]:
    """Return the diagnoses of failures that seeded faults caused.

    Args:
        faults: names such as `pdm/late_objects`. parts: the driver's part that each kind of fault is in. half: the half
            of the test cases that is used.
        cases: number of test cases that are driven at most for each fault. failures: maximum number of failures of each
            fault that are diagnosed.
        ends_s: time, as of `time.time`, after which no test case is driven. say: function that is called with a line
            for each fault.
    """
    pool = library(half)
    passes: dict[tuple[str, str], bool] = {}
    failing: list[tuple[str, str, Failing]] = []
    for fault in faults:
        driver, own, count = address(fault, strength), healthy(fault), 0
        for case in pool[:cases]:
            if count == failures or time.time() > ends_s:
                break
            if (case.id, own) not in passes:
                passes[case.id, own] = run_test_case(case, own, 0).verdict is Verdict.PASS
            if not passes[case.id, own]:
                continue
            verdict = run_test_case(case, driver, 0).verdict
            if verdict.is_failure:
                count += 1
                failing.append((fault, name(case), Failing(name(case), case, DriverSetup(driver))))
        say(f"{fault}: {count} failures")
    named = []
    for (fault, case_name, _), result in zip(failing, diagnose([each for *_, each in failing], jobs), strict=True):
        if result.diagnosis is None:
            say(f"{fault} in {case_name}: {result.note}")
            continue
        cause = result.diagnosis.cause
        answer = NONE if not cause else str(cause[0]) if len(cause) == 1 else SEVERAL
        right = parts[fault.partition("/")[2]]
        named.append(Named(fault, case_name, str(right) if right is not None else NONE, answer, result.diagnosis.text))
    return tuple(named)


def causes_table(named: Sequence[Named]) -> str:
    """Return the confusion table as Markdown: the parts with the faults, and the parts that the diagnoses name."""
    columns = [*map(str, DriverPart), SEVERAL, NONE]
    counts = Counter((each.right, each.answer) for each in named)
    rows = []
    for right in (*map(str, DriverPart), NONE):
        total = sum(counts[right, column] for column in columns)
        if total:
            cells = (str(counts[right, column] or "") for column in columns)
            rows.append((right, *cells, f"{counts[right, right]} of {total}"))
    right_ones = sum(each.right == each.answer for each in named)
    with_part = [each for each in named if each.right != NONE]
    of_parts = sum(each.right == each.answer for each in with_part)
    return "\n".join([
        *table_lines(("part with the fault", *columns, "right"), rows), "",
        f"Right: {right_ones} of {len(named)}; "
        f"of faults in a part that can be replaced {of_parts} of {len(with_part)}.",
    ])  # fmt: skip
