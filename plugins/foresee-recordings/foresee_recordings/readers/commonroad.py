"""Reads CommonRoad scenarios (XML, versions 2018b and 2020a): obstacles with trajectories, traffic lights, lanelets.

The format: CommonRoad, "XML file format" of 2018b and 2020a (commonroad.in.tum.de). A position is that of the
obstacle's own frame, in which its shape lies; the footprint's centre is therefore the shape's centre, turned by the
orientation.
"""

from __future__ import annotations

import io
import math
from collections import Counter
from pathlib import Path
from typing import ClassVar
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import children_of, open_packed
from foresee_recordings.maps.commonroad import Lanelets
from foresee_recordings.maps.network import network_of
from foresee_recordings.maps.roads_file import roads_of_file
from foresee_recordings.readers.commonroad_numbers import Footprint, State, footprint_of, state_of
from foresee_recordings.readers.commonroad_signals import TrafficLight, signal_tracks
from foresee_recordings.readers.track_samples import Samples, check_any, name_for, source_hash, wanted
from foresee_recordings.reading import Request
from foresee_recordings.recording import RecordedMap, Recording, RecordingError, Track

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
"""Our class for each of CommonRoad's types. `unknown` depends on the size; other types are left out."""
_VEHICLE_M = 2.5
"""Smallest length of an obstacle of unknown type that counts as a car, m. Ours: the shortest cars (smart: 2.5 m)."""
_OF_UNKNOWN_TYPE = "moving obstacles of unknown type are cars from a length of 2.5 m on, otherwise pedestrians"
_OBSTACLES = ("obstacle", "staticObstacle", "dynamicObstacle")
_LEFT_OUT = {
    "environmentObstacle": "buildings and other obstacles of the surroundings",
    "phantomObstacle": "phantom obstacles",
    "planningProblem": "planning problems (the start and goal of a planner, not recorded traffic)",
}


class CommonRoad:
    """The reader of CommonRoad's XML."""

    what: ClassVar[str] = "CommonRoad XML, 2018b and 2020a, with its lanelets"

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is of this format."""
        return path.suffix == ".xml" and b"<commonRoad" in head

    def read(self, request: Request) -> Recording:
        """Read a scenario.

        Raises:
            RecordingError: the file is not of this format, is damaged, or exceeds a limit.
        """
        path = request.path
        digest = source_hash(path)
        scenario = _Scenario(request, _step_of(path))
        for element in children_of(path, "commonRoad", _WHAT, RecordingError):
            try:
                scenario.take(element)
            except ValueError as err:
                place = f"<{element.tag} id={element.get('id', '')!r}>"
                raise RecordingError(f"{path}: {place}: {err}") from err
        tracks = scenario.tracks()
        check_any(request, tracks)
        ends = (min(t.time_s[0] for t in tracks), max(t.time_s[-1] for t in tracks))
        stop_lines = scenario.lanelets.stop_lines()
        return Recording(
            name=name_for(path.stem),
            source=path,
            sha256=digest,
            format="commonroad",
            tracks=tracks,
            signals=signal_tracks(scenario.lights, stop_lines, scenario.step_s, ends),
            roads=scenario.roads(),
            left_out=+scenario.left_out,
            notes=tuple(scenario.notes),
        )


class _Scenario:
    """Everything of a scenario that is kept while its file is read."""

    def __init__(self, request: Request, step_s: float) -> None:
        self.request, self.step_s = request, step_s
        self.lanelets = Lanelets()
        self.lights: list[TrafficLight] = []
        self.left_out: Counter[str] = Counter()
        self.notes: dict[str, None] = {}
        self._tracks: list[Track] = []
        self._static: list[tuple[str, str, Footprint, State]] = []

    def take(self, element: Element) -> None:
        """Take one element below the root.

        Raises:
            ValueError: it lacks a part, or a number of it is not a number.
        """
        if element.tag in _OBSTACLES:
            self._take_obstacle(element)
        elif element.tag == "trafficLight":
            self.lights.append(TrafficLight.of(element))
        elif element.tag in _LEFT_OUT:
            self.left_out[_LEFT_OUT[element.tag]] += 1
        else:
            self.lanelets.take(element)

    def tracks(self) -> tuple[Track, ...]:
        """Return all tracks. Static obstacles stay from the beginning to the end of the recording."""
        request = self.request
        times = [time for track in self._tracks for time in (track.time_s[0], track.time_s[-1])]
        for id_, kind, footprint, state in self._static:
            samples = Samples()
            for time_s in sorted({min(times), max(times)}) if times else [state.step * self.step_s]:
                if request.begins_s <= time_s <= request.ends_s:
                    samples.add(time_s, *footprint.centre_at(state), state.heading, 0.0)
            track = samples.track(id_, kind, footprint.size_m, self.left_out)
            if track is not None:
                self._tracks.append(track)
        return tuple(self._tracks)

    def roads(self) -> RecordedMap | None:
        """Return the roads: from the file that the request names, otherwise from the lanelets."""
        if self.request.map_file is not None:
            return roads_of_file(self.request.map_file)
        lanes = self.lanelets.lane_map()
        return network_of(lanes) if lanes.lanes else None

    def _take_obstacle(self, element: Element) -> None:
        id_ = element.get("id", "")
        if not wanted(self.request, id_):
            return
        type_ = (element.findtext("type") or "unknown").strip()
        shape, start = element.find("shape"), element.find("initialState")
        if shape is None or start is None:
            raise ValueError("it has no <shape> or no <initialState>")
        footprint = footprint_of(shape)
        static = element.tag == "staticObstacle" or (element.findtext("role") or "").strip() == "static"
        kind = self._kind(type_, footprint, static=static)
        if kind is None:
            self.left_out[f"obstacles of the type {type_}"] += 1
        elif static:
            self._take_static(id_, kind, footprint, state_of(start))
        else:
            self._take_moving(element, id_, kind, footprint, start)

    def _kind(self, type_: str, footprint: Footprint, *, static: bool) -> str | None:
        if type_ != "unknown":
            return _KINDS.get(type_)
        if static:
            return "obstacle"
        self.notes[_OF_UNKNOWN_TYPE] = None
        return "car" if footprint.size_m[0] >= _VEHICLE_M else "pedestrian"

    def _take_static(self, id_: str, kind: str, footprint: Footprint, state: State | None) -> None:
        if state is None:
            self.left_out["obstacles without a position"] += 1
            return
        self._static.append((id_, kind, footprint, state))

    def _take_moving(self, element: Element, id_: str, kind: str, footprint: Footprint, start: Element) -> None:
        self._count_lost(element)
        samples, request = Samples(), self.request
        for part in (start, *element.iterfind("trajectory/state")):
            state = state_of(part)
            if state is None:
                self.left_out["states without a position or a time"] += 1
                continue
            if state.uncertain:
                self.notes["of positions, directions and speeds that are ranges, the middle is taken"] = None
            if math.isnan(state.heading) or math.isnan(state.speed):
                self.notes["directions and speeds that the file lacks are those of the motion"] = None
            time_s = state.step * self.step_s
            if request.begins_s <= time_s <= request.ends_s:
                samples.add(time_s, *footprint.centre_at(state), state.heading, state.speed)
        if not len(samples):
            return
        track = samples.track(id_, kind, footprint.size_m, self.left_out)
        if track is not None:
            self._tracks.append(track)

    def _count_lost(self, element: Element) -> None:
        occupancies = len(element.findall("occupancySet/occupancy"))
        if occupancies:
            self.left_out["occupancies (predicted areas in place of positions)"] += occupancies
        signals = len(element.findall("signalSeries/signalState")) + (element.find("initialSignalState") is not None)
        if signals:
            self.left_out["states of a vehicle's lights and horn"] += signals


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
