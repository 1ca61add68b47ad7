"""Actors on paths, many at a time: one call moves them all, another finds where SUMO's vehicles see them."""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.bicycle import VehicleState
from foresee_dsl.kernels.path_following import (
    CELL_M,
    NO_LANE,
    OFF_ROAD,
    UNKNOWN,
    Follower,
    PathCell,
    Sight,
    advance,
    find_seen,
)
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.simulate.actors.moved_actors import PathActor, StandIn
from foresee_dsl.simulate.actors.path_followers import PathFollower
from foresee_dsl.simulate.actors.states import StateTable
from foresee_dsl.simulate.trace import STEP_S

_MATCH_M = 5.0
"""A lane this near to a place on the road is the lane there. Ours."""

_MOST_PATHS = 512
"""Paths of a network about which something is kept. Ours: those of some hundred test cases."""


class LanesUnderPaths:
    """The lanes under the paths of a network, looked up when they are first asked for.

    Attributes:
        ids: of the lanes, by number.
    """

    def __init__(self, network: RoadNetwork) -> None:
        """Know a network."""
        self._network = network
        self.ids = tuple(network.lanes)
        self._numbers = {lane: number for number, lane in enumerate(self.ids)}
        self._cells: dict[Points, Records] = {}

    def cells(self, follower: PathFollower) -> Records:
        """Return what is known of the cells under a path."""
        found = self._cells.get(follower.path)
        if found is None:
            if len(self._cells) >= _MOST_PATHS:
                self._cells.clear()
            count = round(follower.line.length_m / CELL_M) + 1
            found = self._cells[follower.path] = np.zeros(count, dtype_of(PathCell))
            found["lane"] = UNKNOWN
        return found

    def look_up(self, follower: PathFollower, cell: int) -> Records:
        """Find the lane under one of a path's cells; return all of them."""
        cells = self.cells(follower)
        x, y, heading = follower.line.at(cell * CELL_M)
        if not shapely.contains_xy(self._network.drivable_around(x, y), x, y):
            cells[cell] = OFF_ROAD, 0.0
        elif (near := self._network.nearest_lane(x, y, None, "car", _MATCH_M)) is None:
            cells[cell] = NO_LANE, heading
        else:
            cells[cell] = self._numbers[near.lane.id], near.lane.line.at(near.pos_m)[2]
        return cells


_KNOWN: WeakKeyDictionary[RoadNetwork, LanesUnderPaths] = WeakKeyDictionary()
"""The paths of a clip's children are the same."""


def lanes_under_paths(network: RoadNetwork) -> LanesUnderPaths:
    """Return what is known of a network; made once."""
    if network not in _KNOWN:
        _KNOWN[network] = LanesUnderPaths(network)
    return _KNOWN[network]


class PathGroup:
    """Actors that follow paths, until they leave.

    Args:
        actors: they have joined the table of states. rows: where. table: that of all actors. network: their roads.
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
        self._found: int | None = None  # what `find_seen` would return
        self._sights = np.zeros(len(actors), dtype_of(Sight))
        self._records = np.zeros(len(actors), dtype_of(Follower))
        self._seen_on = self._records["seen_on"]  # a view: looking it up costs more than using it
        self._seen_on[:], self._records["row"] = OFF_ROAD, rows
        for n, actor in enumerate(actors):
            actor.path_changed = self.gather
            if actor.stand_in.is_seen:
                self._seen_on[n] = NO_LANE
        self.gather()

    def gather(self) -> None:
        """Put the numbers of all followers into one array, and their paths; anew when one follows another path."""
        if not self._actors:
            return
        followers = [actor.follower for actor in self._actors]
        lines, bends = [one.vertices for one in followers], [one.bends for one in followers]
        cells = [self._lanes.cells(one) for one in followers]
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
        """Move everybody one step."""
        if not self._actors:
            return
        for actor in self._with_stops:
            actor.follower.stop_m = actor.red_light()
        records, sights = self._records, self._sights
        self._found = advance(records, self._states, self._along, self._lines, self._bends, self._cells, sights, STEP_S)

    def show(self) -> None:
        """Let SUMO's vehicles see those on the road, or about to step on it, in the next step."""
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

    def settle(self) -> None:
        """After a step: tell SUMO the speeds of those that its vehicles see."""
        for stand_in in self._seen:
            stand_in.settle()

    def drop(self, actor: PathActor) -> None:
        """Leave one alone from now on."""
        actor.stand_in.hide()
        self._records["row"][self._actors.index(actor)] = -1
        self._seen = [stand_in for stand_in in self._seen if stand_in is not actor.stand_in]

    def _find(self) -> list[tuple[int, int, int, float, float, float, float, float]]:
        """Return the fields of what `find_seen` finds; `move` has done so already, but before the first frame."""
        found, self._found = self._found, None
        if found is None:
            found = find_seen(self._records, self._states, self._lines, self._cells, self._sights)
        while found:
            sights: list[tuple[int, int, int, float, float, float, float, float]] = self._sights[:found].tolist()
            n, lane, cell, *_ = sights[-1]
            if lane != UNKNOWN:
                return sights
            known = self._lanes.look_up(self._actors[n].follower, cell)
            self._cells[self._records["cells_begin"][n] + cell] = known[cell]
            found = find_seen(self._records, self._states, self._lines, self._cells, self._sights)
        return []
