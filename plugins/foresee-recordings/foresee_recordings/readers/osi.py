"""ASAM OSI ground truth: binary traces (`.osi`), MCAP files, and omega-prime (MCAP or Parquet with a map inside)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

from foresee_recordings.readers import osi_files
from foresee_recordings.readers.classes import Shape, have, kind_by_size, shape_of
from foresee_recordings.readers.osi_lights import Lights
from foresee_recordings.readers.parquet import rows_of
from foresee_recordings.readers.samples import Samples
from foresee_recordings.reading import Request
from foresee_recordings.recording import RecordedMap, Recording

_VEHICLES: Mapping[str, str] = {
    word: kind
    for kind, words in {
        "car": "CAR SMALL_CAR COMPACT_CAR MEDIUM_CAR LUXURY_CAR",
        "van": "DELIVERY_VAN VAN",
        "truck": "HEAVY_TRUCK SEMITRACTOR SEMITRAILER TRAILER WORK_MACHINE",
        "bus": "BUS TRAM",
        "motorcycle": "MOTORBIKE MOTORCYCLE",
        "bicycle": "BICYCLE STANDUP_SCOOTER MICROMOBILITY_DEVICE",
        "pedestrian": "WHEELCHAIR",
    }.items()
    for word in words.split()
}
"""Our kinds of OSI's types of vehicles (osi_object.proto); others, such as trains, are left out."""
_OBSTACLES = ("PYLON", "CONSTRUCTION_SITE_ELEMENT", "BARRIER")
"""OSI's types of stationary objects that may stand on a road."""
_OURS = "net.foresee-dsl"
"""Type of the references with which `foresee export osi` names its actors."""
_TEXTS = ("idx", "type", "subtype")
_NUMBERS = ("total_nanos", "x", "y", "yaw", "vel_x", "vel_y", "length", "width")
"""Columns of omega-prime's Parquet files."""


class OsiReader:
    """ASAM OSI ground truth."""

    what: ClassVar[str] = "ASAM OSI: traces of GroundTruth or SensorView (.osi, .mcap), omega-prime (.mcap, .parquet)"
    numbers: ClassVar[tuple[str, ...]] = ()

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is MCAP, a Parquet file of omega-prime, or has OSI's suffix."""
        if head.startswith(osi_files.MCAP_MAGIC) or path.name.endswith((".osi", ".osi.gz")):
            return True
        return path.suffix == ".parquet" and head.startswith(b"PAR1") and not path.name.startswith("scenario_")

    def read(self, request: Request) -> Recording:
        """Read the messages of the request: moving objects, obstacles, traffic lights, and the map if there is one."""
        samples = Samples(request)
        if osi_files.is_parquet(request.path):
            return _read_parquet(request, samples)
        trace = osi_files.Trace(request.path)
        objects, lights = _Objects(samples), Lights(samples.take_room)
        for message in trace.ground_truths():
            time_s = message.timestamp.seconds + message.timestamp.nanos / 1e9
            objects.add(message, time_s)
            lights.add(message, time_s, within=samples.covers(time_s))
        samples.left_out.update(trace.left_out)
        roads = None if trace.opendrive is None else RecordedMap(trace.opendrive, ".xodr")
        for sentence in objects.notes():
            samples.note(sentence)
        return samples.recording("osi", objects.shapes, signals=lights.tracks(), roads=roads)


class _Objects:
    """The objects of ground truths on their way into samples."""

    def __init__(self, samples: Samples) -> None:
        self._samples = samples
        self.shapes: dict[str, Shape] = {}
        self._sized_anew: set[str] = set()
        self._guessed: Counter[str] = Counter()
        self._host = ""

    def add(self, message: Any, time_s: float) -> None:  # noqa: ANN401  a message without types
        """Add the objects of a ground truth."""
        if not self._host and message.HasField("host_vehicle_id"):
            host = message.host_vehicle_id.value
            self._host = next((_name(thing) for thing in message.moving_object if thing.id.value == host), "")
        for thing in message.moving_object:
            self._add(thing, time_s, _moving_kind(thing))
        for thing in message.stationary_object:
            kind = type(thing).Classification.Type.Name(thing.classification.type).removeprefix("TYPE_")
            self._add(thing, time_s, "obstacle" if kind in _OBSTACLES or _is_ours(thing) else "", moves=False)

    def _add(self, thing: Any, time_s: float, kind: str | None, *, moves: bool = True) -> None:  # noqa: ANN401
        actor, base = _name(thing), thing.base
        if not self._samples.wants(actor, time_s):
            return
        if kind == "":
            what = "moving objects that are not road traffic" if moves else "stationary objects beside the road"
            self._samples.left_out[f"samples of {what}"] += 1
            return
        speed = math.hypot(base.velocity.x, base.velocity.y) if moves and base.HasField("velocity") else math.nan
        heading = base.orientation.yaw if base.HasField("orientation") else math.nan
        if not moves:
            speed = 0.0
        if not self._samples.add(actor, time_s, base.position.x, base.position.y, heading, speed):
            return
        size = base.dimension.length, base.dimension.width
        if actor not in self.shapes:
            self.shapes[actor] = shape_of(kind or kind_by_size(*size), *size)
            if kind is None:
                self._guessed[self.shapes[actor].kind] += 1
        elif self.shapes[actor].sized and abs(self.shapes[actor].length_m - size[0]) > _SAME_SIZE_M:
            self._sized_anew.add(actor)

    def notes(self) -> Iterator[str]:
        """Yield what was guessed, in sentences."""
        if self._host:
            yield f"The host vehicle is {self._host}."
        if self._guessed:
            counts = ", ".join(f"{count} {kind}" for kind, count in self._guessed.items())
            yield f"Objects of unknown class have the class that their size suggests ({counts})."
        if unsized := sum(not shape.sized for shape in self.shapes.values()):
            yield f"{have(unsized, 'object')} no possible size: that which is usual for the class is used."
        if self._sized_anew:
            yield f"{have(len(self._sized_anew), 'object')} different sizes: the first one is used."


_SAME_SIZE_M = 0.1
"""Smaller changes of a size are ignored, m. Ours."""


def _name(thing: Any) -> str:  # noqa: ANN401
    """Return an object's id, or our name of it in a trace that we exported."""
    return str(thing.source_reference[0].identifier[1]) if _is_ours(thing) else str(thing.id.value)


def _is_ours(thing: Any) -> bool:  # noqa: ANN401
    references = thing.source_reference
    if len(references) != 1 or references[0].type != _OURS or len(references[0].identifier) < 2:
        return False
    return bool(references[0].identifier[0] == "actor")


def _moving_kind(thing: Any) -> str | None:  # noqa: ANN401
    """Return the kind of a moving object; empty if it is left out, None if its class is not known."""
    types = type(thing)
    if thing.type == types.TYPE_PEDESTRIAN:
        return "pedestrian"
    if thing.type == types.TYPE_ANIMAL:
        return ""
    if thing.type == types.TYPE_OTHER:
        return "obstacle"
    word = types.VehicleClassification.Type.Name(thing.vehicle_classification.type).removeprefix("TYPE_")
    if thing.type != types.TYPE_VEHICLE or word in ("UNKNOWN", "OTHER", "LAND_VEHICLE"):
        return None
    return _VEHICLES.get(word, "")


def _read_parquet(request: Request, samples: Samples) -> Recording:
    """Read a Parquet file of omega-prime: OSI's numbers of types, a row for each object and time."""
    shapes: dict[str, Shape] = {}
    moving = osi_files.osi_module().osi_object_pb2.MovingObject
    for actor, type_, subtype, nanos, x, y, yaw, vx, vy, length, width in rows_of(request.path, _TEXTS, _NUMBERS):
        if not samples.wants(actor, nanos * 1e-9):
            continue
        thing = moving()
        try:
            thing.type = int(float(type_))
            thing.vehicle_classification.type = max(int(float(subtype)), 0)
            kind = _moving_kind(thing)
        except ValueError:  # not a number, or not one of OSI
            kind = None
        if kind == "":
            samples.left_out["samples of moving objects that are not road traffic"] += 1
        elif samples.add(actor, nanos * 1e-9, x, y, yaw, math.hypot(vx, vy)) and actor not in shapes:
            shapes[actor] = shape_of(kind or kind_by_size(length, width), length, width)
    text = osi_files.opendrive_of_parquet(request.path)
    return samples.recording("osi", shapes, roads=None if text is None else RecordedMap(text, ".xodr"))
