"""Reduces the sensors' ranges by rain, fog and sun.

A lidar's echo decreases with the square of the distance and with the air's extinction on the way there and back. The
range in bad air is the distance at which the echo is as weak as at the range in clear air; for cameras we assume the
same range. Radar echoes through fog have no class and no size and are ignored (ours).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

FOG_VISIBILITY_M = 50.0
"""Visibility at fog 1, m. The densest class of fog in the Open Simulation Interface, "thick", ends at 50 m; with less
visibility traffic stops. Visibility is inversely proportional to the fog: at 0.25 it is 200 m, at 0.05 (mist) 1 km."""
KOSCHMIEDER = 3.0
"""Product of extinction and visibility: the visibility is the distance at which 5 % of the light is left (Koschmieder;
the Met Office's definition)."""
RAIN_MM_H = 50.0
"""Rate of rain 1, mm/h: the lower bound of a violent shower, as the Met Office defines it (its guide in The
Independent, 5 January 1998)."""
RAIN_K, RAIN_POWER = 1.076, 0.67
"""Attenuation in rain of R mm/h: 1.076 R^0.67 dB/km for optical links (Carbonneau and Wisely 1998): 15 dB/km at
50 mm/h."""
SUN_LOSES = 0.5
"""Share by which a low sun (1) reduces the range of signals. Ours: glare; the sun has no direction in the language, so
it applies in all directions. Objects are measured by lidar, which a low sun hardly affects."""
RAIN_LOSES = 0.3
"""Share by which rain (1) reduces the range of signals. Ours: drops on the windscreen; the air itself does not dim a
lamp over such distances."""
_PER_M = math.log(10.0) / 10.0 / 1000.0
"""Attenuation of 1 dB/km as an extinction coefficient, 1/m."""
_CLOSE_M = 1e-6


@dataclass(frozen=True, slots=True)
class Air:
    """The rain, fog and sun of a scene, each a ratio from 0 to 1."""

    rain: float = 0.0
    fog: float = 0.0
    sun: float = 0.0

    @property
    def extinction(self) -> float:
        """Extinction coefficient, 1/m."""
        rain_db_km = RAIN_K * math.pow(RAIN_MM_H * self.rain, RAIN_POWER)
        return KOSCHMIEDER * self.fog / FOG_VISIBILITY_M + rain_db_km * _PER_M

    def object_range_m(self, clear_m: float) -> float:
        """Return the range in this air, m, of an object with the range `clear_m` in clear air."""
        extinction = self.extinction
        low, high = 0.0, clear_m
        while high - low > _CLOSE_M:  # solves r^2 exp(2 a r) = R^2, or r exp(a r) = R, whose left side grows with r
            middle = (low + high) / 2
            if middle * math.exp(extinction * middle) > clear_m:
                high = middle
            else:
                low = middle
        return high

    def signal_range_m(self, clear_m: float) -> float:
        """Return the range in this air, m, of a signal with the range `clear_m` in clear air; in fog at most the
        visibility."""
        seen_m = clear_m * (1.0 - SUN_LOSES * self.sun) * (1.0 - RAIN_LOSES * self.rain)
        return min(seen_m, FOG_VISIBILITY_M / self.fog) if self.fog > 0.0 else seen_m


CLEAR = Air()
"""Clear air."""
