"""Reads CommonRoad scenarios (XML, versions 2018b and 2020a): obstacles with trajectories, traffic lights, lanelets.

The format: CommonRoad, "XML file format" of 2018b and 2020a (commonroad.in.tum.de). A position is that of the
obstacle's own frame, in which its shape lies; the footprint's centre is therefore the shape's centre, turned by the
orientation.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import children_of, open_packed
from foresee_recordings.maps.commonroad import Lanelets
from foresee_recordings.maps.network import network_of, usual_speed
from foresee_recordings.maps.signals import SignalCycle
from foresee_recordings.readers.classes import Shape, kind_by_size
from foresee_recordings.readers.commonroad.numbers import Footprint, State, footprint_of, number, state_of
from foresee_recordings.readers.samples import Samples
from foresee_recordings.reading import Request
from foresee_recordings.recording import RecordedMap, Recording, RecordingError, SignalTrack

_WHAT = "a CommonRoad scenario"
_ROOT_BYTES = 1 << 16
"""Number of bytes in which the root's tag must end. Ours: with all attributes it takes less than 1 kB."""
_KINDS = {
    "car": "car",
    "taxi": "car",
    "priorityVehicle": "car",
    "parkedVehicle": "car",
    "truck": "truck",
    "bus": "bus",
    "motorcycle": "motorcycle",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "constructionZone": "obstacle",
    "pillar": "obstacle",
}
"""Our class for each of CommonRoad's types. Other types are left out; the size decides about `unknown`."""
_COLOURS = {"red": "red", "redYellow": "red", "yellow": "amber", "green": "green", "inactive": "off"}
"""Our colour for each of CommonRoad's. `redYellow` is red: vehicles may not drive yet."""
_OBSTACLES = ("obstacle", "staticObstacle", "dynamicObstacle")
_LEFT_OUT = {
    "environmentObstacle": "buildings and other obstacles of the surroundings",
    "phantomObstacle": "phantom obstacles",
    "planningProblem": "planning problems (the start and goal of a planner, not recorded traffic)",
}


class CommonRoadReader:
    """The reader of CommonRoad's XML."""

    what: ClassVar[str] = "CommonRoad XML, 2018b and 2020a, with its lanelets"
    numbers: ClassVar[tuple[str, ...]] = ()

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is of this format."""
        return path.suffix == ".xml" and b"<commonRoad" in head

    def read(self, request: Request) -> Recording:
        """Read a scenario.

        Raises:
            RecordingError: the file is not of this format, is damaged, or exceeds a limit.
        """
        path = request.path
        scenario = _Scenario(request, _step_of(path))
        for element in children_of(path, "commonRoad", _WHAT, RecordingError):
            try:
                scenario.take(element)
            except ValueError as err:
                place = f"<{element.tag} id={element.get('id', '')!r}>"
                raise RecordingError(f"{path}: {place}: {err}") from err
        return scenario.recording()


class _Scenario:
    """Everything of a scenario that is kept while its file is read."""

    def __init__(self, request: Request, step_s: float) -> None:
        self.lanelets = Lanelets()
        self._request, self._step_s = request, step_s
        self._samples = Samples(request)
        self._cycles: dict[str, SignalCycle] = {}
        self._footprints: dict[str, Footprint] = {}
        self._shapes: dict[str, Shape] = {}
        self._static: dict[str, State] = {}
        self._ends = (math.inf, -math.inf)

    def take(self, element: Element) -> None:
        """Take one element below the root.

        Raises:
            ValueError: it lacks a part, or a number of it is not a number.
        """
        if element.tag in _OBSTACLES:
            self._take_obstacle(element)
        elif element.tag == "trafficLight":
            cycle = _cycle_of(element, self._step_s)
            if cycle is not None:
                self._cycles[element.get("id", "")] = cycle
        elif element.tag in _LEFT_OUT:
            self._samples.left_out[_LEFT_OUT[element.tag]] += 1
        else:
            self.lanelets.take(element)

    def recording(self) -> Recording:
        """Return the recording. Static obstacles stay from its beginning to its end."""
        ends = self._ends
        for id_, state in self._static.items():
            times = ends if ends[0] < ends[1] else (state.step * self._step_s, (state.step + 1) * self._step_s)
            for time_s in times:
                if self._samples.wants(id_, time_s):
                    self._samples.add(id_, time_s, state.x, state.y, state.heading, 0.0)
        tracks = self._samples.recording(
            "commonroad", self._shapes, offset_m=lambda actor, _: self._footprints[actor].centre
        )
        places = self.lanelets.stop_lines()
        signals = _signal_tracks(self._cycles, places, tracks.begins_s, tracks.ends_s)
        return replace(tracks, signals=signals, roads=tracks.roads or self._roads(tracks))

    def _roads(self, recording: Recording) -> RecordedMap | None:
        lanes = self.lanelets.lane_map()
        return network_of(lanes, usual_speed(recording.tracks), cycles=self._cycles) if lanes.lanes else None

    def _take_obstacle(self, element: Element) -> None:
        id_ = element.get("id", "")
        type_ = (element.findtext("type") or "unknown").strip()
        shape, start = element.find("shape"), element.find("initialState")
        if shape is None or start is None:
            raise ValueError("it has no <shape> or no <initialState>")
        footprint = footprint_of(shape)
        static = element.tag == "staticObstacle" or (element.findtext("role") or "").strip() == "static"
        kind = self._kind(type_, footprint, static=static)
        if kind is None:
            self._samples.left_out[f"obstacles of the type {type_}"] += 1
            return
        self._samples.take_room()
        self._footprints[id_], self._shapes[id_] = footprint, Shape(kind, *footprint.size_m)
        if static:
            self._take_static(id_, state_of(start))
        else:
            self._take_moving(id_, element, start)

    def _kind(self, type_: str, footprint: Footprint, *, static: bool) -> str | None:
        if type_ != "unknown":
            return _KINDS.get(type_)
        if static:
            return "obstacle"
        self._samples.note("Moving obstacles of unknown type have the class of their size.")
        return kind_by_size(*footprint.size_m)

    def _take_static(self, id_: str, state: State | None) -> None:
        if state is None:
            self._samples.left_out["obstacles without a position"] += 1
        else:
            self._static[id_] = state

    def _take_moving(self, id_: str, element: Element, start: Element) -> None:
        self._count_lost(element)
        samples = self._samples
        for part in (start, *element.iterfind("trajectory/state")):
            state = state_of(part)
            if state is None:
                samples.left_out["states without a position or a time"] += 1
                continue
            if state.uncertain:
                samples.note("Of positions, directions and speeds that are ranges, the middle is taken.")
            time_s = state.step * self._step_s
            if samples.wants(id_, time_s) and samples.add(id_, time_s, state.x, state.y, state.heading, state.speed):
                self._ends = min(self._ends[0], time_s), max(self._ends[1], time_s)

    def _count_lost(self, element: Element) -> None:
        occupancies = len(element.findall("occupancySet/occupancy"))
        signals = len(element.findall("signalSeries/signalState")) + (element.find("initialSignalState") is not None)
        self._samples.left_out["occupancies (predicted areas in place of positions)"] += occupancies
        self._samples.left_out["states of a vehicle's lights and horn"] += signals


def _step_of(path: Path) -> float:
    """Return the length of a time step, s, from the root's attributes.

    Raises:
        RecordingError: the file is not XML, or has no such attribute.
    """
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import iterparse

    try:
        with open_packed(path, RecordingError) as file:
            head = file.read(_ROOT_BYTES)
        _, root = next(iter(iterparse(io.BytesIO(head), events=("start",))))
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err
    except DefusedXmlException as err:
        raise RecordingError(f"{path} declares entities, which are not read: write them out") from err
    except (ParseError, StopIteration, ValueError, LookupError) as err:
        raise RecordingError(f"{path} is not {_WHAT}, or a damaged one: {err or 'it is empty'}") from err
    text = root.get("timeStepSize", "")
    try:
        step_s = float(text)
    except ValueError:
        step_s = math.nan
    if not 0.0 < step_s < math.inf:
        raise RecordingError(f"{path}: the attribute timeStepSize of <{root.tag}> is {text!r}, not a number of seconds")
    return step_s


def _cycle_of(element: Element, step_s: float) -> SignalCycle | None:
    """Return the cycle of a `<trafficLight>`; None if it has none.

    Raises:
        ValueError: a duration or a colour is not one.
    """
    if (element.findtext("active") or "true").strip() in ("false", "0"):
        return SignalCycle(((step_s, "off"),))
    colours = []
    for part in element.iterfind("cycle/cycleElement"):
        duration, colour = number(part, "duration"), (part.findtext("color") or "").strip()
        if not 0.0 < duration < math.inf or colour not in _COLOURS:
            raise ValueError(f"its cycle has {duration:g} time steps of {colour!r}")
        colours.append((duration * step_s, _COLOURS[colour]))
    offset = number(element, "cycle/timeOffset")
    return SignalCycle(tuple(colours), 0.0 if math.isnan(offset) else offset * step_s) if colours else None


def _signal_tracks(
    cycles: Mapping[str, SignalCycle], places: Mapping[str, tuple[float, float]], begin_s: float, end_s: float
) -> tuple[SignalTrack, ...]:
    """Return the colours of all lights from one time to another; `places`: their stop lines, m."""
    tracks = []
    for id_, cycle in cycles.items():
        times, colours = zip(*cycle.changes(begin_s, end_s), strict=True)
        tracks.append(SignalTrack(id_, times, colours, places.get(id_)))
    return tuple(tracks)
