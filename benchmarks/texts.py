"""Generates scenario texts of any length for benchmarks."""

from __future__ import annotations

import re

CASES = 4
"""Number of cases, each of which is checked as a whole; it is constant, so that only the length grows."""


def scenario(lines: int) -> str:
    """Return a scenario of about `lines` lines: actors with parameters, triggers with several conditions, cases."""
    groups = max((lines - 20 - CASES) // 13, 1)
    head = [
        "foresee 1",
        "",
        "# Made for a measurement.",
        "scenario long {",
        '  use network "networks/town.foresee"',
        "",
        "  ego: car.sedan {",
        "    route from mill_west straight over mill_oak",
        "    start at 12 m along ego.route",
        "    start speed 36 km/h",
        "  }",
        "",
    ]
    body = [line for k in range(groups) for line in _group(k)]
    tail = ["  expect never collision(ego)", "  end after 45 s", ""]
    tail += [f"  case c{n} {{ pace_{n % groups} = {20 + n} km/h }}" for n in range(CASES)]
    return "\n".join([*head, *body, *tail, "}", ""])


def anew(text: str, number: int) -> str:
    """Return a scenario of `scenario` with other names, because statements that were read before are kept as parsed."""
    return re.sub(r"\b(actor|pace)_", rf"\1_{number}_", text)


def _group(k: int) -> list[str]:
    """Return the 13 lines of a parameter, an actor and a trigger."""
    return [
        f"  param pace_{k}: speed = 20 km/h in 10 km/h..50 km/h step 1 km/h",
        f"  # Actor {k} brakes late.",
        f"  vehicle actor_{k}: car.compact {{",
        "    route [mill_west, mill_mid]",
        f"    start at {k % 100 + 0.5} m along mill_west",
        f"    speed pace_{k}",
        "    start speed 18 km/h",
        "  }",
        f"  when distance(ego, actor_{k}) < 12.5 m and ego.speed > 20 km/h {{",
        f"    actor_{k} stops",
        f"    actor_{k} changes speed to 30 km/h",
        "  }",
        "",
    ]
