"""The trace: every actor, every frame, in one numpy layout; the forecast and the clips are made from it."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.files import replacing
from foresee_dsl.simulate.triggers.record import DirectorRecord

FIELDS = ("x", "y", "heading", "speed", "acceleration", "yaw_rate", "steer")
"""Columns of `Trace.states`: m, m, rad (counter-clockwise from east), m/s, m/s^2, rad/s, rad (front wheels)."""

X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE, STEER = range(7)
STEP_S = 0.05
"""20 frames a second, as in the paper (section 4.2)."""
FORMAT = 1


@dataclass(frozen=True)
class ActorInfo:
    """What stays the same about an actor during a run.

    Attributes:
        id: `ego`, the actor's name, or `others_03`. kind: the model's class (car, van, ..., pedestrian, obstacle).
        front_m: from the centre of the footprint to the front bumper (half the length).
        route: edge ids from where it was at the first frame to its end; empty for path-followers and obstacles.
        path: points (m) of a path-follower, empty for the others.
        cruise_mps: what it drives where nothing hinders it.
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
        """From the centre of the footprint to its front."""
        return self.length_m / 2


@dataclass(frozen=True)
class Event:
    """Something that changed how an actor behaves: a trigger's action taking effect, an arrival, a collision.

    `what`: `starts`, `ignores`, `meets`, `changes_speed`, `changes_lane`, `stops`, `trigger`, `arrived`,
    `collision`, ...; `detail` is JSON-able.
    """

    time_s: float
    actor: str
    what: str
    detail: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Trace:
    """One run.

    Attributes:
        time_s: [T] float64, s, from 0 in steps of 0.05; frame 0 is the state at the beginning.
        states: [T, A, 7] float64, columns `FIELDS`; x, y is the centre of the footprint; NaN where the actor is
            absent. Actor 0 is the ego.
        lanes: [T, A] int32, index into `lane_ids`, -1 when on none (path-followers, obstacles, off the road).
        along: [T, A] float64, m: for path-followers, how far they have come along their path; NaN otherwise.
        stages: [T, S] int16 and elapsed [T, S] float64 (s): the stage (index into `signal_stages[signal]`) of each
            of `signals`, and time since it began.
        waypoints: [W, 2] float64: the valid waypoints of the ego's route, 2 m apart.
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
    """test_case, driver, driver_version, seed, verdict, scenario (name), meaning (hash of what was run), ..."""
    director: DirectorRecord | None = None
    """What the run's triggers did and what they told its actors; None in a file of a version that did not write it."""

    _ARRAYS = ("time_s", "states", "lanes", "along", "stages", "elapsed", "waypoints")

    @property
    def frames(self) -> int:
        """The number of frames, T."""
        return len(self.time_s)

    @property
    def duration_s(self) -> float:
        """Time of the last frame."""
        return float(self.time_s[-1]) if self.frames else 0.0

    def index(self, actor: str) -> int:
        """Return the column of an actor's id; a `KeyError` for none."""
        for k, info in enumerate(self.actors):
            if info.id == actor:
                return k
        raise KeyError(actor)

    def frame_at(self, time_s: float) -> int:
        """Return the frame nearest to a time, within the run."""
        return int(np.clip(round(time_s / STEP_S), 0, self.frames - 1))

    @cached_property
    def digest(self) -> str:
        """Hash over everything but `meta` and `director`: equal for equal runs."""
        h = hashlib.sha256()
        for name in self._ARRAYS:
            array = np.ascontiguousarray(getattr(self, name))
            h.update(f"{name}{array.shape}{array.dtype.str}".encode())
            h.update(array.tobytes())
        h.update(json.dumps(self._header(meta=False), sort_keys=True).encode())
        return "sha256:" + h.hexdigest()[:16]

    def save(self, path: Path) -> None:
        """Write the trace as a compressed `.npz`: the arrays, and JSON texts: `director`, and `header` with the rest.

        The file is written whole or not at all.
        """
        with replacing(path) as temporary:
            temporary.write_bytes(self.packed())

    def packed(self) -> bytes:
        """Return what `save` writes."""
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
        """Read a trace from its file; a `ValueError` where it holds none, or one of another format version."""
        try:
            with np.load(path, allow_pickle=False) as data:
                header = json.loads(data["header"].tobytes())
                arrays = {name: data[name] for name in cls._ARRAYS}
                director = DirectorRecord.of_json(data["director"].tobytes()) if "director" in data else None
        except (KeyError, EOFError, ValueError, zipfile.BadZipFile) as err:
            raise ValueError(
                f"{path} is no trace, or a damaged one; `foresee run FILE --out DIR` writes traces"
            ) from err
        if header["format"] != FORMAT:
            raise ValueError(f"{path} has trace format {header['format']}, this version reads {FORMAT}")
        actors = tuple(
            ActorInfo(**{**a, "route": tuple(a["route"]), "path": tuple(tuple(p) for p in a["path"])})
            for a in header["actors"]
        )
        return cls(
            **arrays,
            actors=actors,
            lane_ids=tuple(header["lane_ids"]),
            signals=tuple(header["signals"]),
            signal_stages=tuple(tuple(s) for s in header["signal_stages"]),
            events=tuple(Event(**e) for e in header["events"]),
            meta=header["meta"],
            director=director,
        )

    def _header(self, *, meta: bool) -> dict[str, Any]:
        header: dict[str, Any] = {
            "format": FORMAT,
            "actors": [asdict(a) for a in self.actors],
            "lane_ids": self.lane_ids,
            "signals": self.signals,
            "signal_stages": self.signal_stages,
            "events": [asdict(e) for e in self.events],
        }
        if meta:
            header["meta"] = self.meta
        return header
