"""The driver of a replay.

It follows a recorded run exactly, and may brake from a given time on along the recorded path.

The judges that drive a failure again (`r157`, `anticipating`) use it, and `RecordedPath`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from foresee_dsl.compile.bundle import Scene
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import HARDEST_BRAKING_MPS2
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.actors.roads import SlipperyGround
from foresee_dsl.simulate.trace import HEADING, SPEED, STEER, STEP_S, Trace, X, Y

JERK_MPS3 = 12.65
"""Rate at which braking builds up, m/s^3. It reaches the hardest braking in 0.6 s: R157, Annex 4, appendix 3;
`CC_min_jerk` in JRC-FSM.
"""
KEEPS_PATH_M = 3.0
"""Length over which a lateral error decays while braking, m. Ours: a wheelbase; the error stays below centimetres."""

_SLOW_MPS = 1.0
"""Lowest speed by which steering angles are divided, m/s. Ours: below it the ego does not evade."""
EXACT_MPS = 1e-12
"""Largest error of a replayed speed, m/s. Ours: about a thousand rounding errors; over 10 s this amounts to a hundredth
of a nanometre.
"""
_TRIES = 100
"""Largest number of iterations of `_solve`. Ours: every second iteration halves the range, and fifty halvings reach the
precision of a float.
"""
_TOUCHED = 1e-9
"""Smallest share of a pressed brake, as at 0 the vehicle behaves as with a released throttle."""


class RecordedPath:
    """The ego's recorded path by length, so that it can be driven at another speed.

    It goes straight on after its end.

    Attributes:
        along: [T] distance driven at each frame, m.
    """

    def __init__(self, trace: Trace) -> None:
        states = trace.states[:, 0]
        steps = np.hypot(*np.diff(states[:, [X, Y]], axis=0).T) if len(states) > 1 else np.empty(0)
        self.along: FloatArray = np.r_[0.0, np.cumsum(steps)]
        # np.interp needs increasing places. An ego that stands repeats its place, so a little is added at each step.
        self._marks = self.along + np.arange(len(self.along)) * 1e-9
        self._poses = np.column_stack([states[:, X], states[:, Y], np.unwrap(states[:, HEADING])])
        self._steer = np.array(states[:, STEER])

    def at(self, along_m: FloatArray) -> FloatArray:
        """Return x, y, heading at lengths [N] m of the path, [N, 3]."""
        poses = np.column_stack([np.interp(along_m, self._marks, column) for column in self._poses.T])
        beyond = np.maximum(along_m - self._marks[-1], 0.0)
        poses[:, 0] += beyond * np.cos(poses[:, 2])
        poses[:, 1] += beyond * np.sin(poses[:, 2])
        return poses

    def steer(self, along_m: float) -> float:
        """Return the angle of the front wheels at a length of the path, rad; beyond the end, the last angle."""
        return float(np.interp(along_m, self._marks, self._steer))


class Replay:
    """Drives a recorded run again, with the pedals and the wheel that lead to its recorded states, and then brakes.

    It ignores observations: until it brakes, the world moves as recorded, and it computes the ego's motion with the
    vehicle's model.

    Args:
        trace: the run. brakes_s: when braking begins; None: never. scene: the scene of the run, for its slippery
            patches. path: the path along which it brakes; None: the recorded one.
    """

    name = "careful"
    version = "1"

    def __init__(self, trace: Trace, brakes_s: float | None, scene: Scene, path: RecordedPath | None = None) -> None:
        self._ground = SlipperyGround(scene)
        self._states = trace.states[:, 0]
        self._path = path or RecordedPath(trace)
        self._brakes_from = math.inf if brakes_s is None else round(brakes_s / STEP_S)
        self._bicycle: Bicycle | None = None

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002 - the protocol's
        """Begin at the run's first frame; mission and seed are not used."""
        self._bicycle = Bicycle(vehicle)
        self._state = BicycleState(*self._states[0].tolist())
        self._frame = 0
        self._along = 0.0
        self._least_mps2 = 0.0

    def step(self, observation: Observation) -> Control:
        """Return the control that leads to the next recorded frame, or that brakes."""
        if self._bicycle is None:
            raise RuntimeError("stepped before reset")
        self._ground.hold(self._bicycle, self._state)
        control = self._control(self._bicycle, observation)
        before = self._state
        self._state = self._bicycle.step(before, control, STEP_S)
        self._along += math.hypot(self._state.x - before.x, self._state.y - before.y)
        self._frame += 1
        return control

    def _control(self, bicycle: Bicycle, observation: Observation) -> Control:  # noqa: ARG002 - it ignores observations
        following = self._frame < min(self._brakes_from, len(self._states) - 1)
        return self._follow(bicycle) if following else self._brake(bicycle)

    def _follow(self, bicycle: Bicycle) -> Control:
        wanted = self._states[self._frame + 1]
        wheel = wheel_share(float(wanted[STEER]), bicycle.limits.steer_max_rad)
        self._least_mps2 = max(-self._state.acceleration, 0.0)
        return pedals_for(bicycle, self._state, wheel, float(wanted[SPEED]))

    def _brake(self, bicycle: Bicycle) -> Control:
        """Return the control of braking that builds up from the recorded driver's, and is never weaker."""
        since = self._frame + 1 - self._brakes_from if math.isfinite(self._brakes_from) else 0
        level = min(self._least_mps2 + JERK_MPS3 * since * STEP_S, max(HARDEST_BRAKING_MPS2, self._least_mps2))
        return self._on_path(bicycle, level)

    def _on_path(
        self, bicycle: Bicycle, braking_mps2: float, beside: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Control:
        """Return the control of braking along the path, or along a line beside it.

        `beside`: lateral offset of the line, m, and its first and second derivatives.
        """
        wheel = wheel_share(self._angle(bicycle, *beside), bicycle.limits.steer_max_rad)
        speed = self._state.speed - braking_mps2 * STEP_S
        if speed <= 0.0:
            return Control(wheel, 0.0, 1.0)  # the ego stops, and the brake holds it
        return pedals_for(bicycle, self._state, wheel, speed)

    def _angle(self, bicycle: Bicycle, aside_m: float, rate_mps: float, bend_mps2: float) -> float:
        """Return the angle of the front wheels that follows a line beside the path without overshooting, rad."""
        state = self._state
        x, y, heading = self._path.at(np.array([self._along]))[0].tolist()
        dx, dy, speed = state.x - x, state.y - y, max(state.speed, _SLOW_MPS)
        lateral = -dx * math.sin(heading) + dy * math.cos(heading) - aside_m
        turned = math.remainder(state.heading - heading, math.tau) - rate_mps / speed
        curvature = math.tan(self._path.steer(self._along + state.speed * STEP_S)) / bicycle.limits.wheelbase_m
        ahead = curvature + bend_mps2 / speed**2
        return bicycle.steer_for(ahead - lateral / KEEPS_PATH_M**2 - 2 * turned / KEEPS_PATH_M)


def wheel_share(angle_rad: float, most_rad: float) -> float:
    """Return an angle of the front wheels as a share of the largest, -1 to 1."""
    return max(-1.0, min(1.0, angle_rad / most_rad)) if most_rad > 0 else 0.0


def pedals_for(bicycle: Bicycle, state: BicycleState, wheel: float, speed_mps: float) -> Control:
    """Return the pedals and wheel that lead to the wanted speed at the next step, or as close to it as possible.

    Throttle and brake are solved separately: as their lags differ, the next speed jumps between them.
    """
    throttle = _solve(0.0, lambda p: bicycle.step(state, Control(wheel, p, 0.0), STEP_S).speed - speed_mps)
    error = abs(bicycle.step(state, Control(wheel, throttle, 0.0), STEP_S).speed - speed_mps)
    if error < EXACT_MPS:
        return Control(wheel, throttle, 0.0)
    brake = _solve(_TOUCHED, lambda p: bicycle.step(state, Control(wheel, 0.0, p), STEP_S).speed - speed_mps)
    if abs(bicycle.step(state, Control(wheel, 0.0, brake), STEP_S).speed - speed_mps) < error:
        return Control(wheel, 0.0, brake)
    return Control(wheel, throttle, 0.0)


def _solve(least: float, excess: Callable[[float], float]) -> float:
    """Return the pedal's share at which a monotone excess vanishes, or the end of the range that comes nearer to it."""
    low, high = least, 1.0
    under, over = excess(low), excess(high)
    if under == 0.0 or under * over > 0:
        return low if abs(under) <= abs(over) else high
    middle = low
    for turn in range(_TRIES):
        # Without a limit the excess is linear, and the first secant finds its root; with a limit, the halvings find it.
        middle = low - under * (high - low) / (over - under) if turn % 2 == 0 else (low + high) / 2
        value = excess(middle)
        if abs(value) < EXACT_MPS:
            break
        if value * under > 0:
            low, under = middle, value
        else:
            high, over = middle, value
    return middle
