"""What the ranker `reach` looks at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ReachSettings:
    """What the ranker looks at. All ours, chosen on the even half of the test cases (docs/background/method.md).

    Attributes:
        every_s: onsets that are looked at are so far apart. Ours: as the exhaustive search's whole seconds.
        nearest: so many actors are looked at for each onset, the nearest to the ego first.
            within_m: none that is farther away; ours, what two that meet at 30 km/h drive in 2.4 s.
        looks_s: for so long after the onset steering is rolled out. Ours: with 4 s, 5 s and 7 s 37, 37 and 31 failures.
        paced_s: for so long all other changes are, which take longer to bring an actor elsewhere. Ours: with a swapped
            bicycle, failures of the exhaustive search come up to 9 s after the onset.
        step_s: of the roll-out. Ours: a vehicle in town turns by less than 4 deg in it.
        shares: of the values that an operator may draw at most so many are rolled out, evenly over all of them.
        decided: of those that reach the ego, at most so many are rolled out with careful drivers.
        met_weight: what it counts that an actor comes to the ego anyhow, in `met_s` after the onset: half of it at 1 m.
            Ours: of 0.15, 0.3 and 0.6, 0.3 found as many failures as any, and as many avoidable ones.
        again: what a story is worth once more, as a share of the first time. Ours: 0.3, 0.5 and 0.7 differ by little.
        swap_within_m: models are swapped of actors that come so near to the ego as recorded, swap_reach_m: and that a
            swap brings so near. Ours: to be quick, as most swaps do nothing.
        proposals: so many are ranked at most, before the points of `foresee`.
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
