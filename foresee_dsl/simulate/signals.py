"""Reads the stages and colours of SUMO's signals; SUMO is queried only when a signal may have switched."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

from foresee_dsl.compile.bundle import Signal, SumoBundle
from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.simulate.trace import STEP_S, Trace

COLOURS: Mapping[str, SignalColour] = {"r": "red", "s": "red", "u": "amber", "y": "amber", "g": "green", "G": "green"}


def colour_shown(state: str, link: int) -> SignalColour:
    """Return the colour of one link of a signal with this state string."""
    return COLOURS.get(state[link], "off")


def state_at(signal: Signal, trace: Trace, column: int, frame: int) -> str:
    """Return the state string of a signal at a frame of a trace; `column`: the signal's index in `trace.signals`."""
    stage = trace.signal_stages[column][trace.stages[frame, column]]
    phase, _ = signal.phase_at(stage, float(trace.elapsed[frame, column]))
    return signal.phases[phase].state


class Signals:
    """The signals of one run.

    Args:
        sumo: libsumo, with the bundle's network loaded. begins_s: SUMO's time when the run begins, s.
    """

    def __init__(self, sumo: ModuleType, bundle: SumoBundle, begins_s: float = 0.0) -> None:
        self._lights, self._begins_s, self._steps = sumo.trafficlight, begins_s, 0
        self._signals: dict[str, Signal] = {signal.tls: signal for signal in bundle.signals.values()}
        self._by_junction: Mapping[str, Signal] = bundle.signals
        self._spans: dict[str, tuple[int, float, float]] = {}
        self._states: dict[str, str] = {}
        self.now_s = 0.0
        """SUMO's time since the run began, s."""

    def look(self) -> None:
        """Advance `now_s` after a step of SUMO."""
        self._steps += 1
        self.now_s = round(self._steps * STEP_S, 6)

    def _since_begin(self, time_s: float) -> float:
        # SUMO counts milliseconds, so the rounded difference equals the time in a run that begins at 0.
        return round(time_s - self._begins_s, 6)

    def start(self, bundle: SumoBundle, lead_s: float) -> None:
        """Set the signals so that after `lead_s` they are as the scene says; signals that the scene does not state
        begin their first stage.
        """
        begins = {junction: (stage, elapsed) for junction, stage, elapsed in bundle.scene.signals}
        for signal in bundle.signals.values():
            stage, elapsed = begins.get(signal.junction, (signal.stages[signal.phases[0].stage], 0.0))
            phase, left_s = signal.phase_at(stage, elapsed)
            self._spans.pop(signal.tls, None)
            # Set the phase with its remaining time as duration; from there SUMO continues the signal's program.
            self._lights.setPhase(signal.tls, phase)
            self._lights.setPhaseDuration(signal.tls, left_s + lead_s)

    def turn(self, junction: str, stage: str, light: str | None) -> None:
        """Switch a signal to the beginning of a stage, or of the stage's `amber` or `red`; its program goes on there.

        Raises `KeyError` if the signal does not have this stage or light.
        """
        signal = self._by_junction[junction]
        phase = signal.phase_of(stage, light)
        if phase is None:
            raise KeyError(stage)
        self._spans.pop(signal.tls, None)
        self._lights.setPhase(signal.tls, phase)
        self._lights.setPhaseDuration(signal.tls, signal.phases[phase].duration_s)

    def stage(self, tls: str) -> tuple[int, float]:
        """Return the current stage of a signal (index) and the time since it began, s."""
        stage, since_s, _ = self.stage_span(tls)
        return stage, self.now_s - since_s

    def stage_span(self, tls: str) -> tuple[int, float, float]:
        """Return the current stage of a signal (index), the time at which the stage began, and the time at which the
        current phase ends, which may be only a part of the stage; both times in s since the run began.
        """
        span = self._spans.get(tls)
        if span is None or self.now_s >= span[2]:
            phase = self._signals[tls].phases[self._lights.getPhase(tls)]
            until_s = self._since_begin(self._lights.getNextSwitch(tls))
            span = self._spans[tls] = phase.stage, until_s - phase.duration_s - phase.since_stage_s, until_s
            self._states[tls] = str(self._lights.getRedYellowGreenState(tls))
        return span

    def state(self, tls: str) -> str:
        """Return the current state string of a signal."""
        self.stage_span(tls)
        return self._states[tls]

    def colour(self, tls: str, link: int) -> SignalColour:
        """Return the current colour of one link of a signal."""
        span = self._spans.get(tls)
        if span is None or self.now_s >= span[2]:
            self.stage_span(tls)
        return colour_shown(self._states[tls], link)
