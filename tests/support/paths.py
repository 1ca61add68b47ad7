"""An actor on a path without a scene around it."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.bicycle import VehicleState
from foresee_dsl.kernels.path_following import PathCell, SightRecord, advance
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.simulate.actors.dynamics import BicycleState
from foresee_dsl.simulate.actors.path_followers import PathFollower


class Walk(PathFollower):
    """Follows a path on its own, as `PathGroup` moves many."""

    def step(self, dt: float) -> BicycleState:
        """Move on by `dt` seconds and return where it is then."""
        x, y, heading = self.pose()
        states = np.array([(x, y, heading, self.speed_mps, 0.0, 0.0, 0.0)], dtype_of(VehicleState))
        cells, sights = np.zeros(1, dtype_of(PathCell)), np.zeros(1, dtype_of(SightRecord))
        self.record["cells_end"] = 1
        advance(self.record, states, np.zeros(1), self.vertices, self.bends, cells, sights, dt)
        return BicycleState(*states[0].tolist())
