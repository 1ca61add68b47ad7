"""Who came to a junction first, as far as a description tells."""

from __future__ import annotations

import math

SLOWEST_MPS = 0.1
"""Who is slower stands, and has come to where it is a while ago."""
CREEPS_MPS = 0.5
"""So fast, on the whole, comes into a junction who waits inside. Ours: it orders by the way inside those who wait."""


def since_entry_s(inside_m: float, speed_mps: float, acceleration_mps2: float) -> float:
    """Return how long ago somebody seems to have come to a junction, s.

    Args:
        inside_m: how far inside its front is.
        speed_mps: as fast it came.
        acceleration_mps2: over 0 where it was slower before: as long as it gains speed now it has gained speed before,
            from a stand if the way is long enough, and until then it crept.
    """
    if acceleration_mps2 <= 0.0:
        return inside_m / max(speed_mps, SLOWEST_MPS)
    began = speed_mps * speed_mps - 2 * acceleration_mps2 * inside_m
    if began >= 0.0:
        return (speed_mps - math.sqrt(began)) / acceleration_mps2
    crept_m = inside_m - speed_mps * speed_mps / (2 * acceleration_mps2)
    return speed_mps / acceleration_mps2 + crept_m / CREEPS_MPS
