"""The time of the simulation, as agents read it."""

from __future__ import annotations

import datetime
from typing import Any


class GameTime:
    """Simulated time; the driver sets it before each step."""

    _time_s = 0.0
    _frame = 0

    @staticmethod
    def on_carla_tick(timestamp: Any) -> None:
        """Take over the time of a `carla.Timestamp`."""
        GameTime._time_s, GameTime._frame = timestamp.elapsed_seconds, timestamp.frame

    @staticmethod
    def restart() -> None:
        """Begin at 0."""
        GameTime._time_s, GameTime._frame = 0.0, 0

    @staticmethod
    def get_time() -> float:
        """Return the simulated time, s."""
        return GameTime._time_s

    @staticmethod
    def get_frame() -> int:
        """Return the number of the step."""
        return GameTime._frame

    @staticmethod
    def get_carla_time() -> float:
        """Return the simulated time, s."""
        return GameTime._time_s

    @staticmethod
    def get_wallclocktime() -> datetime.datetime:
        """Return the simulated time as a date, so that no answer depends on the clock."""
        return datetime.datetime.fromtimestamp(GameTime._time_s, tz=datetime.UTC)
