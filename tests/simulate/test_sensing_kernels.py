"""The sensors' compiled loops: the same answers as the plain functions that they were made of."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from foresee_dsl.simulate.sensing import STANDARD
from foresee_dsl.simulate.sensing.objects import ObjectList
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from tests.support.worlds import ADULT, COMPACT, CRATE, VAN

HOUSES = (((10.0, 8.0), (30.0, 8.0), (30.0, 30.0), (10.0, 30.0)), ((-40.0, -30.0), (-15.0, -30.0), (-15.0, -9.0)))
PLAIN = """
import pickle, sys, warnings
from foresee_dsl.kernels import object_list
assert not hasattr(object_list.measured, "py_func")  # not compiled
warnings.simplefilter("ignore", RuntimeWarning)  # hashes overflow: meant so
from tests.simulate.test_sensing_kernels import street
objects = street()[0]
sys.stdout.buffer.write(pickle.dumps([objects.measure(*scan) for scan in pickle.load(sys.stdin.buffer)]))
"""


def street() -> tuple[ObjectList, np.ndarray]:
    """Thirty road users around the ego, with houses, and where they are."""
    rng = np.random.default_rng(7)
    models = [COMPACT, VAN, ADULT, COMPACT, CRATE] * 6
    bodies = Bodies.of(models)
    states = np.column_stack(
        [rng.uniform(-60, 60, 30), rng.uniform(-40, 40, 30), rng.uniform(-4, 4, 30), rng.uniform(0, 14, 30)]
    )
    states[4] = math.nan  # not there
    return ObjectList(bodies, [f"a{k}" for k in range(30)], Sight(bodies, HOUSES), STANDARD, 1), states


def test_compiled_they_measure_what_the_plain_functions_do() -> None:
    """Those run in Python here, where an index out of range would be an error."""
    scans = [(frame, (0.5 * frame, 0.2, 0.01), (0.5 * frame, 0.25, 0.013), street()[1]) for frame in range(-4, 20, 4)]
    objects = street()[0]
    lists = [objects.measure(*scan) for scan in scans]
    done = subprocess.run(
        [sys.executable, "-c", PLAIN],
        input=pickle.dumps(scans),
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        check=True,
    )
    assert min(len(seen) for seen in lists) > 3
    for one, other in zip(lists, pickle.loads(done.stdout), strict=True):
        assert [(a.track, a.kind) for a in one] == [(a.track, a.kind) for a in other]
        for a, b in zip(one, other, strict=True):
            values = [(s.x, s.y, s.heading_rad, s.speed_mps, s.length_m, s.width_m) for s in (a, b)]
            assert values[0] == pytest.approx(values[1], abs=1e-9)


@pytest.mark.parametrize("broken", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("column", range(4))
def test_a_state_that_is_no_number_does_no_harm_to_the_others(broken: float, column: int) -> None:
    objects, states = street()
    seen = objects.measure(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), states)
    nearest = int(np.nanargmin(np.hypot(states[:, 0] - seen[-1].x, states[:, 1] - seen[-1].y)))
    bad = states.copy()
    bad[nearest, column] = broken
    again = street()[0].measure(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), bad)
    kept = {(a.x, a.y) for a in seen} & {(a.x, a.y) for a in again}
    assert len(kept) >= len(seen) - 1
