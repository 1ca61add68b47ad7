"""The constants that several parts of the package share."""

from __future__ import annotations

STEP_S = 0.05
"""Length of a simulation step, s: 20 frames a second, as the images in the paper (section 4.3.1)."""
STANDS_MPS = 0.1
"""Speed below which an actor counts as standing, m/s: SUMO's threshold for a halting vehicle."""
GRAVITY_MPS2 = 9.81
"""Standard gravity, m/s^2, with the digits that the definition of `VehicleLimits` uses."""
COMFORTABLE_MPS2 = 3.4
"""Braking that most drivers find comfortable, also on wet roads, m/s^2: AASHTO, A Policy on Geometric Design of
Highways and Streets (2018), section 3.2.2, the deceleration of its stopping sight distance."""
HARDEST_BRAKING_MPS2 = 0.774 * GRAVITY_MPS2
"""Hardest braking of a careful driver, m/s^2: R157, Annex 4, appendix 3 (0.774 g)."""
