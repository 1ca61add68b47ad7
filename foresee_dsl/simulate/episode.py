"""A run whose caller moves the ego: for programs that call the simulator instead of being called by it.

Training and notebooks step an episode; `runner.run` does the same with a driver. Both give the same trace for the same
controls.
"""

from __future__ import annotations

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.errors import SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.compiling import ensure
from foresee_dsl.language.campaign_values import RULES_MODE
from foresee_dsl.simulate.actors.dynamics import checked
from foresee_dsl.simulate.driver_watch import DriverWatch
from foresee_dsl.simulate.judging import Frame
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import Run
from foresee_dsl.simulate.sensing import STANDARD, SensorSettings


class Episode:
    """One run, from its first observation to its result.

    Attributes:
        mission, vehicle: what a driver gets at its `reset`.
        observation: what a driver gets at this step; at the end, the last one.
        result: how the run ended, with its trace; None while it goes on.
    """

    def __init__(
        self,
        bundle: SumoBundle,
        *,
        seed: int = 0,
        name: str = "caller",
        sensors: SensorSettings = STANDARD,
    ) -> None:
        """Set the scene up and observe its first frame.

        Args:
            bundle: the compiled test case.
            seed: the seed of the sensors' noise and of the track numbers.
            name: name of the caller; the trace records it as that of the driver.
            sensors: as in `runner.run`.

        Raises:
            SimulationError: the scene cannot be set up in SUMO.
        """
        ensure()
        caller = _Caller(name)
        watch = DriverWatch(None, bundle.scene.end_s)  # an episode has no driver that could hang
        self._run = Run(bundle, caller, seed, {}, sensors, watch, RULES_MODE)
        self.result: RunResult | None = None
        self._run.reset()
        self.mission, self.vehicle = caller.mission, caller.vehicle
        self._look()

    @property
    def states(self) -> FloatArray:
        """The true states of the ego and the others at this step, [1 + N, 7]: the columns of `Trace.states`."""
        return self._frame.states

    def step(self, control: Control) -> Observation:
        """Move all actors by one step of 0.05 s and return the observation after it; sets `result` at the run's end.

        Raises:
            ValueError: a value of the control is not a number.
            SimulationError: the run has ended, or another run in this process has taken SUMO over.
        """
        if self.result is not None:
            raise SimulationError(f"the run has ended ({self.result.reason}); begin another Episode")
        if not self._run.has_the_world:
            raise SimulationError(
                "another run has begun in this process, which has one SUMO: give each episode a process of its own"
            )
        self._frame.control = Control(*checked(control))
        self._run.move(self._frame)
        if self._frame.run_end is not None:
            self.result = self._run.finish(self._frame.run_end)
        else:
            self._look()
        return self.observation

    def _look(self) -> None:
        self._frame: Frame = self._run.next_frame()
        self.observation: Observation = self._frame.observation
        if self._frame.run_end is not None:
            self.result = self._run.finish(self._frame.run_end)


class _Caller:
    """The driver in the trace of an episode; it keeps what a driver gets at its reset."""

    mission: Mission
    vehicle: VehicleLimits

    def __init__(self, name: str) -> None:
        self.name, self.version = name, "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  as every driver
        """Keep the mission and the vehicle."""
        self.mission, self.vehicle = mission, vehicle

    def step(self, observation: Observation) -> Control:  # noqa: ARG002
        """Raise an error: the caller moves the ego, so this driver has no control to return."""
        raise SimulationError(
            "the ego of an episode is moved by the episode's caller, so it has no driver to ask for a control"
        )
