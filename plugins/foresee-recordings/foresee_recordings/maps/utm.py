"""The UTM projection of latitudes and longitudes on WGS 84.

Series of Krueger as in C. F. F. Karney, "Transverse Mercator with an accuracy of a few nanometers", J. Geodesy 85
(2011), equations 7 to 9, 35 and 36; with four terms the error is below a micrometre within 3 degrees of the meridian.
"""

from __future__ import annotations

import math

_A_M, _FLATTENING = 6_378_137.0, 1 / 298.257_223_563
"""Equatorial radius and flattening of WGS 84."""
_SCALE, _EASTING_M, _SOUTHERN_M = 0.9996, 500_000.0, 10_000_000.0
"""Scale on the central meridian, false easting, and false northing south of the equator (UTM)."""
_N = _FLATTENING / (2 - _FLATTENING)
_RADIUS_M = _A_M / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64)
_ALPHA = (
    _N / 2 - 2 / 3 * _N**2 + 5 / 16 * _N**3 + 41 / 180 * _N**4,
    13 / 48 * _N**2 - 3 / 5 * _N**3 + 557 / 1440 * _N**4,
    61 / 240 * _N**3 - 103 / 140 * _N**4,
    49561 / 161280 * _N**4,
)
_ECCENTRICITY = math.sqrt(_FLATTENING * (2 - _FLATTENING))


def zone_of(longitude: float) -> int:
    """Return the number of the zone of a longitude, degrees."""
    return math.floor((longitude + 180) / 6) % 60 + 1


def utm(latitude: float, longitude: float, zone: int, *, southern: bool = False) -> tuple[float, float]:
    """Return easting and northing, m, of a place, degrees; `southern`: with the false northing of the south."""
    phi, turn = math.radians(latitude), math.radians(longitude - (6 * zone - 183))
    sine = math.sin(phi)
    tau = math.sinh(math.atanh(sine) - _ECCENTRICITY * math.atanh(_ECCENTRICITY * sine))
    xi = math.atan2(tau, math.cos(turn))
    eta = math.asinh(math.sin(turn) / math.hypot(tau, math.cos(turn)))
    terms = list(enumerate(_ALPHA, start=1))
    north = xi + sum(alpha * math.sin(2 * k * xi) * math.cosh(2 * k * eta) for k, alpha in terms)
    east = eta + sum(alpha * math.cos(2 * k * xi) * math.sinh(2 * k * eta) for k, alpha in terms)
    factor = _SCALE * _RADIUS_M
    return _EASTING_M + factor * east, factor * north + (_SOUTHERN_M if southern else 0.0)
