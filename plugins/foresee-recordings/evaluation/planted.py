"""Finds planted situations: recall and precision of each named situation.

    python -m evaluation.planted --each 100 --seeds 1,3,5

Thresholds and detectors were chosen on even seeds; odd ones are for reports.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from foresee_recordings.mining.search import search
from foresee_recordings.mining.situation import Situation
from foresee_recordings.mining.traffic import Traffic
from foresee_recordings.recording import Recording, Track
from rich.console import Console

from evaluation.scenes import LASTS_S, MAKERS, tracks_of

CONSOLE = Console(soft_wrap=True, highlight=False)
APART_M = 1500.0
"""Distance between scenes that happen at one time, m: no actor meets one of another scene."""
COLUMNS = 20
WITHIN_S = 3.0
"""Largest difference of the moments of a planted situation and the one that was found, s."""


@dataclass(frozen=True)
class Score:
    """How many planted situations were found, and how many of those reported were planted."""

    kind: str
    planted: int
    reported: int
    right: int
    hit: int
    missed: tuple[str, ...]
    wrong: tuple[Situation, ...]

    @property
    def recall(self) -> float:
        """Share of the planted situations that were found."""
        return self.hit / self.planted

    @property
    def precision(self) -> float:
        """Share of the reported situations that were planted."""
        return self.right / self.reported if self.reported else 0.0


def planted(kind: str, each: int, seed: int) -> tuple[Recording, dict[str, float]]:
    """Return a recording with `each` situations of a kind and as many scenes without it, and the moment of each, by the
    scene's prefix."""
    rng = np.random.default_rng([seed, sorted(MAKERS).index(kind)])
    tracks: list[Track] = []
    moments: dict[str, float] = {}
    for k in range(2 * each):
        scene = MAKERS[kind](k % 2 == 0, rng)
        row, column = divmod(k, COLUMNS)
        prefix, begins_s = f"s{k}", row * (LASTS_S + 2)
        tracks += tracks_of(scene, prefix, (column * APART_M, 0.0), begins_s, rng)
        if scene.moment_s is not None:
            moments[prefix] = begins_s + scene.moment_s
    return Recording(f"planted_{kind}", Path(f"{kind}.csv"), "0" * 64, "generated", tuple(tracks)), moments


def score(kind: str, each: int, seed: int) -> Score:
    """Search a generated recording for the situations of a kind."""
    recording, moments = planted(kind, each, seed)
    situations = search(Traffic(recording), names=[kind])
    right = [s for s in situations if _is_planted(s, moments)]
    hit = {s.ego.split("_")[0] for s in right}
    wrong = tuple(s for s in situations if s not in right)
    return Score(kind, len(moments), len(situations), len(right), len(hit), tuple(sorted({*moments} - hit)), wrong)


def _is_planted(situation: Situation, moments: dict[str, float]) -> bool:
    prefixes = {actor.split("_")[0] for actor in (situation.ego, *situation.others)}
    names = {actor.split("_")[1] for actor in (situation.ego, *situation.others)}
    (prefix,) = prefixes if len(prefixes) == 1 else ("",)
    moment = moments.get(prefix)
    return moment is not None and names <= {"ego", "other"} and _near(situation, moment)


def _near(situation: Situation, moment_s: float) -> bool:
    return situation.begins_s - WITHIN_S <= moment_s <= situation.ends_s + WITHIN_S


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=100)
    parser.add_argument("--seeds", default="1")
    parser.add_argument("--kinds", default=",".join(MAKERS))
    parser.add_argument("--show", action="store_true", help="print what was missed and what was wrong")
    options = parser.parse_args()
    CONSOLE.print(f"{'situation':20} {'seed':>4} {'planted':>7} {'found':>5} {'recall':>7} {'precision':>9}")
    for seed in map(int, options.seeds.split(",")):
        for kind in options.kinds.split(","):
            result = score(kind, options.each, seed)
            CONSOLE.print(
                f"{kind:20} {seed:4} {result.planted:7} {result.reported:5} "
                f"{result.recall:7.1%} {result.precision:9.1%}"
            )
            if options.show:
                CONSOLE.print("  missed", *result.missed)
                for situation in result.wrong:
                    CONSOLE.print("  wrong", situation.moment_s, situation.sentence, dict(situation.measures))


if __name__ == "__main__":
    main()
