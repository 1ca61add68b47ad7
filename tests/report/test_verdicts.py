"""The headline of runs: a driver that hangs in all of them is named, a test case that ends too late is counted."""

from __future__ import annotations

import time

import pytest

from foresee_dsl.campaign.execution.runs import broken_run
from foresee_dsl.campaign.workers.pool import BrokenTask, Task
from foresee_dsl.report.verdicts import verdicts_line
from foresee_dsl.simulate.results.verdict import DriverNotes, Hang, RunRecord, Verdict

HUNG = RunRecord(
    verdict=Verdict.TIMEOUT,
    reason="timeout: the driver took longer than 1 s",
    duration_s=3.0,
    notes=DriverNotes(hang=Hang("step", 1.0)),
)
ENDED = broken_run(RunRecord, BrokenTask(Task("a", time.sleep, 60), "took longer than 60 s of wall time", "timeout"))
LATE = RunRecord(verdict=Verdict.TIMEOUT, reason="timeout: did not arrive within 40.00 s", duration_s=40.0)


@pytest.mark.parametrize(
    ("run", "headline"),
    [
        (HUNG, "the driver hangs in 1 of 1 test case: the driver took longer than 1 s"),
        (ENDED, "the driver hangs in 1 of 1 test case: the run took longer than 60 s of wall time"),
        (LATE, "1 of 1 test case failed: 1 timeout"),
    ],
)
def test_the_headline_of_a_run_that_took_too_long(run: RunRecord, headline: str) -> None:
    assert verdicts_line([run]).plain == headline
