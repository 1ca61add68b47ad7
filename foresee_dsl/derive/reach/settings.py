"""Settings of the ranker `reach`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ReachSettings:
    """Settings of the ranker `reach`. All ours, chosen on the even half of the test cases (docs/background/rankers.md).

    Attributes:
        every_s: time between the examined onsets. Ours: whole seconds, as in the exhaustive search.
        nearest: number of actors examined per onset, the nearest to the ego first.
        within_m: distance to the ego above which an actor is not examined. Ours: two vehicles that meet at 30 km/h
            cover it in 2.4 s.
        looks_s: duration of the roll-out of steering. Ours: 4 s, 5 s and 7 s give 37, 37 and 31 failures.
        paced_s: duration of the roll-out of all other changes, which displace an actor more slowly. Ours: with a
            swapped bicycle, failures of the exhaustive search come up to 9 s after the onset.
        step_s: time step of the roll-out. Ours: a vehicle in town turns by less than 4 deg in it.
        shares: largest number of values per change that are rolled out, evenly spaced over the allowed ones.
        decided: largest number of values that reach the ego for which careful drivers are rolled out.
        met_weight: weight of an actor that comes near the ego without a change within `met_s` after the onset; the
            weight is halved at 1 m. Ours: of 0.15, 0.3 and 0.6, 0.3 gave as many failures as any, and as many
            avoidable ones.
        met_s: see `met_weight`.
        again: worth of a kind of contact the second time, as a share of the first. Ours: 0.3, 0.5 and 0.7 differ by
            little.
        swap_within_m: recorded gap to the ego above which an actor's model is not swapped, swap_reach_m: gap that a
            swap must reach. Ours: these save time, as most swaps have no effect.
        proposals: maximum number of ranked changes; the points of the ranker `foresee` follow them.
    """

    every_s: float = 1.0
    nearest: int = 3
    within_m: float = 40.0
    looks_s: float = 5.0
    paced_s: float = 8.0
    step_s: float = 0.1
    shares: int = 41
    decided: int = 6
    met_weight: float = 0.3
    met_s: float = 10.0
    again: float = 0.5
    swap_within_m: float = 6.0
    swap_reach_m: float = 1.0
    proposals: int = 24
