"""What a search found, as records: every run in its order, and of a failure what each verdict says of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

R157, AHEAD, DIFFERENTIAL, ANY = "R157", "anticipating", "differential", "any of them"
"""The judges that are no single driver: two models, whether any judging driver avoids it, and any of all these."""


@dataclass(frozen=True)
class Failure:
    """A failing run.

    Attributes:
        finding: what equal failures have in common (family and story). sentence: what happened.
        healthy: the verdict of the healthy driver in its place, the ground truth. case: the test case it comes from.
        verdicts: by the name of each judge (`r157`, `idm`, ...) whether it says that the failure could be avoided; None
            where it does not decide.
    """

    finding: tuple[str, ...]
    sentence: str
    case: str
    healthy: str
    verdicts: dict[str, bool | None]

    @property
    def is_the_faults(self) -> bool:
        """Whether the seeded fault is to blame: the healthy driver passes."""
        return self.healthy == "pass"


@dataclass(frozen=True)
class Ran:
    """One run: what it was (`seed`, `clip`, `child`), how long it simulated, s, and how it failed if it did."""

    kind: str
    simulated_s: float
    failure: Failure | None = None


@dataclass(frozen=True)
class Evidence:
    """What one approach did with one fault at one strength, in its order."""

    fault: str
    strength: float
    approach: str
    runs: tuple[Ran, ...]
    wall_s: float = 0.0

    def within(self, simulated_s: float) -> tuple[Ran, ...]:
        """Return the runs that begin within so many simulated seconds."""
        found, spent_s = [], 0.0
        for run in self.runs:
            if spent_s >= simulated_s:
                break
            found.append(run)
            spent_s += run.simulated_s
        return tuple(found)

    def failures(self, simulated_s: float) -> tuple[Failure, ...]:
        """Return the failures among them."""
        return tuple(run.failure for run in self.within(simulated_s) if run.failure is not None)

    def of_children(self, simulated_s: float) -> tuple[Failure, ...]:
        """Return the failures of children among them: the healthy driver passes all test cases, so that a test case
        which fails is always the fault's."""
        runs = self.within(simulated_s)
        return tuple(run.failure for run in runs if run.failure is not None and run.kind == "child")


def save(evidence: Evidence, file: Path, key: str) -> None:
    """Write it, whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    fresh = file.with_suffix(".new")
    fresh.write_text(json.dumps({"key": key, **asdict(evidence)}), encoding="utf-8")
    fresh.replace(file)


def load(file: Path, key: str) -> Evidence | None:
    """Read it; None where there is none, or it was made with other settings or other code."""
    if not file.is_file():
        return None
    stored: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return _evidence(stored) if stored.pop("key") == key else None


def _evidence(stored: dict[str, Any]) -> Evidence:
    runs = tuple(
        Ran(run["kind"], run["simulated_s"], _failure(run["failure"]) if run["failure"] else None)
        for run in stored.pop("runs")
    )
    return Evidence(runs=runs, **stored)


def _failure(stored: dict[str, Any]) -> Failure:
    return Failure(**{**stored, "finding": tuple(stored["finding"])})
