"""Checks of the objects on and beside a network's roads: each needs room there, and no rule may forbid the last way on
from a road."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from foresee_dsl.errors import MessageText, subject
from foresee_dsl.helps import Help, HelpText, in_block, leave_out, one_of, remove, rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.checks.overlaps import called, check_overlaps
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import written
from foresee_dsl.language.streets import layout
from foresee_dsl.language.streets.layout import BACK, STRAIGHT_RAD, Directed, Ring, lanes_of
from foresee_dsl.language.streets.lines import at, number, wrapped, xy

FROM_END_M = 15.0
"""Minimum distance of an object from the ends of its road, m (ours: the junctions of wide roads reach 12 m)."""
ISLAND_END_M = 30.0
"""Minimum distance of a zebra crossing with an island from the road's ends, m: the length of the island's tapers, and
half the width of the crossing."""
MOUTH_M = 8.0
"""Minimum length of the ring between the carriageways of two arms of a roundabout, m (ours: two corners of 5 m that
meet the ring at an angle)."""
RAMP_TURN_RAD = math.radians(100)
"""Largest angle by which a ramp may turn between its junction and its edge, rad (ours: for a larger turn the author
must write the ramp's points, with `via`)."""

NamedJunction = m.Junction | m.Roundabout | m.Zebra | m.Bump | m.OnRamp | m.OffRamp
"""Statements whose name is also the name of a junction."""
Ramp = m.OnRamp | m.OffRamp


def check_touching(
    collector: Collector, junction: str, named: Sequence[tuple[m.Item, str, str]], network: m.Network
) -> None:
    """Report names that do not belong to a road at a junction; `named` holds (item, field, name) for each use."""
    ends = [(item.name, item.start, item.end) for item in network.all(m.Road)]
    ends += [(item.name, item.junction, item.junction) for item in network.body if isinstance(item, Ramp)]
    touching = [name for name, *of_road in ends if junction in of_road]
    for item, field, name in named:
        if name not in touching:
            exists = any(name == other for other, *_ in ends)
            touches_not = "road '" + subject(name) + f"' does not touch '{junction}'"
            message = touches_not if exists else "unknown road '" + subject(name) + "'"
            collector.add(item, field, "FS041", message, did_you_mean(name, touching))


class Streets:
    """Checks all statements of a network except its junctions, roads and buildings."""

    def __init__(self, collector: Collector, network: m.Network, junctions: Sequence[str]) -> None:
        self._collector, self._network, self._junctions = collector, network, junctions
        self._rings = layout.rings_of(network)
        self._edges = {edge.id: edge for edge in layout.directed(network, self._rings)}
        self._ramps = [item.name for item in network.body if isinstance(item, Ramp)]
        self._placed = True
        """True if every object has a place on its road, so that their distances can be checked."""

    def check(self) -> None:
        """Report every error."""
        for item in self._network.body:
            match item:
                case m.Roundabout():
                    self._roundabout(item, self._rings[item.name])
                case m.OnRamp() | m.OffRamp():
                    self._ramp(item)
                case m.Zebra() | m.Bump():
                    self._on_road(item)
                case m.LaneEnd():
                    self._directed(item)
                case m.BusStop():
                    self._stop(item)
                case m.LaneTurns():
                    self._lane_turns(item)
                case m.BannedTurn():
                    self._banned(item)
                case _:
                    pass
        self._derived_names()
        self._forbidden_ways()
        self._twice()
        if self._placed:
            check_overlaps(self._collector, self._edges.values(), self._network.body)

    def _add(self, item: m.Item, field: str, message: MessageText, help: HelpText, code: str = "FS270") -> None:
        self._placed = False
        self._collector.add(item, field, code, message, help)

    # ---- roundabouts ------------------------------------------------------------------------------------------------

    def _roundabout(self, item: m.Roundabout, ring: Ring) -> None:
        named = [(item, f"crossings.{k}", name) for k, name in enumerate(item.crossings or ())]
        check_touching(self._collector, item.name, named, self._network)
        if len(ring.arms) < 2:
            roads = f"only {ring.arms[0][1].name} ends" if ring.arms else "no road ends"
            help: HelpText = "add " + write(f"road west from west_end to {item.name}") + " and another, or "
            help = "at least two roads must end there: " + help + remove("remove it")
            self._add(item, "name", f"{roads} at the roundabout '{item.name}'", help)
            return
        for (angle, road), (following, other) in pairwise((*ring.arms, ring.arms[0])):
            between = (following - angle) % math.tau
            half = (_width(road) + _width(other)) / 2
            room = ring.radius_m * min(between or math.tau, math.pi) - half
            if road is not other and room < MOUTH_M:
                last = max(road, other, key=self._network.body.index)
                first = other if last is road else road
                wider = math.ceil((half + MOUTH_M) / max(between, 0.01))
                message = (
                    f"the arms '{first.name}' and '{last.name}' of '{item.name}' overlap: "
                    f"the angle between them is {math.degrees(between):.0f} degrees"
                )
                fits = in_block(f"radius {wider} m", item.name) + ", or " if wider <= 200 else ""
                end = "end" if last.end == item.name else "start"
                self._add(last, end, message, fits + "lead one of them in from another side with " + write("via"))
        for _, road in ring.arms:
            far = road.end if road.start == item.name else road.start
            points = [(road, f"via.{k}", point) for k, point in enumerate(road.via)]
            others = [j for j in self._network.all(m.Junction) if j.name == far]
            for where, field, point in (*points, *((road, "start", j.at) for j in others)):
                if math.dist((number(point.x), number(point.y)), ring.centre) < ring.outer_m + FROM_END_M:
                    message = f"road '{road.name}' has a point inside the roundabout or too close to it, '{item.name}'"
                    help = f"move the point: it must be at least {ring.outer_m + FROM_END_M:.0f} m from the centre"
                    self._add(where, field, message, help)

    # ---- what has its place on a road -------------------------------------------------------------------------------

    def _on_road(self, item: m.Zebra | m.Bump) -> None:
        edge = self._edges.get(item.road)
        if edge is None or edge.back:
            self._unknown_edge(item, "road", item.road, [e.id for e in self._edges.values() if not e.back])
            return
        word = "zebra crossing" if isinstance(item, m.Zebra) else "bump"
        further = number(item.length, layout.BUMP_M) if isinstance(item, m.Bump) else 0.0
        self._range(item, edge, FROM_END_M, edge.length_m - FROM_END_M - further, word)
        if isinstance(item, m.Bump):
            limit = edge.road.speed
            if isinstance(item.speed, m.Quantity) and item.speed.si >= number(limit, 50 / 3.6):
                message = f"the speed limit of the bump is not lower than that of its road '{edge.road.name}'"
                half = m.Quantity(value=(item.speed.value / 2).normalize(), unit=item.speed.unit)
                self._add(item, "speed", message, "use less, such as " + write(written(half)))
            return
        if not number(edge.road.sidewalk):
            help = in_block("sidewalk 2 m", edge.road.name, "road")
            message = f"no pedestrian can reach '{item.name}': road '{item.road}' has no sidewalk"
            self._add(item, "road", message, help)
        if item.island is None:
            return
        if not lanes_of(edge.road)[1]:
            message = f"'{item.road}' has only one direction, so it has no place for an island between directions"
            self._add(item, "island", message, leave_out("island"))
        elif number(item.island) > number(edge.road.median):
            at_m = number(item.at)
            if min(at_m, edge.length_m - at_m) < ISLAND_END_M:
                message = f"the road has no room to widen for this island within {ISLAND_END_M:.0f} m of its end"
                median = f"median {number(item.island):g} m"
                help = "put it farther away, or " + in_block(median, edge.road.name, "road")
                self._add(item, "at", message, help)

    def _directed(self, item: m.LaneEnd) -> None:
        edge = self._edges.get(item.edge)
        if edge is None:
            self._unknown_edge(item, "edge", item.edge, list(self._edges))
            return
        self._range(item, edge, FROM_END_M, edge.length_m - FROM_END_M, "lane's end")

    def _stop(self, item: m.BusStop) -> None:
        """Report a bus stop whose edge does not exist or ends before it, or whose bay does not fit."""
        edge = self._edges.get(item.road)
        if edge is None:
            self._unknown_edge(item, "road", item.road, list(self._edges))
        elif item.bay is not None:
            self._bay(item, edge)
        elif abs(number(item.at)) > edge.length_m:
            self._range(item, edge, FROM_END_M, edge.length_m - FROM_END_M, "stop")

    def _bay(self, item: m.BusStop, edge: Directed) -> None:
        """Report a bus stop's bay that does not fit on its edge, or that is beside a cycle lane."""
        begin_m, end_m = layout.bay_of(item, edge.length_m)
        low, high = FROM_END_M, edge.length_m - FROM_END_M
        if isinstance(item.at, m.Quantity) and (begin_m < low or end_m > high):
            long_m, at_m = end_m - begin_m, item.at.si % edge.length_m if item.at.si < 0 else item.at.si
            first, last = math.ceil(low + at_m - begin_m), math.floor(high - (end_m - at_m))
            message = (
                f"there is no room for this bay at {written(item.at)}: with its tapers it is {long_m:.0f} m long, "
                f"and '{edge.id}' is {edge.length_m:.0f} m long"
            )
            short = "use a longer road, a shorter stop, or " + leave_out("bay")
            fitting = first <= last
            self._add(item, "at" if fitting else "bay", message, _lengths(first, last) if fitting else short)
        if edge.road.cycle_lane is not None:
            message = f"'{edge.id}' has a cycle lane between this bay and its lanes, which a bus cannot cross"
            track = f"make it a cycle track of road '{edge.road.name}', which lies behind the bay, or "
            self._add(item, "bay", message, track + leave_out("bay"))

    def _ramp(self, item: m.OnRamp | m.OffRamp) -> None:
        if item.junction not in self._junctions:
            self._unknown_junction(item)
            self._placed = False
        edge = self._edges.get(item.edge)
        if edge is None:
            self._unknown_edge(item, "edge", item.edge, list(self._edges))
            return
        length = number(item.length, layout.RAMP_LANE_M)
        low, high = FROM_END_M, edge.length_m - FROM_END_M
        if length > high - low:
            field = "length" if item.length is not None else "at"
            message = (
                f"the extra lane of '{item.name}' is {length:g} m long, but '{edge.id}' is only "
                f"{edge.length_m:.0f} m long"
            )
            fits = write(f"{max(high - low, 20) // 2:.0f} m")
            self._add(item, field, message, "use a length of " + fits + ", or a longer road")
            return
        joins = isinstance(item, m.OnRamp)
        self._range(item, edge, low if joins else low + length, high - length if joins else high, "ramp")
        if not self._placed or item.via:
            return
        junction = next((j for j in self._network.all(m.Junction) if j.name == item.junction), None)
        if junction is not None and isinstance(item.at, m.Quantity):
            self._bend(item, edge, junction)

    def _bend(self, item: m.OnRamp | m.OffRamp, edge: Directed, junction: m.Junction) -> None:
        """Report a ramp that would have to turn round on its way from or to its junction."""
        (x, y), heading = at(edge.line, number(item.at))
        jx, jy = xy(junction.at)
        way = math.atan2(y - jy, x - jx) if isinstance(item, m.OnRamp) else math.atan2(jy - y, jx - x)
        right = math.sin(heading) * (jx - x) - math.cos(heading) * (jy - y)
        if abs(wrapped(way - heading)) > RAMP_TURN_RAD or right < 0:
            verb = "before" if isinstance(item, m.OnRamp) else "behind"
            side = "on the left of" if right < 0 else "not " + verb
            message = f"'{junction.name}' lies {side} the place on '{edge.id}' where '{item.name}' meets it"
            help = f"a ramp meets its edge on the right: put the junction to the right and {verb} it, or add "
            self._add(item, "junction", message, help + write("via"))

    def _range(self, item: layout.OnRoads, edge: Directed, low: float, high: float, word: str) -> None:
        at_m = number(item.at)
        if low <= at_m <= high or not isinstance(item.at, m.Quantity):
            return
        long = f"'{edge.id}' is {edge.length_m:.0f} m long"
        if high < low:
            self._add(item, "at", f"{long}, which is too short for a {word}", "use a longer road")
        else:
            message = f"there is no place for a {word} at {at_m:g} m: {long}"
            self._add(item, "at", message, _lengths(math.ceil(low), math.floor(high)))

    def _unknown_junction(self, item: m.OnRamp | m.OffRamp | m.BannedTurn) -> None:
        listed = "junctions are " + one_of(self._junctions, wrong=item.junction)
        help = did_you_mean(item.junction, self._junctions) or listed
        self._collector.add(item, "junction", "FS040", "unknown junction '" + subject(item.junction) + "'", help)

    def _unknown_edge(self, item: m.Item, field: str, name: str, roads: Sequence[str]) -> None:
        help: HelpText
        if name in self._ramps:
            message = "'" + subject(name) + "' is a ramp, not a road"
            help = "roads are " + one_of(roads)
        elif name.removesuffix(BACK) in roads and name.endswith(BACK):
            message = "'" + subject(name) + "' is one direction of a road"
            help = "it lies across both directions: write " + write(name.removesuffix(BACK))
            if name.removesuffix(BACK) in self._edges and not isinstance(item, m.Zebra | m.Bump):
                message = "road '" + subject(name.removesuffix(BACK)) + "' has only one direction"
                help = "write " + write(name.removesuffix(BACK))
        else:
            message, help = "unknown road '" + subject(name) + "'", did_you_mean(name, roads)
            help = help or ("" if isinstance(item, Ramp) else "roads are " + one_of(roads, wrong=name))
            if not help and isinstance(item, Ramp):
                help = "a ramp joins or leaves a road: add " + write("road a1 from a to b { lanes 2; speed 130 km/h }")
        self._add(item, field, message, help, "FS041")

    # ---- rules of turns ---------------------------------------------------------------------------------------------

    def _lane_turns(self, item: m.LaneTurns) -> None:
        edge = self._edges.get(item.edge)
        if edge is None:
            if item.edge not in self._ramps:
                self._unknown_edge(item, "edge", item.edge, [*self._edges, *self._ramps])
            return
        count = lanes_of(edge.road)[1 if edge.back else 0] - sum(isinstance(c.item, m.LaneEnd) for c in edge.cuts)
        if number(item.lane) > count:
            lanes, help = "one lane", "its number is " + write("1")
            if count > 1:
                lanes = f"{count} lanes"
                help = "lanes are counted from the right, from " + write("1") + " to " + write(str(count))
            self._collector.add(item, "lane", "FS270", f"'{item.edge}' has {lanes} at its end", help)
        exits = self._exits(edge)
        for k, turn in enumerate(item.turns):
            if exits and turn not in exits.values() and edge.end in self._plain_junctions:
                message = f"no way leads {turn} from '{item.edge}' over '{edge.end}'"
                turns = one_of(dict.fromkeys(exits.values()), " or ")
                self._collector.add(item, f"turns.{k}", "FS270", message, "from there, ways lead " + turns)

    @property
    def _plain_junctions(self) -> frozenset[str]:
        return frozenset(junction.name for junction in self._network.all(m.Junction))

    def _banned(self, item: m.BannedTurn) -> None:
        if item.junction in self._rings:
            part = f"{item.junction}_{item.roads[0]}"
            message = f"'{item.junction}' is a roundabout, where `forbid` has no meaning"
            why = "vehicles may leave a roundabout at every arm, so " + remove("remove it") + "; "
            self._collector.add(item, "junction", "FS270", message, why + write(part) + " is one of its junctions")
            return
        if item.junction not in self._plain_junctions:
            self._unknown_junction(item)
            return
        named: list[tuple[m.Item, str, str]] = [(item, f"roads.{k}", name) for k, name in enumerate(item.roads)]
        check_touching(self._collector, item.junction, named, self._network)
        for k, road in enumerate(item.roads):
            edge = self._into(road, item.junction)
            ways = [e for e in (self._edges.get(road), self._edges.get(road + BACK)) if e is not None]
            if edge is None and ways and all(item.junction == e.start for e in ways):
                message = f"no vehicle comes from '{road}' to '{item.junction}': the road only leads away from there"
                self._collector.add(item, f"roads.{k}", "FS270", message, remove("leave it out"))

    def _into(self, road: str, junction: str) -> Directed | None:
        ways = (self._edges.get(road), self._edges.get(road + BACK))
        return next((edge for edge in ways if edge is not None and edge.end == junction), None)

    def _exits(self, edge: Directed) -> Mapping[str, m.Turn]:
        """Return the edges that begin where an edge ends, each with the turn that leads to it, computed from the
        directions of the edges' lines."""
        (x0, y0), (x1, y1) = edge.line[-2:]
        heading = math.atan2(y1 - y0, x1 - x0)
        turns: dict[str, m.Turn] = {}
        for other in self._edges.values():
            if other.start == edge.end and other.road is not edge.road:
                (x2, y2), (x3, y3) = other.line[:2]
                off = wrapped(math.atan2(y3 - y2, x3 - x2) - heading)
                turns[other.id] = "straight" if abs(off) <= STRAIGHT_RAD else ("left" if off > 0 else "right")
        return turns

    def _round(self, edge: Directed) -> set[m.Turn]:
        """Return the way on from an edge that ends where no other road begins: back along its own road, if at all."""
        return {"back"} if any(other.start == edge.end for other in self._edges.values()) else set()

    def _forbidden_ways(self) -> None:
        """Report the rule that bans the last way on from a road."""
        left: dict[str, set[m.Turn]] = {}
        for item in self._network.body:
            if not isinstance(item, m.BannedTurn):
                continue
            for k, road in enumerate(item.roads):
                edge = self._into(road, item.junction)
                leaves = any(isinstance(r, m.OnRamp) and r.junction == item.junction for r in self._network.body)
                if edge is None or leaves:
                    continue
                ways = left.setdefault(edge.id, set(self._exits(edge).values()) or self._round(edge))
                if ways and not ways - {item.turn}:
                    message = f"this bans the last way from '{road}' over '{item.junction}'"
                    help: HelpText = (
                        remove("remove it") + f", so that {item.turn} stays allowed, or make '{road}' one-way"
                    )
                    self._collector.add(item, f"roads.{k}", "FS270", message, help)
                elif ways and item.turn not in ways and item.turn != "back":
                    message = f"no way leads {item.turn} from '{road}' over '{item.junction}' anyway"
                    help = "from there, ways lead " + one_of(sorted(ways), " or ")
                    help = "vehicles can only turn round there: " + remove("remove it") if ways == {"back"} else help
                    self._collector.add(item, "turn", "FS270", message, help)
                ways.discard(item.turn)

    # ---- names ------------------------------------------------------------------------------------------------------

    def _twice(self) -> None:
        seen: set[tuple[str, str, float]] = set()
        for item in self._network.body:
            if isinstance(item, m.LaneTurns | m.LaneEnd):
                key = (item.kind, item.edge, number(item.lane))
                if key in seen:
                    message = f"lane {number(item.lane):g} of '{item.edge}' has two statements of this kind"
                    self._collector.add(item, "lane", "FS013", message, remove("keep one of the two"))
                seen.add(key)

    def _derived_names(self) -> None:
        """Report names that also belong to a part of another statement."""
        parts: dict[str, m.Item] = {node: ring.item for ring in self._rings.values() for node in ring.nodes}
        parts |= {
            cut.node: cut.item
            for edge in self._edges.values()
            for cut in edge.cuts
            if cut.node != getattr(cut.item, "name", "")
        }
        for item in self._network.body:
            if isinstance(item, NamedJunction) and item.name in parts:
                message = f"'{item.name}' is also the name of a junction of {called(parts[item.name])}"
                self._collector.add(item, "name", "FS030", message, rename("give it another name"))


def _lengths(first: int, last: int) -> Help:
    """Return the help to use a length between two others, m."""
    return "use a length from " + write(f"{first} m") + " to " + write(f"{last} m")


def _width(road: m.Road) -> float:
    """Return the width of a road's carriageways with its median, m."""
    strips = ("bus_lane", "cycle_lane", "shoulder", "parking", "cycle_track")
    side = sum(number(getattr(road, strip)) for strip in strips)
    lanes = lanes_of(road)
    return sum(lanes) * number(road.lane_width, 3.3) + number(road.median) + side * sum(n > 0 for n in lanes)
