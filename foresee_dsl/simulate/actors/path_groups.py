"""Moves all actors on paths with one kernel call, and finds with another where SUMO's vehicles see them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import cached, per_network
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.bicycle import VehicleState
from foresee_dsl.kernels.path_following import (
    CELL_M,
    NO_LANE,
    OFF_ROAD,
    UNKNOWN,
    ActorOnPath,
    PathCell,
    SightRecord,
    advance,
    find_seen,
)
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.simulate.actors.moved_actors import PathActor, StandIn
from foresee_dsl.simulate.actors.path_followers import PathFollower
from foresee_dsl.simulate.actors.states import StateTable
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import BodyMotion

_NEAREST_LANE_M = 5.0
"""Largest distance from a point at which the nearest lane counts as the lane there, m. Ours."""

_MOST_PATHS = 512
"""Maximum number of cached paths per network. Ours: the paths of some hundred test cases."""


class LanesUnderPaths:
    """The lanes under the paths of a network, each looked up at its first use.

    Attributes:
        ids: ids of the lanes, by number.
    """

    def __init__(self, network: RoadNetwork) -> None:
        """Begin with an empty cache for a network."""
        self._network = network
        self.ids = tuple(network.lanes)
        self._numbers = {lane: number for number, lane in enumerate(self.ids)}
        self._cells: dict[Points, Records] = {}

    def cells(self, follower: PathFollower) -> Records:
        """Return the cells under a path. The lane of a cell that was not looked up yet is `UNKNOWN`."""

        def unknown() -> Records:
            cells = np.zeros(round(follower.line.length_m / CELL_M) + 1, dtype_of(PathCell))
            cells["lane"] = UNKNOWN
            return cells

        return cached(self._cells, follower.path, _MOST_PATHS, unknown)

    def look_up(self, follower: PathFollower, cell: int) -> Records:
        """Look up the lane under one cell of a path; return all cells of that path."""
        cells = self.cells(follower)
        x, y, heading = follower.line.at(cell * CELL_M)
        if not shapely.contains_xy(self._network.drivable_around(x, y), x, y):
            cells[cell] = OFF_ROAD, 0.0
        elif (near := self._network.nearest_lane(x, y, None, "car", _NEAREST_LANE_M)) is None:
            cells[cell] = NO_LANE, heading
        else:
            cells[cell] = self._numbers[near.lane.id], near.lane.line.at(near.pos_m)[2]
        return cells


lanes_under_paths = per_network(LanesUnderPaths)
"""Return the lanes under the paths of a network."""


class PathGroup:
    """The actors of a run that follow paths; an actor that leaves the world leaves the group.

    Args:
        actors: the followers; each must have joined the state table. rows: the numbers of their rows in that table.
            table: the state table of all actors of the run. network: the roads.
    """

    def __init__(
        self,
        actors: Sequence[PathActor],
        rows: Sequence[int],
        table: StateTable,
        network: RoadNetwork,
    ) -> None:
        self._actors, self._along = tuple(actors), table.along
        self._states = table.states.reshape(-1).view(dtype_of(VehicleState))
        self._lanes = lanes_under_paths(network)
        self._with_stops = [actor for actor in actors if actor.stops]
        self._seen: list[StandIn] = []
        # What `find_seen` returns for the next step, if `move` has computed it already.
        self._sight_count: int | None = None
        self._sights = np.zeros(len(actors), dtype_of(SightRecord))
        self._records = np.zeros(len(actors), dtype_of(ActorOnPath))
        self._seen_on = self._records["seen_on"]  # a view, kept because numpy is slow at looking up a record's field
        self._seen_on[:], self._records["row"] = OFF_ROAD, rows
        for n, actor in enumerate(actors):
            actor.path_changed = self.gather
            if actor.stand_in.is_seen:
                self._seen_on[n] = NO_LANE
        self.gather()

    def __len__(self) -> int:
        """Return the number of actors that have followed paths, also of those that have left."""
        return len(self._actors)

    def gather(self) -> None:
        """Collect the states and paths of all followers in arrays; to be called again when a follower changes
        its path.
        """
        if not self._actors:
            return
        followers = [actor.follower for actor in self._actors]
        lines, bends = [item.vertices for item in followers], [item.bends for item in followers]
        cells = [self._lanes.cells(item) for item in followers]
        self._lines, self._bends, self._cells = np.concatenate(lines), np.concatenate(bends), np.concatenate(cells)
        for n, (actor, follower) in enumerate(zip(self._actors, followers, strict=True)):
            record = self._records[n : n + 1]
            if follower.record.base is not self._records:
                row, seen_on = int(record["row"][0]), int(record["seen_on"][0])
                record[:] = follower.record
                record["row"], record["seen_on"] = row, seen_on
                record["length"], record["width"] = actor.length, actor.width
                follower.keep_in(record)
        for name, parts in (("line", lines), ("bends", bends), ("cells", cells)):
            ends = np.cumsum([len(part) for part in parts])
            self._records[f"{name}_begin"], self._records[f"{name}_end"] = ends - [len(p) for p in parts], ends

    def move(self) -> None:
        """Move all actors one step."""
        if not self._actors:
            return
        for actor in self._with_stops:
            actor.follower.stop_m = actor.red_light()
        records, sights = self._records, self._sights
        self._sight_count = advance(
            records, self._states, self._along, self._lines, self._bends, self._cells, sights, STEP_S
        )

    def show(self) -> None:
        """Show the vehicles of SUMO, for the next step, each follower that is on the road or about to step on it."""
        if not self._actors:
            return
        sights = self._find()
        self._seen = []
        for n, lane, _, x, y, heading, length, speed in sights:
            stand_in = self._actors[n].stand_in
            if lane == OFF_ROAD:
                stand_in.hide()
            else:
                stand_in.place(self._lanes.ids[lane] if lane >= 0 else "", (x, y, heading), length, speed)
                self._seen.append(stand_in)
            self._seen_on[n] = lane

    def motions(self) -> list[BodyMotion]:
        """Return the speeds that the stand-ins must have in SUMO after the next step."""
        return [motion for stand_in in self._seen for motion in stand_in.motions()]

    def drop(self, actor: PathActor) -> None:
        """Stop moving an actor, and stop showing it to SUMO."""
        actor.stand_in.hide()
        self._records["row"][self._actors.index(actor)] = -1
        self._seen = [stand_in for stand_in in self._seen if stand_in is not actor.stand_in]

    def _find(self) -> list[tuple[int, int, int, float, float, float, float, float]]:
        """Return the records that say where SUMO's vehicles see the followers in the next step; `move` has computed
        them already, except before the first frame.
        """
        count, self._sight_count = self._sight_count, None
        if count is None:
            count = find_seen(self._records, self._states, self._lines, self._cells, self._sights)
        while count:
            sights: list[tuple[int, int, int, float, float, float, float, float]] = self._sights[:count].tolist()
            n, lane, cell, *_ = sights[-1]
            if lane != UNKNOWN:
                return sights
            cells = self._lanes.look_up(self._actors[n].follower, cell)
            self._cells[self._records["cells_begin"][n] + cell] = cells[cell]
            count = find_seen(self._records, self._states, self._lines, self._cells, self._sights)
        return []
