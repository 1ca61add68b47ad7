"""An environment of Gymnasium in which an agent drives test cases step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from foresee_bridges.gym.observations import ObjectList, control_of
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import Control, Observation
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.episode import Episode
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.sensing import IDEAL, STANDARD

PER_METRE = 0.1
"""Reward of a metre along the route. Ours: a route of 100 m gives as much as a failure takes."""
FAILURE = -10.0
"""Reward of a failure. Ours: see `PER_METRE`."""

_OPTIONS = ("case", "run_seed")
"""Options of `reset`."""

Array = NDArray[Any]


@dataclass(frozen=True)
class Transition:
    """One step of an episode, for rewards.

    Attributes:
        before, after: the observations at its beginning and end. control: the answer between them.
        progress_m: distance along the route in this step, m.
        result: how the run ended with this step; None while it goes on.
    """

    before: Observation
    control: Control
    after: Observation
    progress_m: float
    result: RunResult | None


Reward = Callable[[Transition], float]


def progress_reward(transition: Transition) -> float:
    """Return a reward for progress along the route, and a penalty for a failure."""
    failed = transition.result is not None and transition.result.verdict.is_failure
    return PER_METRE * transition.progress_m + (FAILURE if failed else 0.0)


class ForeseeEnv(gymnasium.Env[Array, Array]):
    """An environment in which an episode is one run: the test case's verdict ends it (`terminated`), or its time
    (`truncated`).

    Actions are two numbers: steer from -1 (right) to 1 (left), pedals from -1 (full brake) to 1 (full throttle). A step
    takes 0.05 s of simulated time.

    Attributes:
        episode: the present run; its `result` has the trace at the end.
    """

    metadata = {"render_modes": [], "render_fps": 20}  # noqa: RUF012  Gymnasium's own convention
    action_space: gymnasium.spaces.Box

    def __init__(self, cases: Sequence[str], *, observation: str, reward: Reward, ideal: bool) -> None:
        """Load the test cases; see `gym.make`."""
        self._cases = load_test_cases(list(cases))
        self._view, self._reward, self._sensors = observation, reward, IDEAL if ideal else STANDARD
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.episode: Episode | None = None
        self._place_s = 0.0
        """Length along the route at which the ego is, m."""
        if observation == "objects":
            self.observation_space: gymnasium.spaces.Box = gymnasium.spaces.Box(
                -1.0, 1.0, (ObjectList.SIZE,), np.float32
            )
        else:
            picture = self._begin(0, 0)  # the picture must be drawn once before its shape is known
            self.observation_space = gymnasium.spaces.Box(0, 255, picture.shape, np.uint8)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin a run and return its first observation, and `info` with the run's test case and seed.

        Args:
            seed: seeds the generator that draws the test case and the run's seed, at this reset and the next ones.
            options: `case` (a test case's name or address) and `run_seed` replace the drawn ones. With `run_seed` 0
                the same controls give the same trace as `foresee run`.

        Raises:
            ValueError: `case` names no or several test cases of this environment, or there is no such option.
        """
        super().reset(seed=seed, options=options)
        wanted = options or {}
        if unknown := [name for name in wanted if name not in _OPTIONS]:
            raise ValueError(f"reset has no option {unknown[0]!r}; its options are {' and '.join(_OPTIONS)}")
        case = int(self.np_random.integers(len(self._cases)))
        run_seed = int(self.np_random.integers(2**31))
        if "case" in wanted:
            ids = [case.id for case in self._cases]
            named = [k for k, address in enumerate(ids) if wanted["case"] in {address, address.rpartition("::")[2]}]
            if len(named) != 1:
                count = f"{len(named)} test cases" if named else "no test case"
                raise ValueError(f"{wanted['case']!r} names {count} of this environment; name one of {', '.join(ids)}")
            case = named[0]
        run_seed = int(wanted.get("run_seed", run_seed))
        return self._begin(case, run_seed), {"case": self._cases[case].id, "run_seed": run_seed}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Move all actors by 0.05 s; return observation, reward, terminated, truncated, info.

        At the end `info` has `verdict`, `reason`, `digest` (of the trace), `nearest_m` (smallest distance to an actor),
        `infractions` (of traffic rules), and `margins` (of each `expect` line, positive if it held).

        Raises:
            ValueError: the action is not two numbers.
            SimulationError: the run has ended, or another environment in this process has begun one.
        """
        episode = self._running()
        before, control = episode.observation, control_of(action)
        after = episode.step(control)
        place_s = self._objects.place(after, self._place_s)
        progress_m, self._place_s = place_s - self._place_s, place_s
        reward = float(self._reward(Transition(before, control, after, progress_m, episode.result)))
        result = episode.result
        ended, late = result is not None, result is not None and result.verdict is Verdict.TIMEOUT
        return self._seen(), reward, ended and not late, late, {} if result is None else _info(result)

    def _begin(self, case: int, run_seed: int) -> Array:
        self.episode = Episode(compile_test_case(self._cases[case]), seed=run_seed, name="gym", sensors=self._sensors)
        self._objects = ObjectList(self.episode.mission, self.episode.vehicle)
        self._place_s = self._objects.place(self.episode.observation)
        return self._seen()

    def _running(self) -> Episode:
        if self.episode is None:
            raise gymnasium.error.ResetNeeded("call reset before step")
        return self.episode

    def _seen(self) -> Array:
        """Return what the agent gets at this step."""
        observation = self._running().observation
        if self._view == "objects":
            return self._objects.vector(observation, self._place_s)
        if observation.views is None:
            raise ForeseeError(
                "this picture needs foresee-learned: pip install ./plugins/foresee-learned in a checkout"
            )
        return observation.views.draw(self._view)


def _info(result: RunResult) -> dict[str, Any]:
    return {
        "verdict": result.verdict.value,
        "reason": result.reason,
        "digest": result.trace.digest,
        "nearest_m": result.near_misses.distance_m.value if result.near_misses.distance_m is not None else None,
        "margins": {expectation.text: expectation.margin for expectation in result.expectations},
        "infractions": [infraction.clause for infraction in result.infractions],
    }
