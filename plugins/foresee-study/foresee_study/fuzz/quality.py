"""Computes DriveFuzz's driving-quality metrics of a run from its trace; a lower score means worse driving.

It counts the frames in which the ego accelerated, braked or turned hard, or lost grip, and adds the inverse of the
smallest distance to another actor. `docs/background/fuzz.md` defines each metric in the columns of a trace, with the
source of its threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from foresee_dsl.documents import every_field
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.simulate.results.near_misses import near_misses
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEER, STEP_S, YAW_RATE, Trace

HARD_MPS2 = 21.2 / 3.6
"""Hard acceleration and braking, m/s^2: DriveFuzz's 21.2 km/h in a second."""
TURNS_MPS2 = 4.89
"""Lateral acceleration above which a turn is hard, m/s^2: nuPlan's bound of comfort. DriveFuzz divides the lateral
speed by the steering wheel's angle, which in a kinematic model is geometry alone."""
ROLLS_MPS = 5.0 / 3.6
"""Speed below which over- and understeer do not count, m/s: DriveFuzz's 5 km/h."""
SWINGS_MPS2 = 0.1 * GRAVITY_MPS2
"""The ego oversteers if its lateral acceleration differs from its mean over `MEAN_S` by at least this, m/s^2:
DriveFuzz's 0.1 g between its two low-pass filters."""
SPINS_RAD_S = float(np.radians(17.5))
"""The ego oversteers if its yaw rate is above this, rad/s: from there on, DriveFuzz's fuzzy rules do not call a yaw
rate small."""
MEAN_S = 1.0
"""Window of the moving mean, s. Ours: a moving mean of 1 s passes frequencies below 0.44 Hz, like DriveFuzz's heavy
filter of 0.5 Hz."""
STEERS_RAD = float(np.radians(1.0))
"""The ego understeers only if its front wheels are turned by at least this, rad. Ours: DriveFuzz instead requires 10
degrees at the steering wheel."""
WIDE_SHARE = 0.9
"""The ego understeers if its yaw rate is at most this share of what the wheel angle implies. Ours: 10 % is far more
than rounding errors."""
FAR_M = 100.0
"""Distance beyond which actors do not count, m: DriveFuzz's 100 m."""
TOUCHES_M = 0.1
"""Lowest distance of which the inverse is computed, m. Ours: the inverse would grow without bound."""


@dataclass(frozen=True)
class Quality:
    """The number of frames (of 0.05 s) of bad driving by kind, and the inverse of the least distance to another actor,
    1/m."""

    hard_acceleration: int = 0
    hard_braking: int = 0
    hard_turning: int = 0
    oversteer: int = 0
    understeer: int = 0
    nearness: float = 0.0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return every_field(self, 4)

    @property
    def score(self) -> float:
        """Return the driving-quality score: minus the sum of all metrics."""
        counts = self.hard_acceleration + self.hard_braking + self.hard_turning + self.oversteer + self.understeer
        return -(counts + self.nearness)


def quality_of(trace: Trace) -> Quality:
    """Return the driving quality of the ego in a run."""
    ego = trace.states[:, 0]
    speed, along, yaw_rate, steer = (ego[:, k] for k in (SPEED, ACCELERATION, YAW_RATE, STEER))
    lateral = speed * yaw_rate
    rolls = speed > ROLLS_MPS
    kinematic = speed * np.tan(steer) / trace.actors[0].wheelbase_m
    wide = (np.abs(steer) > STEERS_RAD) & (np.abs(yaw_rate) < WIDE_SHARE * np.abs(kinematic))
    swings = np.abs(lateral - _mean(lateral)) > SWINGS_MPS2
    return Quality(
        hard_acceleration=int(np.count_nonzero(along >= HARD_MPS2)),
        hard_braking=int(np.count_nonzero(along <= -HARD_MPS2)),
        hard_turning=int(np.count_nonzero(np.abs(lateral) >= TURNS_MPS2)),
        oversteer=int(np.count_nonzero(rolls & swings & (np.abs(yaw_rate) > SPINS_RAD_S))),
        understeer=int(np.count_nonzero(rolls & wide)),
        nearness=_nearness(trace),
    )


def _mean(values: FloatArray) -> FloatArray:
    """Return the moving mean, over fewer frames at both ends."""
    half = round(MEAN_S / STEP_S / 2)
    sums = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(values))
    mean: FloatArray = (sums[high] - sums[low]) / (high - low)
    return mean


def _nearness(trace: Trace) -> float:
    closest = near_misses(trace).distance_m
    if closest is None or closest.value > FAR_M:
        return 0.0
    return 1.0 / max(closest.value, TOUCHES_M)
