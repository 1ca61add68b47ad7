"""Vehicles parked at the kerb: obstacles on the parking strips, drawn from a seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.compile.placement.actor_checks import footprint
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.topology import Lane

STEP_M = 0.5
"""Candidate places are this far apart. Ours: drivers leave gaps of any size."""
GAP_M = 0.8
"""Free kerb between two that are parked. Ours: about the least that lets one pull out (RASt 06 counts 5.2 m to 5.7 m
of kerb for a car of 4.7 m; cited from memory)."""
CORNER_M = 8.0
"""Nobody is parked nearer to a junction. Ours, between 5 m (Germany, StVO section 12) and 10 m before a crossing with
a stop line in other countries; cited from memory."""
SLACK_M = 0.15
"""How far a parked vehicle may stand from the middle of its strip, to either side. Ours."""


class Kerb:
    """Draws parked vehicles near the ego's line."""

    def __init__(self, network: RoadNetwork, line: RouteLine, within_m: float, placed: Sequence[PlacedActor]) -> None:
        self._network = network
        self._near = shapely.LineString(line.points).buffer(within_m)
        shapely.prepare(self._near)
        self._boxes = [shapely.Polygon(footprint(actor)) for actor in placed]
        self._candidates: list[tuple[Lane, float]] | None = None

    def draw(self, name: str, spec: ModelSpec, rng: np.random.Generator) -> PlacedActor | None:
        """Park one, or None where there is no room for it."""
        places = self._places()
        for k in rng.permutation(len(places)):
            lane, at = places[int(k)]
            reach = spec.length_m / 2
            if not CORNER_M + reach <= at <= lane.line.length_m - CORNER_M - reach:
                continue
            x, y, heading = lane.line.at(at, float(rng.uniform(-SLACK_M, SLACK_M)))
            parked = PlacedActor(id=name, model=spec, control="static", x=x, y=y, heading_rad=heading, speed_mps=0.0)
            box = shapely.Polygon(footprint(parked))
            if all(box.distance(other) >= GAP_M for other in self._boxes):
                self._boxes.append(box)
                return parked
        return None

    def _places(self) -> list[tuple[Lane, float]]:
        if self._candidates is None:
            found = [
                (lane, at, *lane.line.at(at)[:2])
                for lane in self._network.lanes.values()
                if lane.parking
                for at in np.arange(CORNER_M, lane.line.length_m - CORNER_M, STEP_M).tolist()
            ]
            near = shapely.contains_xy(self._near, [f[2] for f in found], [f[3] for f in found])
            self._candidates = [(lane, at) for (lane, at, _, _), inside in zip(found, near, strict=True) if inside]
        return self._candidates
