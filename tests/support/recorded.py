"""A recorded cut-in on a straight road, as a scenario and its tracks file, for tests of recorded tracks."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from pathlib import Path

HEAD = "# foresee tracks 1\ntime_s,actor,x_m,y_m,heading_deg,speed_mps\n"
Sample = tuple[float, str, float, float, float, float]
"""Time (s), name, x, y (m), heading (deg), speed (m/s)."""


def samples() -> list[Sample]:
    """Return 8 s at 10 Hz: the ego, a car that cuts in, one from 2 s on, a pedestrian until 4 s, a parked car."""
    rows: list[Sample] = []
    for k in range(81):
        t = k / 10
        beside = min(max(t - 2.0, 0.0), 3.2)
        turns = 2.0 <= t < 5.2
        rows.append((t, "112", 20 + 10 * t, -4.95, 0.0, 10.0))
        rows.append((t, "117", 40 + 8 * t, -1.65 - beside, -7.125 if turns else 0.0, math.hypot(8, turns)))
        if t >= 2.0:
            rows.append((t, "118", 5 + 11 * (t - 2.0), -1.65, 0.0, 11.0))
        if t <= 4.0:
            rows.append((t, "p9", 120.0, -14 + 1.4 * t, 90.0, 1.4))
        rows.append((t, "parked", 90.0, -8.6, 180.0, 0.0))
    return sorted(rows)


def text_of(rows: Iterable[Sample]) -> str:
    """Return a tracks file."""
    return HEAD + "".join("{:.2f},{},{:.3f},{:.3f},{:.3f},{:.3f}\n".format(*row) for row in rows)


SCENARIO = """foresee 1

scenario cut {
  network {
    junction a at (0 m, 0 m)
    junction b at (400 m, 0 m)
    road main from a to b { lanes 2; speed 50 km/h }
  }
  use tracks "cut.tracks.csv" pin PIN

  ego: car.sedan {
    track "112"
    route [main]
  }
  vehicle v117: car.compact { track "117" MORE }
  vehicle v118: car.suv { track "118"; then joins [main] }
  pedestrian p9: pedestrian.adult { track "p9" }
  vehicle parked: car.compact { track "parked" }

  when time >= 4 s { v118 leaves track }

  expect never collision(ego)
  end after 8 s anywhere
}
"""


def write_case(folder: Path, *, more: str = "", rows: Iterable[Sample] | None = None, scenario: str = SCENARIO) -> Path:
    """Write the scenario, with `more` statements of v117, and its tracks file; return the scenario's file."""
    tracks = text_of(samples() if rows is None else rows)
    (folder / "cut.tracks.csv").write_text(tracks, encoding="utf-8", newline="\n")
    pin = f"sha256:{hashlib.sha256(tracks.encode()).hexdigest()[:12]}"
    file = folder / "cut.foresee"
    file.write_text(scenario.replace("PIN", pin).replace("MORE", f"; {more}" if more else ""), encoding="utf-8")
    return file
