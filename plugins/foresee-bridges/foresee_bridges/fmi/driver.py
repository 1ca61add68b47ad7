"""The driver `fmi`: an FMU drives, `--driver fmi:my_driver.fmu`, or `fmi:names.toml` for an FMU with other names.

An FMU is a program: a file that names one as its driver starts it only with the user's consent, like any driver with a
colon in its address.
"""

from __future__ import annotations

from pathlib import Path
from typing import Self

from foresee_bridges.fmi.instance import FmuFile, FmuInstance
from foresee_bridges.fmi.variables import InputValues, Values, parameters
from foresee_bridges.fmi.wiring import ACCELERATES, Names, Source, Wiring, read_names, wire
from foresee_dsl.drivers.protocol import Control, FloatArray, Mission, Observation, VehicleLimits
from foresee_dsl.errors import DriverError

USAGE = "write fmi:FILE.fmu, or fmi:NAMES.toml for an FMU whose variables have other names"


class FmuDriver:
    """An FMU for co-simulation, FMI 2 or 3: --driver fmi:my_driver.fmu, or fmi:names.toml."""

    name, version = "fmi", "1"

    def __init__(self, file: FmuFile, wiring: Wiring, name: str, version: str) -> None:
        self.name, self.version = name, version
        self._file, self._wiring = file, wiring
        self._instance: FmuInstance | None = None

    @classmethod
    def from_argument(cls, argument: str) -> Self:
        """Create the driver of the address `fmi:ARGUMENT`.

        Raises:
            DriverError: the file is not an FMU that can drive here; the message says why.
        """
        file = Path(argument)
        if file.suffix not in (".fmu", ".toml"):
            raise DriverError(f"fmi:{argument} is not an FMU; {USAGE}")
        names = read_names(file) if file.suffix == ".toml" else Names(file)
        fmu = FmuFile(names.fmu)
        wiring = wire(fmu.description.modelVariables, names, f"fmi:{argument}")
        return cls(fmu, wiring, f"fmi:{argument}", fmu.digest)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Unpack the FMU, and start an instance with the vehicle's limits as its parameters."""
        self.close()
        self._vehicle = vehicle
        self._values = InputValues(mission, vehicle, {source.name for _, source in self._wiring.inputs})
        self._step_s, self._steps = mission.step_s, 0
        constants = parameters(mission, vehicle, seed)
        instance = self._instance = FmuInstance(self._file)
        instance.set((variable, constants[source.name]) for variable, source in self._wiring.constants)
        instance.set(self._wiring.start)

    def step(self, observation: Observation) -> Control:
        """Set the inputs, let the FMU do a step, and return the control that its outputs mean."""
        if self._instance is None:
            raise DriverError("an FMU was stepped before reset, or after it failed")
        values = self._values.at(observation)
        inputs = [(variable, _value(values, source)) for variable, source in self._wiring.inputs]
        instance = self._instance
        instance.set(inputs)
        if self._steps == 0:
            instance.begin()  # with the first inputs, so that the FMU's initial state may depend on them
        time_s = round(self._steps * self._step_s, 6)
        self._steps += 1
        if not instance.step(time_s, self._step_s):
            raise DriverError(f"the FMU asked to end the simulation at {time_s:g} s")
        outputs = self._wiring.outputs
        return self._control(dict(zip(outputs, instance.get(list(outputs.values())), strict=True)))

    def close(self) -> None:
        """Free the instance and remove its folder."""
        if self._instance is not None:
            self._instance.close()
        self._instance = None

    def _control(self, answer: dict[str, float]) -> Control:
        vehicle = self._vehicle
        angle = answer.get("control.steering_angle")
        steer = answer["control.steer"] if angle is None else angle / vehicle.steer_max_rad
        if ACCELERATES not in answer:
            return Control(steer, answer["control.throttle"], answer["control.brake"])
        wanted = answer[ACCELERATES]
        throttle = min(wanted / vehicle.acceleration_mps2, 1.0) if wanted > 0 else 0.0
        brake = min(-wanted / vehicle.emergency_braking_mps2, 1.0) if wanted < 0 else 0.0
        return Control(steer, throttle, brake)


def _value(values: Values, source: Source) -> float | FloatArray:
    value = values[source.name]
    if source.element is None or isinstance(value, float):
        return value
    return float(value[source.element]) if source.element < len(value) else 0.0
