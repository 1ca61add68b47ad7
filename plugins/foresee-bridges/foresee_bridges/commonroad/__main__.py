"""The program: `python -m foresee_bridges.commonroad PLANNER`, a driver over foresee's external protocol."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any, TextIO

import numpy as np

from foresee_bridges.commonroad.planners import PLANNERS, Plan, planner_of
from foresee_bridges.commonroad.world import DT_S, World

EVERY_S = 0.2
"""Time between two plans, s. Ours: two time steps of a scenario; the trajectory is followed in between."""
BRAKES = 0.4
"""Brake, as a share of the largest, while the planner has not found any plan yet. Ours: about 3 m/s^2."""
STEP_S = 0.05
"""Time between two observations, s (docs/reference/drivers.md)."""


def main() -> None:
    """Answer the lines on standard input until the end."""
    parser = argparse.ArgumentParser(prog="python -m foresee_bridges.commonroad", description=__doc__)
    parser.add_argument("planner", help=f"{', '.join(PLANNERS)}, MODULE:FUNCTION or FILE.py:FUNCTION")
    parser.add_argument("--every", type=float, default=EVERY_S, help="time between two plans, s (0.2)")
    parser.add_argument(
        "--walls", choices=("yes", "no"), help="whether a red signal is an obstacle too (default: as the planner needs)"
    )
    options = parser.parse_args()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what planners print must not be taken for an answer
    try:
        make, walls, version = planner_of(options.planner)
    except (ImportError, AttributeError) as err:
        sys.exit(f"the planner {options.planner} cannot be loaded: {err}")
    if options.walls is not None:
        walls = options.walls == "yes"
    name = "".join(sign if sign.isalnum() or sign in "._-" else "_" for sign in f"commonroad-{options.planner}")[:64]
    ready = {"type": "ready", "name": name, "version": version, "stays": True, "wants": ["map"]}
    every = max(round(options.every / STEP_S), 1)
    mission: Mapping[str, Any] = {}
    vehicle: Mapping[str, Any] = {}
    run: Run | None = None
    for message in map(json.loads, sys.stdin):
        match message["type"]:
            case "reset":
                mission, vehicle = message["mission"], message["vehicle"]
                np.random.seed(message["seed"] % 2**32)  # planners may use the global generator
                _write(answers, ready)
            case "map":
                run = Run(make(), World(message["map"], mission, vehicle, walls=walls), vehicle, every)
                _write(answers, ready)
            case "step" if run is not None:
                _write(answers, run.step(message["observation"]))
            case _:
                run = None


def _write(answers: TextIO, answer: Mapping[str, Any]) -> None:
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


class Run:
    """One run: plans every few steps, and keeps the trajectory in between and while there is no plan."""

    def __init__(self, plan: Plan, world: World, vehicle: Mapping[str, Any], every: int) -> None:
        self._plan, self._world, self._vehicle, self._every = plan, world, vehicle, every
        self._steps = 0
        self._has_plan = False

    def step(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to an observation."""
        self._steps += 1
        if (self._steps - 1) % self._every == 0 or not self._has_plan:
            scenario, problem, route = self._world.at(observation)
            states = finite_states(self._plan(scenario, problem, route))
            if len(states) >= 2:
                self._has_plan = True
                return {"trajectory": trajectory_of(states, observation["time_s"])}
        if self._has_plan:
            return {"keep": True}
        ego = observation["ego"]
        return {"steer": ego["steer_rad"] / self._vehicle["steer_max_rad"], "throttle": 0.0, "brake": BRAKES}


def finite_states(plan: Any) -> list[Any]:  # noqa: ANN401  a trajectory, a list of states, or None
    """Return the states of a plan up to the first in which a number is not finite; none without a plan."""
    states = []
    for state in getattr(plan, "state_list", plan) or ():
        if not np.isfinite([*state.position, state.orientation, state.velocity, state.time_step]).all():
            sys.stderr.write(
                f"time step {state.time_step} of a plan is not finite: it and those after it are left out\n"
            )
            break
        states.append(state)
    return states


def trajectory_of(states: Sequence[Any], now_s: float) -> dict[str, list[float]]:
    """Return the states of a plan as a trajectory of the external protocol; time step 0 is `now_s`.

    The ego cannot reverse: from the first negative speed on, the trajectory stands.
    """
    last = next((k for k, state in enumerate(states) if state.velocity < 0), len(states))
    places = [states[min(k, max(last - 1, 0))] for k in range(len(states))]
    return {
        "time_s": [now_s + DT_S * float(state.time_step) for state in states],
        "x": [float(state.position[0]) for state in places],
        "y": [float(state.position[1]) for state in places],
        "heading_rad": [float(state.orientation) for state in places],
        "speed_mps": [float(state.velocity) if k < last else 0.0 for k, state in enumerate(states)],
    }


if __name__ == "__main__":
    main()
