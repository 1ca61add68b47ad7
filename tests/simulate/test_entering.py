"""Who came to a junction first."""

from __future__ import annotations

import pytest

from foresee_dsl.simulate.actors.insertion import since_entry_s


@pytest.mark.parametrize(
    ("inside_m", "speed", "acceleration", "since_s"),
    [
        (10.0, 5.0, 0.0, 2.0),  # as fast as it is
        (3.0, 0.0, 0.0, 30.0),  # stands: counted as 0.1 m/s
        (6.0, 4.0, 1.0, 2.0),  # from 2 m/s at the entry: 2 * 2 + 1 * 2^2 / 2 = 6
        (2.0, 2.0, 1.0, 2.0),  # from a stand at the entry
        (5.0, 2.0, 1.0, 8.0),  # 2 m from a stand in 2 s, and before that 3 m at 0.5 m/s
    ],
)
def test_the_way_inside_tells_since_when(inside_m: float, speed: float, acceleration: float, since_s: float) -> None:
    assert since_entry_s(inside_m, speed, acceleration) == pytest.approx(since_s)
