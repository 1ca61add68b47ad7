"""A run step by step: the driver's observations, its answers, and its reasons if the driver states them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rich.text import Text

from foresee_dsl.campaign.driving import TimedDriver, sensors_of
from foresee_dsl.drivers.protocol import (
    Control,
    Driver,
    EgoState,
    Explaining,
    Observation,
    Reason,
    SeenActor,
    SignalColour,
    Trajectory,
)
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.report.safe_text import safe, shortened
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.simulate.driver_faults import fault_of
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

MOST_SEEN = 8
"""Maximum number of objects that are listed; further ones are counted. Ours: the nearest matter, and a screen has 24
lines."""
SAME_M = 4.0
"""An object gets the name of the nearest actor of its class, up to this distance, m. Ours: far more than the sensors'
errors, less than the distance between two cars in a queue."""
_LABEL = 9


@dataclass(frozen=True)
class ShownStep:
    """One step of a driver: its observation, its answer, and its reasons (none if the driver states none)."""

    time_s: float
    measured_s: float
    ego: EgoState
    actors: tuple[SeenActor, ...]
    signals: dict[str, SignalColour]
    answer: Control | Trajectory
    reasons: tuple[Reason, ...]


class RecordingDriver(TimedDriver):
    """A driver that answers as another driver does, and records that driver's steps."""

    def __init__(self, driver: Driver, from_s: float, to_s: float, every_s: float) -> None:
        """Prepare to record one step in every `every_s`, from `from_s` to `to_s`, s."""
        super().__init__(driver)
        self.steps: list[ShownStep] = []
        self.fault = ""
        """What is wrong with the driver's reasons, in words."""
        self._from_s, self._to_s = from_s, to_s
        self._every = max(round(every_s / STEP_S), 1)

    def step(self, observation: Observation) -> Control | Trajectory:
        """Return the driver's answer, and record it with the observation."""
        answer = super().step(observation)
        now_s = observation.time_s
        if self._from_s - 1e-6 <= now_s <= self._to_s + 1e-6 and round(now_s / STEP_S) % self._every == 0:
            measured_s = now_s if observation.measured_s is None else observation.measured_s
            seen = observation.actors, dict(observation.signals)
            self.steps.append(ShownStep(now_s, measured_s, observation.ego, *seen, answer, self._reasons()))
        return answer

    def _reasons(self) -> tuple[Reason, ...]:
        if not isinstance(self._driver, Explaining):
            return ()
        try:
            reasons: object = self._driver.explain()
        except Exception as err:  # it must not end the run, which is compared with the one that is shown
            self.fault = fault_of(err).text
            return ()
        if isinstance(reasons, Sequence) and all(isinstance(reason, Reason) for reason in reasons):
            return tuple(reasons)
        self.fault = f"`explain` of the driver returned {reasons!r:.80}"
        return ()


def recorded_steps(
    original: ShownRun, from_s: float = 0.0, to_s: float = math.inf, every_s: float = STEP_S
) -> tuple[tuple[ShownStep, ...], bool]:
    """Repeat a run and return its steps, and whether the repeated run is identical to the run that is shown.

    Raises:
        DriverError: the driver's `explain` does not return reasons.
    """
    driver = RecordingDriver(load_driver(original.driver), from_s, to_s, every_s)
    result = run(original.bundle, driver, seed=original.seed, sensors=sensors_of(original.driver))
    if driver.fault:
        raise DriverError(
            f"{original.driver} does not explain its answers: {driver.fault}; return a list of `Reason`s "
            "(foresee_dsl.drivers.protocol), or leave `explain` out"
        )
    return tuple(driver.steps), result.trace.digest == original.trace.digest


def step_lines(step: ShownStep, trace: Trace, opponent: str, width: int) -> Iterator[Text]:
    """Yield a step in lines of a width (0: of any length): the answer, the reasons, the objects and signals seen.

    Args:
        step: the step. trace: the run, for the names of the objects. width: columns.
        opponent: id of the opponent, which is always listed, even if it is far away or not seen.
    """
    ego, names = step.ego, _names(step, trace)
    head = f"{step.time_s:6.2f} s  ego {ego.speed_mps * 3.6:.0f} km/h, {ego.acceleration_mps2:+.1f} m/s^2"
    late = f", objects as at {step.measured_s:.2f} s" if step.measured_s < step.time_s - 1e-6 else ""
    yield Text.assemble((head, "bold"), (late, "dim"))
    yield _line("answers", _answer(step), width)
    for number, reason in enumerate(step.reasons):
        yield _line("" if number else "because", _reason(reason, names), width)
    if not step.reasons:
        yield _line("because", "this driver states no reasons", width, style="dim")
    nearest = [a for k, a in enumerate(step.actors) if k < MOST_SEEN or names.get(a.track) == opponent]
    for number, seen in enumerate(nearest):
        style = "red" if names.get(seen.track) == opponent else ""
        yield _line("" if number else "sees", _seen(seen, step, names), width, style=style)
    rest = len(step.actors) - len(nearest)
    if rest:
        yield _line("", f"and {rest} farther away", width, style="dim")
    if opponent and opponent not in names.values():
        yield _line("not seen", safe(opponent), width, style="red")
    if step.signals:
        colours = ", ".join(f"{safe(key.rpartition(':')[0])} {colour}" for key, colour in sorted(step.signals.items()))
        yield _line("signals", colours, width)


def reason_texts(step: ShownStep, trace: Trace) -> tuple[str, ...]:
    """Return the driver's reasons at a step in words, none if it does not state any; `trace`: for actors' names."""
    names = _names(step, trace)
    return tuple(_reason(reason, names) for reason in step.reasons)


def _line(label: str, text: str, width: int, *, style: str = "") -> Text:
    words = shortened(text, max(width - _LABEL - 2, 20)) if width else safe(text)
    return Text.assemble((f"  {label:<{_LABEL}}", "dim"), (words, style))


def _answer(step: ShownStep) -> str:
    if isinstance(step.answer, Trajectory):
        (x, y), ends_s = step.answer.points[-1], step.answer.time_s[-1] - step.time_s
        away_m = math.hypot(x - step.ego.x, y - step.ego.y)
        return f"a trajectory that ends {away_m:.1f} m away, {ends_s:.1f} s from now"
    control = step.answer
    pedal = f"brake {control.brake:.2f}" if control.brake > 0 else f"throttle {control.throttle:.2f}"
    side = "left" if control.steer > 0 else "right"
    return f"{pedal}, wheel {abs(control.steer):.2f} to the {side}" if abs(control.steer) >= 0.005 else pedal


def _reason(reason: Reason, names: dict[int, str]) -> str:
    actor = names.get(reason.track, f"object {reason.track}") if reason.track is not None else ""
    wish = f"{reason.acceleration_mps2:+.1f} m/s^2  " if reason.acceleration_mps2 is not None else ""
    room = f", {reason.distance_m:.1f} m" if reason.distance_m is not None else ""
    return safe(f"{wish}{reason.rule}: {actor}{' ' if actor else ''}{reason.text}{room}")


def _seen(seen: SeenActor, step: ShownStep, names: dict[int, str]) -> str:
    dx, dy = seen.x - step.ego.x, seen.y - step.ego.y
    cos, sin = math.cos(step.ego.heading_rad), math.sin(step.ego.heading_rad)
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    along = f"{abs(ahead):.1f} m {'ahead' if ahead >= 0 else 'behind'}"
    across = f"{abs(left):.1f} m {'left' if left >= 0 else 'right'}"
    name = safe(names.get(seen.track, "no actor there"))
    return f"{name} ({seen.kind}) {along}, {across}, {seen.speed_mps * 3.6:.0f} km/h"


def _names(step: ShownStep, trace: Trace) -> dict[int, str]:
    """Return the actor's id of each track: the nearest actor of its class at the time of the measurement."""
    states = trace.states[trace.frame_at(max(step.measured_s, 0.0))]
    ids: dict[int, str] = {}
    for seen in step.actors:
        away = np.hypot(states[:, X] - seen.x, states[:, Y] - seen.y)
        candidates = [k for k, info in enumerate(trace.actors) if k and info.kind == seen.kind and away[k] < SAME_M]
        if candidates:
            ids[seen.track] = trace.actors[min(candidates, key=lambda k: float(away[k]))].id
    return ids
