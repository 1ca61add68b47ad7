"""Driving styles of vehicles that SUMO drives: parameters of SUMO's own models that differ from those of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class DrivingStyle:
    """Parameters of SUMO's car-following, junction and lane-changing models.

    Each has a constant effect at every step, so a clip that names the style continues as its parent did. SUMO's `sigma`
    and its driver state are not used: they depend on random numbers inside SUMO, which a clip cannot restore.

    Attributes:
        impatience: SUMO's impatience, 0 to 1: how much a vehicle that has to give way counts on the braking of one
            that goes first.
        assertive: SUMO's `lcAssertive`: the gaps that a change of lane requires are divided by it.
        braking_mps2: deceleration with which it plans to stop, at most its model's hardest; None: its model's.
        acceleration_mps2: largest acceleration, at most its model's; None: its model's.
    """

    impatience: float = 0.0
    assertive: float = 1.0
    braking_mps2: float | None = None
    acceleration_mps2: float | None = None


STYLES: Mapping[str, DrivingStyle] = MappingProxyType(
    {
        # Impatience: a vehicle that goes first should not have to brake with more than 3.4 m/s^2 (VCRT articles 1(aa)
        # and 18, AASHTO 3.2.2, as the rule `priority`). Ours: `pdm`, which drives at 40 km/h on the main road, brakes
        # with up to 2.4 m/s^2 if the impatience is 0.45, with 3.6 m/s^2 if it is 0.5, and with 7.2 m/s^2 if it is 1.
        # Lane changes: half of the gaps that SUMO requires by default; ours.
        "takes_gap": DrivingStyle(impatience=0.45, assertive=2.0),
        # UN R157, annex 4, appendix 3: a careful driver brakes with 0.774 g in an emergency. The models themselves plan
        # to brake with about 4.5 m/s^2. (The factor is `kernels.constants.GRAVITY_MPS2`: a check loads no kernels.)
        "brakes_late": DrivingStyle(braking_mps2=0.774 * 9.81),
        # Ours: half of the least that drivers find comfortable, 1.5 m/s^2 to 2 m/s^2 in the literature from 1938 to
        # 2010 (review by C. Murdoch, Hawkins, "Acceleration from rest").
        "creeps": DrivingStyle(acceleration_mps2=0.75),
    }
)
"""The styles by the word that a `style` statement has."""
