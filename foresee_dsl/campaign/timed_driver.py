"""A driver that is wrapped to measure the wall time of its decisions."""

from __future__ import annotations

import time

from foresee_dsl.drivers.protocol import Closing, Control, Driver, Mission, Observation, Trajectory, VehicleLimits


class TimedDriver:
    """Passes every call on to a driver and measures how long its answers take.

    Attributes:
        reset_s: wall time of the last reset, s. step_s: wall time of each step since the last reset, s.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self.name, self.version = driver.name, driver.version
        self.reset_s, self.step_s = 0.0, list[float]()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Reset the driver, whose name and version may change with that."""
        self.step_s.clear()
        started = time.perf_counter()
        self._driver.reset(mission, vehicle, seed)
        self.reset_s = time.perf_counter() - started
        self.name, self.version = self._driver.name, self._driver.version

    def step(self, observation: Observation) -> Control | Trajectory:
        """Return the driver's answer."""
        # Sensors are evaluated when the driver reads them, which must not count as the driver's time.
        _ = (observation.actors, observation.signals, observation.ego)
        started = time.perf_counter()
        try:
            return self._driver.step(observation)
        finally:
            self.step_s.append(time.perf_counter() - started)

    def close(self) -> None:
        """Close the driver, if it has a method `close`."""
        if isinstance(self._driver, Closing):
            self._driver.close()
