"""Reads SUMO's vehicles after a step: with libsumo's Python functions, or with compiled code where a plug-in has it.

Both call the same functions of SUMO, so runs are the same with both.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Protocol

import numpy as np

from foresee_dsl.errors import SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.plugins import PluginGroup

if TYPE_CHECKING:
    from types import ModuleType

READERS = PluginGroup("foresee_dsl.vehicle_readers", "vehicle reader", SimulationError)
"""Entry points of compiled readers: functions without arguments that return a `VehicleReader`, or raise
`SimulationError` with the reason why it cannot be used here."""
VARIABLE = "FORESEE_COMPILED_READER"
"""Environment variable that switches compiled readers off if it is `0`."""


class VehicleReader(Protocol):
    """Reads the vehicles of this process's SUMO after each step.

    Attributes:
        numbers: [3 N] for each vehicle that is read x, y of the middle of its front bumper, m; then the N speeds, m/s.
            `read` overwrites it; `follow` replaces it.
    """

    numbers: FloatArray

    def follow(self, names: Sequence[str], on_road: Sequence[str]) -> None:
        """Read the vehicles `names` from now on, as long as SUMO has exactly the vehicles `on_road`, in its order."""

    def read(self) -> Sequence[int] | None:
        """Read the vehicles, and return the indices of those that are on another lane than at the last call (at the
        first call since `follow`, all); None if SUMO has other vehicles than `on_road`.
        """

    def lane(self, index: int) -> str:
        """Return the lane of a vehicle at the last `read`."""

    def disordered(self, bodies: Sequence[str]) -> Sequence[str]:
        """Return the lanes of these vehicles on which SUMO's order of vehicles is not that of their positions."""


class PythonReader:
    """Reads with libsumo's Python functions; see `VehicleReader`.

    Reading each value is cheaper than SUMO's subscriptions (14 us against 27 us).
    """

    def __init__(self, sumo: ModuleType, errors: tuple[type[Exception], ...]) -> None:
        """Read from libsumo; `errors`: the exceptions that SUMO raises."""
        self._sumo, self._errors = sumo, errors
        self.follow((), ())

    def follow(self, names: Sequence[str], on_road: Sequence[str]) -> None:
        """See `VehicleReader`."""
        self._names, self._on_road = tuple(names), tuple(on_road)
        self._lanes = [""] * len(names)
        self.numbers: FloatArray = np.empty(3 * len(names))

    def read(self) -> Sequence[int] | None:
        """See `VehicleReader`."""
        vehicle, names = self._sumo.vehicle, self._names
        if vehicle.getIDList() != self._on_road:
            return None
        places, speeds = chain.from_iterable(map(vehicle.getPosition, names)), map(vehicle.getSpeed, names)
        self.numbers = np.fromiter(chain(places, speeds), np.float64, 3 * len(names))
        lanes, before = list(map(vehicle.getLaneID, names)), self._lanes
        if lanes == before:
            return ()
        self._lanes = lanes
        return [index for index, lane in enumerate(lanes) if lane != before[index]]

    def lane(self, index: int) -> str:
        """See `VehicleReader`."""
        return self._lanes[index]

    def disordered(self, bodies: Sequence[str]) -> Sequence[str]:
        """See `VehicleReader`."""
        try:
            lanes: Iterable[str] = map(self._sumo.vehicle.getLaneID, bodies)
            different = dict.fromkeys(lanes)
        except self._errors:  # a body that has reached the end of its route has no lane
            different = dict.fromkeys(map(self._lane_of, bodies))
        return [lane for lane in different if lane and not self._is_in_order(lane)]

    def _is_in_order(self, lane: str) -> bool:
        queue = self._sumo.lane.getLastStepVehicleIDs(lane)
        if len(queue) < 2:
            return True
        places = list(map(self._sumo.vehicle.getLanePosition, queue))
        return places == sorted(places)

    def _lane_of(self, vehicle: str) -> str:
        try:
            return str(self._sumo.vehicle.getLaneID(vehicle))
        except self._errors:
            return ""


def reader_for(sumo: ModuleType, errors: tuple[type[Exception], ...]) -> VehicleReader:
    """Return the compiled reader if one is installed and works here, else the one in Python."""
    if os.environ.get(VARIABLE) != "0":
        for entry in READERS.entries():
            try:
                with READERS.loading(entry):
                    create: Callable[[], VehicleReader] = entry.load()
                    return create()
            except SimulationError:  # `foresee doctor` shows it
                continue
    return PythonReader(sumo, errors)


def description() -> str:
    """Return which reader this process would use, and why compiled ones cannot be used, for `foresee doctor`."""
    reasons = ["no compiled one is installed (plug-in foresee-native)"]
    if os.environ.get(VARIABLE) == "0":
        return f"in Python: {VARIABLE}=0 switches compiled ones off"
    for entry in READERS.entries():
        try:
            with READERS.loading(entry):
                entry.load()()
        except SimulationError as err:
            reasons = [str(err)]
        else:
            return f"compiled: {entry.name}"
    return f"in Python, runs take longer: {'; '.join(reasons)}"
