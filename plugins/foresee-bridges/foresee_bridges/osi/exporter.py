"""Export of runs as OSI traces: a message for each frame."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from foresee_bridges.osi.library import Numbers, interface_version, osi3, set_time, set_vector, set_yaw, version_text
from foresee_bridges.osi.objects import MovingActor, add_stationary, fill_host, is_stationary, numbers_of
from foresee_bridges.osi.roads import add_map
from foresee_bridges.osi.signals import Lights
from foresee_dsl.campaign.driving import case_name
from foresee_dsl.compile.bundle import Scene, SumoBundle
from foresee_dsl.exchange.outcome import ExchangeError, Imported, import_together
from foresee_dsl.exchange.protocol import Tell
from foresee_dsl.exchange.recorded import runs
from foresee_dsl.simulate.sensing.weather import FOG_VISIBILITY_M, RAIN_MM_H
from foresee_dsl.simulate.trace import Trace, X

CODES = {"ground-truth": "gt", "sensor-view": "sv", "traffic-update": "tu"}
"""OSI's short codes of the messages in file names (OSI specification, naming conventions)."""
_DATE, _CREATED = "20200101T000000Z", "2020-01-01T00:00:00Z"
"""Date in file names and metadata, which need one; a constant, so that the same run gives the same bytes."""
_RAIN_MM_H = ((0.1, "NONE"), (0.5, "VERY_LIGHT"), (1.9, "LIGHT"), (8.1, "MODERATE"), (34.0, "HEAVY"),
              (149.0, "VERY_HEAVY"), (math.inf, "EXTREME"))  # fmt: skip
"""Upper limits of OSI's classes of precipitation, mm/h (osi_environment.proto)."""
_VISIBILITY_M = ((50.0, "DENSE"), (200.0, "THICK"), (1000.0, "LIGHT"), (2000.0, "MIST"), (4000.0, "POOR_VISIBILITY"),
                 (10_000.0, "MODERATE_VISIBILITY"), (40_000.0, "GOOD_VISIBILITY"),
                 (math.inf, "EXCELLENT_VISIBILITY"))  # fmt: skip
"""Upper limits of OSI's classes of fog, m of visibility (osi_environment.proto)."""


def run(
    addresses: Sequence[str],
    *,
    out: Path,
    what: str = "ground-truth",
    file_format: str = "osi",
    driver: str = "",
    seed: int | None = None,
    allow_outside: bool = True,
    tell: Tell = lambda _: None,
) -> Imported:
    """Write a trace of each test case, clip or mutant, which is run once for this.

    Args:
        addresses: each `FILE` or `FILE::CASE`.
        out: the folder. what: one of `CODES`. file_format: `osi` or `mcap`.
        driver, seed: driver and seed of the runs; by default those that a mutant records, otherwise `pdm` and 0.

    Raises:
        ExchangeError: a package is missing, or `out` cannot be written.
        InputError, CompileError, DriverError: a test case cannot be run.
    """
    osi3()
    taken: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    notes = []

    def write(folder: Path) -> Imported:
        for run in runs(addresses, driver=driver, seed=seed, allow_outside=allow_outside, tell=tell):
            trace = run.result.trace
            frames = Frames(run.bundle, trace)
            name = f"{_DATE}_{CODES[what]}_{version_text()}_{_protobuf()}_{trace.frames}_{case_name(run.case)}"
            _write(folder / f"{name}.{file_format}", frames, what)
            taken.update(frames.taken(what))
            left_out.update(frames.left_out(what))
            notes.append(run.note)
        return Imported((), len(addresses), dict(sorted(taken.items())), +left_out, tuple(notes))

    return import_together(out, write)


class Frames:
    """The messages of a run, frame by frame.

    The map (lanes, boundaries, buildings) is in the first message only; it does not change.
    """

    def __init__(self, bundle: SumoBundle, trace: Trace) -> None:
        self._bundle, self._trace, self.numbers = bundle, trace, Numbers()
        actors = bundle.scene.actors
        self._ids = numbers_of(actors, self.numbers)
        self._moving = {
            k: MovingActor(actor, self._ids[k]) for k, actor in enumerate(actors) if not is_stationary(actor)
        }
        self._lights = Lights(bundle, self.numbers)

    def messages(self, what: str) -> Iterator[Any]:
        """Yield the messages of all frames: of `ground-truth`, `sensor-view` or `traffic-update`."""
        make: Callable[[int], Any] = {
            "ground-truth": self.ground_truth, "sensor-view": self.sensor_view, "traffic-update": self.traffic_update,
        }[what]  # fmt: skip
        return (make(frame) for frame in range(self._trace.frames))

    def ground_truth(self, frame: int) -> Any:  # noqa: ANN401
        """Return the ground truth of a frame."""
        message = osi3().osi_groundtruth_pb2.GroundTruth()
        self._begin(message, frame)
        message.host_vehicle_id.value = self._ids[0]
        message.map_reference = self._bundle.name
        _add_weather(message.environmental_conditions, self._bundle.scene)
        rows, lanes = self._trace.states[frame], self._trace.lanes[frame]
        for k, actor in enumerate(self._bundle.scene.actors):
            if math.isnan(rows[k, X]):
                continue
            if k not in self._moving:
                add_stationary(message, actor, rows[k], self._ids[k])
                continue
            lane = self.numbers.of("lane", self._trace.lane_ids[lanes[k]]) if lanes[k] >= 0 else None
            message.moving_object.append(self._moving[k].fill(rows[k], lane))
        message.traffic_light.extend(self._lights.at(self._trace, frame))
        if frame == 0:
            add_map(message, self._bundle.network, self._bundle.net_file, self.numbers)
        return message

    def sensor_view(self, frame: int) -> Any:  # noqa: ANN401
        """Return the view of an ideal sensor in the middle of the rear axle: the whole ground truth."""
        message = osi3().osi_sensorview_pb2.SensorView()
        self._begin(message, frame)
        message.sensor_id.value = self.numbers.of("sensor", "all")
        message.host_vehicle_id.value = self._ids[0]
        set_vector(message.mounting_position.position, 0.0, 0.0)
        set_yaw(message.mounting_position.orientation, 0.0)
        self._fill_host(message.host_vehicle_data, frame)
        message.global_ground_truth.CopyFrom(self.ground_truth(frame))
        return message

    def traffic_update(self, frame: int) -> Any:  # noqa: ANN401
        """Return the update that the ego, as a traffic participant, would send."""
        message = osi3().osi_trafficupdate_pb2.TrafficUpdate()
        self._begin(message, frame)
        message.update.append(self._moving[0].fill(self._trace.states[frame, 0], None))
        self._fill_host(message.internal_state.add(), frame)
        return message

    def _begin(self, message: Any, frame: int) -> None:  # noqa: ANN401
        message.version.CopyFrom(interface_version())
        set_time(message.timestamp, float(self._trace.time_s[frame]))

    def _fill_host(self, message: Any, frame: int) -> None:  # noqa: ANN401
        self._begin(message, frame)
        fill_host(message, self._bundle.scene.ego.model, self._trace.states[frame, 0], self._ids[0])

    def taken(self, what: str) -> Counter[str]:
        """Return the numbers of things in the trace, by description."""
        actors, network = self._bundle.scene.actors, self._bundle.network
        if what == "traffic-update":
            return Counter({"frames": self._trace.frames, f"of class {actors[0].model.kind}": 1})
        kinds = Counter(f"of class {actor.model.kind}" for actor in actors)
        return kinds + Counter(
            {"frames": self._trace.frames, "lanes": len(network.lanes), "buildings": len(network.buildings)}
        )

    def left_out(self, what: str) -> Counter[str]:
        """Return the numbers of things that OSI cannot express or that are not written, by description."""
        network, scene = self._bundle.network, self._bundle.scene
        lost = Counter({"triggers": len(scene.whens), "expectations": len(scene.expects)})
        if what == "traffic-update":
            return lost + Counter({"other actors and the map": 1})
        with_limits = sum("car" in lane.kinds for lane in network.lanes.values())
        return lost + Counter(
            {
                "speed limits of lanes (OSI has them as signs only)": with_limits,
                "corners where sidewalks meet": len(network.walking_areas),
                "bus stops": len(network.bus_stops),
                "slippery patches": len(scene.slippery),
            }
        )


def _add_weather(conditions: Any, scene: Scene) -> None:  # noqa: ANN401
    kinds = osi3().osi_environment_pb2.EnvironmentalConditions
    rain_mm_h = RAIN_MM_H * scene.rain
    visibility_m = FOG_VISIBILITY_M / scene.fog if scene.fog else math.inf
    rain = next(word for limit, word in _RAIN_MM_H if rain_mm_h < limit or limit == math.inf)
    fog = next(word for limit, word in _VISIBILITY_M if visibility_m < limit or limit == math.inf)
    conditions.precipitation = getattr(kinds, f"PRECIPITATION_{rain}")
    conditions.fog = getattr(kinds, f"FOG_{fog}")


def _protobuf() -> str:
    import google.protobuf

    return str(google.protobuf.__version__)


def _write(file: Path, frames: Frames, what: str) -> None:
    from osi_utilities import MultiTraceWriter, SingleTraceWriter

    topic = "".join(word.capitalize() for word in what.split("-"))
    messages = frames.messages(what)
    if file.suffix == ".osi":
        writer: Any = SingleTraceWriter()
        is_open = writer.open(file)
    else:
        writer = MultiTraceWriter()
        is_open = writer.open(file, _metadata())
        first = next(messages)
        channel = {
            "net.asam.osi.trace.channel.osi_version": version_text(),
            "net.asam.osi.trace.channel.protobuf_version": _protobuf(),
            "net.asam.osi.trace.channel.description": f"{what} of a run of foresee-dsl",
        }
        writer.add_channel(topic, type(first), channel)
        is_open = is_open and writer.write_message(first, topic)
    done = is_open and all(writer.write_message(message, topic) for message in messages)
    writer.close()
    if not done:
        raise ExchangeError(f"{file.name} could not be written")


def _metadata() -> dict[str, str]:
    """Return the file's metadata that OSI requires or recommends, with a constant date."""
    version, protobuf = version_text(), _protobuf()
    return {
        "version": version,
        "min_osi_version": version,
        "max_osi_version": version,
        "min_protobuf_version": protobuf,
        "max_protobuf_version": protobuf,
        "zero_time": _CREATED,
        "creation_time": _CREATED,
        "description": "a simulated run",
        "authors": "foresee-dsl",
        "data_sources": "SUMO",
    }
