"""The trace of a run: all actors at every frame, as numpy arrays; forecasts and clips are computed from it.

A file with a trace may come from someone else, so it is read without pickles and with a limit on the unpacked size.
`numpy.load` has no such limit: a file of 3 MB may unpack to 5 GB of zeros, and the header of an array may claim any
size, for which numpy allocates memory before it reads a byte.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import tokenize
import zipfile
import zlib
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray
from pydantic import TypeAdapter
from typing_extensions import TypedDict

from foresee_dsl.files import open_outside, replacing
from foresee_dsl.kernels.constants import STEP_S as STEP_S  # noqa: PLC0414 - users of traces import it from here
from foresee_dsl.limits import most, raised_by
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.trigger_record import DirectorRecord

_MOST_MEMBERS = 100
"""Maximum number of arrays in a file. Ours: the file of a trace has nine."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The compression methods that numpy writes."""


def read_arrays(path: Path | BinaryIO) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file by their names.

    Raises:
        ValueError: the file is not an `.npz` file, is damaged, or exceeds the limit `trace` when unpacked.
        OSError: the file cannot be read.
    """
    try:
        with _opened(path) as file, zipfile.ZipFile(file) as packed:
            members = packed.infolist()
            _check(members)
            return {member.filename.removesuffix(".npy"): _array(packed, member) for member in members}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OverflowError) as err:
        raise ValueError(str(err)) from err


def _opened(file: Path | BinaryIO) -> BinaryIO:
    return open_outside(file, "trace") if isinstance(file, Path) else file


def _check(members: list[zipfile.ZipInfo]) -> None:
    size, allowed = sum(member.file_size for member in members), most("trace") * 1e6
    if size > allowed:
        raise TooLargeError(
            f"it takes {size / 1e6:,.0f} MB when it is unpacked, more than {allowed / 1e6:,.0f} MB; "
            f"{raised_by('trace', size / 1e6)}"
        )
    if len(members) > _MOST_MEMBERS or any(member.compress_type not in _METHODS for member in members):
        raise ValueError("it is compressed with a method that files of traces do not use")


class TooLargeError(ValueError):
    """An array file would take more memory than the limit; the message names the option that allows more."""


def _array(packed: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with packed.open(member) as stream:
        shape, by_column, dtype = _head(stream)
        count = math.prod(shape)
        if dtype.hasobject or count * dtype.itemsize > member.file_size or min(shape, default=0) < 0:
            raise ValueError(f"its array {member.filename} does not have the size that the header of the array states")
        data = stream.read(count * dtype.itemsize + 1)  # zipfile never returns more than `file_size` bytes
    if len(data) != count * dtype.itemsize:
        raise ValueError(f"its array {member.filename} is cut off, or has too many bytes")
    return np.frombuffer(bytearray(data), dtype).reshape(shape, order="F" if by_column else "C")


def _head(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(stream)
    read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read is None:
        raise ValueError(f"one of its arrays has the unsupported format {version}")
    try:
        shape, by_column, dtype = read(stream)
    except (SyntaxError, tokenize.TokenError) as err:  # numpy 2 parses the header as a Python literal
        raise ValueError("the header of an array is damaged") from err
    return shape, by_column, dtype


FIELDS = ("x", "y", "heading", "speed", "acceleration", "yaw_rate", "steer")
"""Columns of `Trace.states`: m, m, rad (counter-clockwise from east), m/s, m/s^2, rad/s, rad (front wheels)."""

X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE, STEER = range(7)
WAYPOINT_M = 2.0
"""Spacing of `Trace.waypoints`, m."""
FORMAT = 1


_DAMAGED = (KeyError, TypeError, AttributeError, ValueError, RecursionError)
"""Exceptions that reading a file may raise if it is not a trace, or is damaged."""


@dataclass(frozen=True)
class ActorInfo:
    """The constant data of an actor during a run.

    Attributes:
        id: `ego`, the actor's name, or `others_03`. kind: the model's class (car, van, ..., pedestrian, obstacle).
        front_m: distance from the centre of the footprint to the front bumper (half the length).
        route: edge ids from the edge at the first frame to the route's end; empty for path-followers and obstacles.
        path: points (m) of a path-follower, empty for the others.
        cruise_mps: speed where nothing hinders it.
    """

    id: str
    kind: str
    model: str
    length_m: float
    width_m: float
    wheelbase_m: float
    route: tuple[str, ...] = ()
    path: tuple[tuple[float, float], ...] = ()
    cruise_mps: float = 0.0

    @property
    def front_m(self) -> float:
        """Distance from the centre of the footprint to its front, m."""
        return self.length_m / 2


@dataclass(frozen=True)
class Event:
    """A change of an actor's behaviour: a trigger's action that takes effect, an arrival, a collision.

    `what`: `starts`, `ignores`, `meets`, `changes_speed`, `changes_lane`, `stops`, `trigger`, `arrived`,
    `collision`, ...; `detail` can be written as JSON.
    """

    time_s: float
    actor: str
    what: str
    detail: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Trace:
    """One recorded run of T frames, A actors and S signals.

    Attributes:
        time_s: [T] float64, s, from 0 in steps of 0.05; frame 0 is the state at the beginning.
        states: [T, A, 7] float64, columns `FIELDS`; x, y is the centre of the footprint; NaN where the actor is
            absent. Actor 0 is the ego.
        lanes: [T, A] int32, index into `lane_ids`, -1 off the lanes (path-followers, obstacles, off the road).
        along: [T, A] float64, length along the path of a path-follower, m; NaN for the others.
        stages: [T, S] int16, index of each signal's stage in `signal_stages[signal]`. elapsed: [T, S] float64, time
            since that stage began, s.
        waypoints: [W, 2] float64, waypoints of the ego's route, m, 2 m apart.
    """

    time_s: NDArray[np.float64]
    states: NDArray[np.float64]
    lanes: NDArray[np.int32]
    along: NDArray[np.float64]
    stages: NDArray[np.int16]
    elapsed: NDArray[np.float64]
    waypoints: NDArray[np.float64]
    actors: tuple[ActorInfo, ...]
    lane_ids: tuple[str, ...]
    signals: tuple[str, ...]
    signal_stages: tuple[tuple[str, ...], ...]
    events: tuple[Event, ...] = ()
    meta: dict[str, Any] = field(default_factory=dict)
    """Facts about the run: test_case, driver, driver_version, seed, verdict, scenario (name), meaning (hash of what was
    run), ..."""
    director: DirectorRecord | None = None
    """The states of the run's triggers and orders; None in a file of a version that did not write them."""

    _ARRAYS = ("time_s", "states", "lanes", "along", "stages", "elapsed", "waypoints")

    def part(self, first: int, beyond: int | None = None) -> Trace:
        """Return the frames from `first` up to (not including) `beyond` as a trace; its time begins at 0."""
        names = ("time_s", "states", "lanes", "along", "stages", "elapsed")
        cut = {name: getattr(self, name)[first:beyond] for name in names}
        return replace(self, **cut | {"time_s": cut["time_s"] - cut["time_s"][:1]})

    @cached_property
    def on_tracks(self) -> frozenset[str]:
        """The ids of the actors that follow recorded tracks, at least at the run's beginning."""
        return frozenset(event.actor for event in self.events if event.what == "track")

    @property
    def frames(self) -> int:
        """The number of frames, T."""
        return len(self.time_s)

    @property
    def duration_s(self) -> float:
        """Return the time of the last frame, s."""
        return float(self.time_s[-1]) if self.frames else 0.0

    def boxes(self, actor: int) -> NDArray[np.float64]:
        """Return the footprints of an actor, [T, 5]: x, y, heading, length, width."""
        info = self.actors[actor]
        size = np.broadcast_to((info.length_m, info.width_m), (self.frames, 2))
        return np.column_stack([self.states[:, actor][:, [X, Y, HEADING]], size])

    def index(self, actor: str) -> int:
        """Return the column of an actor by its id; raises `KeyError` without such an actor."""
        for k, info in enumerate(self.actors):
            if info.id == actor:
                return k
        raise KeyError(actor)

    def frame_at(self, time_s: float) -> int:
        """Return the frame nearest to a time, within the run."""
        return int(np.clip(round(time_s / STEP_S), 0, self.frames - 1))

    @cached_property
    @Part.RECORDING.measured
    def digest(self) -> str:
        """Return a hash of all data except `meta` and `director`; equal runs have equal digests."""
        h = hashlib.sha256()
        for name in self._ARRAYS:
            array = np.ascontiguousarray(getattr(self, name))
            h.update(f"{name}{array.shape}{array.dtype.str}".encode())
            h.update(array.tobytes())
        h.update(json.dumps(self._header(meta=False), sort_keys=True).encode())
        return "sha256:" + h.hexdigest()[:16]

    @Part.RECORDING.measured
    def save(self, path: Path) -> None:
        """Write the trace as a compressed `.npz`: the arrays, and JSON texts: `director`, and `header` with the rest.

        The file is written whole or not at all.
        """
        with replacing(path) as temporary:
            temporary.write_bytes(self.packed())

    @Part.RECORDING.measured
    def packed(self) -> bytes:
        """Return the content of the file that `save` writes."""
        buffer = io.BytesIO()
        arrays: dict[str, Any] = {name: getattr(self, name) for name in self._ARRAYS}
        texts = {"header": json.dumps(self._header(meta=True), sort_keys=True).encode()}
        if self.director is not None:
            texts["director"] = self.director.as_json()
        arrays |= {name: np.frombuffer(text, np.uint8) for name, text in texts.items()}
        np.savez_compressed(buffer, **arrays)
        return buffer.getvalue()

    @classmethod
    def load(cls, path: Path | BinaryIO) -> Trace:
        """Read a trace from its file.

        Raises:
            ValueError: the file is not a trace, has another format version, or exceeds the memory limit `trace`.
        """
        name = path if isinstance(path, Path) else "this"
        try:
            data = read_arrays(path)
            header = json.loads(data["header"].tobytes())
            written = header["format"]
        except TooLargeError as err:
            raise ValueError(f"{name} is too large to be read: {err}") from err
        except _DAMAGED as err:
            raise ValueError(_not_a_trace(name)) from err
        if written != FORMAT:
            raise ValueError(f"{name} has trace format {written!s:.20}, this version reads {FORMAT}")
        try:
            arrays = {key: data[key] for key in cls._ARRAYS}
            checked = _header_type().validate_python(header)
            trace = cls(
                **arrays,
                actors=checked["actors"],
                lane_ids=checked["lane_ids"],
                signals=checked["signals"],
                signal_stages=checked["signal_stages"],
                events=checked["events"],
                meta=checked["meta"],
                director=DirectorRecord.of_json(data["director"].tobytes()) if "director" in data else None,
            )
            trace._check_shapes()
        except _DAMAGED as err:
            raise ValueError(_not_a_trace(name)) from err
        return trace

    def _check_shapes(self) -> None:
        """Raise a `ValueError` if the arrays do not fit each other: the file is damaged or was not written by us."""
        frames, actors, signals = self.frames, len(self.actors), len(self.signals)
        expected: dict[str, tuple[str, tuple[int, ...]]] = {
            "time_s": ("f8", (frames,)),
            "states": ("f8", (frames, actors, len(FIELDS))),
            "lanes": ("i4", (frames, actors)),
            "along": ("f8", (frames, actors)),
            "stages": ("i2", (frames, signals)),
            "elapsed": ("f8", (frames, signals)),
            "waypoints": ("f8", (len(self.waypoints), 2)),
        }
        for name, (dtype, shape) in expected.items():
            array: NDArray[Any] = getattr(self, name)
            if array.shape != shape or array.dtype != np.dtype(dtype):
                raise ValueError(f"{name} has the shape {array.shape} and the type {array.dtype}, not {shape}, {dtype}")
        if not (frames and actors) or len(self.signal_stages) != signals or not np.isfinite(self.time_s).all():
            raise ValueError("it has no frames, no actors, or signals without stages")
        if not -1 <= self.lanes.min() <= self.lanes.max() < len(self.lane_ids):
            raise ValueError("an actor is on a lane that the file does not list")

    def _header(self, *, meta: bool) -> dict[str, Any]:
        header: dict[str, Any] = {
            "format": FORMAT,
            # Fields of plain values, as JSON needs them; `asdict` would copy each point of a path.
            "actors": [vars(a) for a in self.actors],
            "lane_ids": self.lane_ids,
            "signals": self.signals,
            "signal_stages": self.signal_stages,
            "events": [vars(e) for e in self.events],
        }
        if meta:
            header["meta"] = self.meta
        return header


def _not_a_trace(name: object) -> str:
    return f"{name} is not a trace, or is damaged; `foresee run FILE --out DIR` writes traces"


class _Header(TypedDict):
    """The part of a trace that its file holds as JSON."""

    format: int
    actors: tuple[ActorInfo, ...]
    lane_ids: tuple[str, ...]
    signals: tuple[str, ...]
    signal_stages: tuple[tuple[str, ...], ...]
    events: tuple[Event, ...]
    meta: dict[str, Any]


@cache
def _header_type() -> TypeAdapter[_Header]:
    return TypeAdapter(_Header)
