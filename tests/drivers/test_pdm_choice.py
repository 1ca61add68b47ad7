"""`pdm` rolls out only proposals that can still win, and shares motions between them; its answer is that of all."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

from foresee_dsl.kernels.pdm.route import Stretch, nearest_points

SCENES = 40


def test_it_chooses_as_if_it_rolled_all_proposals_out() -> None:
    """Both ways run in plain Python, in random scenes; a difference raises an error there."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.plain_pdm", str(SCENES)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        check=True,
        stdout=subprocess.PIPE,
    )
    counts = json.loads(done.stdout)
    assert counts["none_allowed"] >= 3 and counts["not_first"] >= 8  # the scenes have all kinds of answers
    assert counts["rolled_out"] < 10 * SCENES  # of at least 14 proposals each


def test_the_nearest_points_are_those_of_a_search_of_each_place() -> None:
    rng = np.random.default_rng(4)
    for count in (1, 2, 45):
        at_x, at_y = np.round(rng.uniform(-5, 5, (2, count)))  # several points are equally near
        x, y = np.round(rng.uniform(-6, 6, (2, 41)))
        x[0] = np.nan
        nearest = nearest_points(x, y, Stretch(0, 1, at_x, at_y))
        away = (x[:, None] - at_x) ** 2 + (y[:, None] - at_y) ** 2
        away[0] = 0.0  # a place that is no number has the first point
        assert nearest.tolist() == away.argmin(axis=1).tolist()
