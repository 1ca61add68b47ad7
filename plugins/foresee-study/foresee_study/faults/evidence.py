"""The records of a search: all runs in their order, and for each failure the answers of all judges."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

R157, AHEAD, DIFFERENTIAL, ANY = "R157", "anticipating", "differential", "any of them"
"""Names of the judges that are not a single driver: two driver models, whether any judging driver avoids the failure,
and whether any judge says that it could be avoided."""
DRIVERS, NOT_EXCUSED = "the driver's fault", "the driver's fault or arguable"
"""Names of two judges that use `avoidance.responsibility`: the first counts only failures that are the driver's fault,
the second also counts arguable ones."""


@dataclass(frozen=True)
class Failure:
    """A failing run.

    Attributes:
        finding: key of equal failures (family and story). sentence: the failure in words.
        healthy: verdict of the healthy driver in the same run, the ground truth. case: its test case.
        verdicts: by judge (`r157`, `idm`, ...), whether the failure was avoidable; None if the judge does not decide.
    """

    finding: tuple[str, ...]
    sentence: str
    case: str
    healthy: str
    verdicts: dict[str, bool | None]

    @property
    def is_the_faults(self) -> bool:
        """Return whether the seeded fault caused the failure: the healthy driver passes the same run."""
        return self.healthy == "pass"


@dataclass(frozen=True)
class ApproachRun:
    """One run: its kind (`seed`, `clip`, `child`), its simulated time (s), and its failure, if any."""

    kind: str
    simulated_s: float
    failure: Failure | None = None


@dataclass(frozen=True)
class Evidence:
    """The runs of one approach for one fault at one strength, in their order."""

    fault: str
    strength: float
    approach: str
    runs: tuple[ApproachRun, ...]
    wall_s: float = 0.0

    def within(self, simulated_s: float) -> tuple[ApproachRun, ...]:
        """Return the runs that begin within this simulated time."""
        runs, spent_s = [], 0.0
        for run in self.runs:
            if spent_s >= simulated_s:
                break
            runs.append(run)
            spent_s += run.simulated_s
        return tuple(runs)

    def failures(self, simulated_s: float) -> tuple[Failure, ...]:
        """Return the failures of these runs."""
        return tuple(run.failure for run in self.within(simulated_s) if run.failure is not None)

    def of_children(self, simulated_s: float) -> tuple[Failure, ...]:
        """Return the failures of children among these runs.

        Failures of unmutated test cases are left out: the healthy driver passes all of these test cases, so their
        failures come from the fault alone, not from a mutation.
        """
        runs = self.within(simulated_s)
        return tuple(run.failure for run in runs if run.failure is not None and run.kind == "child")


def save(evidence: Evidence, file: Path, key: str) -> None:
    """Write a search's evidence, whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    fresh = file.with_suffix(".new")
    fresh.write_text(json.dumps({"key": key, **asdict(evidence)}), encoding="utf-8")
    fresh.replace(file)


def load(file: Path, key: str) -> Evidence | None:
    """Read a search's evidence; None if there is none, or it comes from other settings or other code."""
    if not file.is_file():
        return None
    stored: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return _adapter().validate_python(stored) if stored.pop("key") == key else None


@cache
def _adapter() -> TypeAdapter[Evidence]:
    return TypeAdapter(Evidence)
