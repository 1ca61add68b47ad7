"""What a campaign found: its figures, and as JSON."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from foresee_dsl.campaign.findings.grouping import findings_of
from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome, Minimised, SeedOutcome, changes_in
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.derive.clipping.fidelity import share_within
from foresee_dsl.derive.preventability import Preventable
from foresee_dsl.simulate.results.verdict import FAILURES, DriverNotes, Verdict


@dataclass(frozen=True)
class FamilyRow:
    """The figures of one scenario family (or of all of them)."""

    family: str
    cases: int
    cases_failed: int
    risky_points: int
    clips: int
    children: int
    failures: dict[str, int]
    simulated_s: float
    wall_s: float
    fidelity_median_m: float
    fidelity_max_m: float

    @property
    def failed(self) -> int:
        """All failures."""
        return sum(self.failures.values())

    @property
    def per_risky_point(self) -> float:
        """Failures for each clip that was studied."""
        return self.failed / self.clips if self.clips else 0.0

    @property
    def per_simulated_hour(self) -> float:
        """Failures for each simulated hour, seeds and clips included."""
        return self.failed / (self.simulated_s / 3600) if self.simulated_s else 0.0


@dataclass(frozen=True)
class FidelityFigures:
    """How far the runs of unmutated clips are from their parents': largest deviations, m.

    `others`: how many other actors there were in all clips; `others_within`: the share within 0.1 m.
    """

    clips: int
    others: int
    others_median_m: float
    others_within: float
    others_max_m: float
    ego_median_m: float
    ego_max_m: float

    def as_dict(self, driver: str) -> dict[str, Any]:
        """Return it for `campaign.json`."""
        others = {"actors": self.others, "median_m": _metres(self.others_median_m),
                  "within_0.1_m": round(self.others_within, 4), "max_m": _metres(self.others_max_m)}  # fmt: skip
        ego = {"median_m": _metres(self.ego_median_m), "max_m": _metres(self.ego_max_m)}
        return {"driver": driver, "clips": self.clips, "others": others, "ego": ego}


def _metres(value: float) -> float | None:
    """For JSON, which has no infinity: an actor that a clip's run did not have at all."""
    return round(value, 4) if math.isfinite(value) else None


@dataclass(frozen=True)
class CampaignResult:
    """Everything that a campaign found; seeds and clips sorted by their names, whatever order they finished in."""

    settings: CampaignSettings
    seeds: tuple[SeedOutcome, ...]
    clips: tuple[ClipOutcome, ...]
    wall_s: float
    interrupted: bool = False
    broken: tuple[str, ...] = field(default=())
    """What could not be run at all, one line each."""
    minimised: tuple[Minimised, ...] = ()
    """The findings' representatives made smaller, sorted by name."""

    def row(self, family: str | None = None) -> FamilyRow:
        """Return the figures of one family, or of all."""
        seeds = [s for s in self.seeds if family is None or s.family == family]
        clips = [c for c in self.clips if family is None or c.family == family]
        children = [child for c in clips for child in c.children]
        counts = Counter(child.verdict for child in children)
        deviations = [c.largest_m for c in clips]
        return FamilyRow(
            family=family or "all",
            cases=len(seeds),
            cases_failed=sum(s.verdict is not Verdict.PASS for s in seeds),
            risky_points=sum(s.risky_points for s in seeds),
            clips=len(clips),
            children=len(children),
            failures={kind.value: counts[kind] for kind in FAILURES},
            simulated_s=sum(sum(run.duration_s for run in runs) for runs in (seeds, clips, children)),
            wall_s=sum(s.wall_s for s in seeds) + sum(c.wall_s for c in clips),
            fidelity_median_m=statistics.median(deviations) if deviations else 0.0,
            fidelity_max_m=max(deviations, default=0.0),
        )

    @property
    def failed(self) -> bool:
        """Whether anything failed: a test case, a child, or a run that broke."""
        return (
            any(seed.verdict is not Verdict.PASS for seed in self.seeds)
            or any(is_problem(clip.verdict, clip.notes) for clip in self.clips)
            or any(is_problem(child.verdict, child.notes) for clip in self.clips for child in clip.children)
        )

    @property
    def fidelity(self) -> FidelityFigures:
        """Return how true the unmutated clips were to their parents' runs, the ego apart."""
        others = [far for clip in self.clips for far in clip.others_m]
        egos = [clip.ego_m for clip in self.clips]
        return FidelityFigures(
            clips=len(self.clips),
            others=len(others),
            others_median_m=statistics.median(others) if others else 0.0,
            others_within=share_within(others),
            others_max_m=max(others, default=0.0),
            ego_median_m=statistics.median(egos) if egos else 0.0,
            ego_max_m=max(egos, default=0.0),
        )

    @property
    def families(self) -> tuple[str, ...]:
        """The families that occur, in the order of the paper's table; the empty one (no tag) last."""
        return tuple(sorted({s.family for s in self.seeds}, key=lambda f: (not f.isdigit(), int(f or 0), f)))

    def avoidable(self, kind: Verdict | None = None) -> dict[Preventable, int]:
        """Return how many of the failures (of one kind, or of all) a careful driver would have avoided, and not."""
        counts = Counter(c.preventable for clip in self.clips for c in clip.failing if kind in (None, c.verdict))
        return {answer: counts[answer] for answer in Preventable}

    def to_open_first(self, count: int = 5) -> tuple[ChildOutcome, ...]:
        """Return the failing children that most deserve a look.

        Those that a careful driver would have avoided come first, unavoidable ones last. Among
        equals, anything but a neighbour steered into the ego, then late in the clip; at most one of each clip until
        every clip had its turn.
        """
        turns = ((k, child) for clip in self.clips for k, child in enumerate(sorted(clip.failing, key=_interest)))
        ordered = sorted(turns, key=lambda turn: (_avoidable(turn[1]), turn[0], _interest(turn[1])))
        return tuple(child for _, child in ordered[:count])

    def as_dict(self) -> dict[str, Any]:
        """Return what `campaign.json` holds; everything but `wall_s` is the same for the same inputs."""
        total = self.row()
        return {
            "schema": 1,
            "document": "campaign",
            **{name: getattr(self.settings, name) for name in ("driver", "ranker", "preset")},
            "settings": asdict(self.settings),
            "seeds": {
                "total": total.cases,
                "passed": total.cases - total.cases_failed,
                "failed": total.cases_failed,
            },
            **{name: getattr(total, name) for name in ("risky_points", "clips", "children", "failures")},
            "preventability": {answer.value: count for answer, count in self.avoidable().items()},
            "fidelity_m": {"median": round(total.fidelity_median_m, 4), "max": round(total.fidelity_max_m, 4)},
            "fidelity": self.fidelity.as_dict(self.settings.driver),
            "simulated_s": round(total.simulated_s, 2),
            "wall_s": round(self.wall_s, 2),
            "interrupted": self.interrupted,
            "broken": list(self.broken),
            "test_cases": [_seed_dict(s) for s in self.seeds],
            "clip_runs": [_clip_dict(c) for c in self.clips],
            "findings": [
                {**finding.as_dict(), "minimised": self._minimised(finding.name)} for finding in findings_of(self)
            ],
            "open_first": [child.file for child in self.to_open_first()],
        }

    def _minimised(self, name: str) -> dict[str, Any] | None:
        return next((small.as_dict() for small in self.minimised if small.child.name == name), None)


def is_problem(verdict: Verdict, notes: DriverNotes | None = None) -> bool:
    """Whether the run of a clip or a child is one that people have to look at: the driver failed, broke or hangs.

    A child that begins in a contact is none, nor one that does not arrive in a clip's few seconds.
    """
    return verdict.is_failure or verdict is Verdict.CRASH or (notes is not None and notes.hang is not None)


def _avoidable(child: ChildOutcome) -> int:
    """The order of triage: a careful driver would have avoided it, undecided, unavoidable."""
    return {Preventable.YES: 0, Preventable.NO: 2}.get(child.preventable or Preventable.UNKNOWN, 1)


def _interest(child: ChildOutcome) -> tuple[int, bool, bool, float, str]:
    return (_avoidable(child), "steer" in child.operators, child.verdict is Verdict.STUCK, -child.time_s, child.name)


def _seed_dict(seed: SeedOutcome) -> dict[str, Any]:
    return {
        "test_case": seed.id,
        "family": seed.family,
        "meaning": seed.meaning,
        "verdict": seed.verdict.value,
        "reason": seed.reason,
        "duration_s": round(seed.duration_s, 2),
        "risky_points": seed.risky_points,
        **_details(seed),
        "notes": seed.notes.as_dict() if seed.notes else None,
        "trace": seed.trace,
    }


def _clip_dict(clip: ClipOutcome) -> dict[str, Any]:
    return {
        "clip": clip.name,
        "test_case": clip.seed,
        "verdict": clip.verdict.value,
        "deviation_m": {"max": _metres(clip.largest_m), "median_others": _metres(clip.median_m),
                        "ego": _metres(clip.ego_m)},
        "within_0.1_m": round(clip.within, 4),
        "children": [
            {
                "mutant": child.name,
                "meaning": child.meaning,
                "operators": list(child.operators),
                "changes": changes_in(child.text),
                "verdict": child.verdict.value,
                "with": child.with_,
                "reason": child.reason,
                "digest": child.digest,
                "file": child.file if child.verdict.is_failure else None,
                **_details(child),
            }
            for child in clip.children
        ],
    }  # fmt: skip


def _details(run: SeedOutcome | ChildOutcome) -> dict[str, Any]:
    """Return the contact that a run ended with, its near misses, and whether its failure was preventable."""
    found = vars(run.preventability) if run.preventability else {}
    preventability = {name: round(value, 3) if isinstance(value, float) else value for name, value in found.items()}
    return {
        "impact": run.impact.as_dict() if run.impact else None,
        "near_misses": run.near.as_dict() if run.near else None,
        "preventability": preventability or None,
        "story": run.story.as_dict() if run.story else None,
    }


def sorted_outcomes(
    seeds: Iterable[SeedOutcome], clips: Iterable[ClipOutcome]
) -> tuple[tuple[SeedOutcome, ...], tuple[ClipOutcome, ...]]:
    """Return both in an order that does not depend on which finished first."""
    return tuple(sorted(seeds, key=lambda s: s.id)), tuple(sorted(clips, key=lambda c: (c.seed, c.rank)))
