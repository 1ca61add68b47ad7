"""What the networks see of the route: the same wherever the goal is, so that a clip looks as its parent's run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from foresee_learned.inputs import AHEAD_M, CHANNELS, SIDE_M, InputMaker

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run
from tests.support.small_street import STREET

ROUTE = CHANNELS.index("route")


class Looks:
    """Stands, and looks at the picture with its own goal and with a nearer one."""

    name, version = "looks", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        near = replace(mission, goal_s=mission.start_s + 20.0)
        self.makers = [InputMaker(one, vehicle) for one in (mission, near)]
        self.pictures: list[np.ndarray] = []
        self.raw = np.empty(0)

    def step(self, observation: Observation) -> Control:
        if not self.pictures and observation.views is not None:
            self.pictures = [maker.make(observation).birds_eye for maker in self.makers]
            self.raw = observation.views.birds_eye()
        return Control(0.0, 0.0, 1.0)


def test_the_route_looks_the_same_wherever_the_goal_is(tmp_path: Path) -> None:
    file = tmp_path / "beside.foresee"
    file.write_text(STREET.replace("end after 14 s anywhere", "end after 1 s anywhere"))
    driver = Looks()
    run(compile_test_case(load_test_case(str(file))), driver)
    far, near = driver.pictures
    assert (far == near).all()
    # It is the view's own route, but for the pixels at its edges.
    top, left = round((96 * 0.5 - AHEAD_M) / 0.5), round((96 * 0.5 - SIDE_M) / 0.5)
    rows, columns = far.shape[1:]
    seen = driver.raw[ROUTE, top : top + rows, left : left + columns]
    assert far[ROUTE].any()
    assert np.count_nonzero(far[ROUTE] != seen) <= np.count_nonzero(seen) / 3
