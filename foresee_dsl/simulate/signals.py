"""What the signals of SUMO's world show, asked of SUMO only when one may have switched."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

from foresee_dsl.compile.bundle import Signal, SumoBundle
from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.simulate.trace import STEP_S

COLOURS: Mapping[str, SignalColour] = {"r": "red", "s": "red", "u": "amber", "y": "amber", "g": "green", "G": "green"}


def colour_shown(state: str, link: int) -> SignalColour:
    """Return what a signal with this state string shows to one of its links."""
    return COLOURS.get(state[link], "off")


class Signals:
    """The signals of one run.

    Args:
        sumo: libsumo, with the bundle's network loaded. begins_s: SUMO's time when the run begins, s.
    """

    def __init__(self, sumo: ModuleType, bundle: SumoBundle, begins_s: float = 0.0) -> None:
        self._lights, self._begins_s, self._steps = sumo.trafficlight, begins_s, 0
        self._signals: dict[str, Signal] = {signal.tls: signal for signal in bundle.signals.values()}
        self._by_junction: Mapping[str, Signal] = bundle.signals
        self._shown: dict[str, tuple[int, float, float]] = {}
        self._states: dict[str, str] = {}
        self.now_s = 0.0
        """SUMO's time since the run began, s."""

    def look(self) -> None:
        """Take note that SUMO has taken a step."""
        self._steps += 1
        self.now_s = round(self._steps * STEP_S, 6)

    def _since_begin(self, time_s: float) -> float:
        # SUMO counts milliseconds: rounded, the difference is the very number that a run from 0 has.
        return round(time_s - self._begins_s, 6)

    def start(self, bundle: SumoBundle, lead_s: float) -> None:
        """Set the signals so that they are as the scene says after `lead_s`; others at the beginning of a stage."""
        begins = {junction: (stage, elapsed) for junction, stage, elapsed in bundle.scene.signals}
        for signal in bundle.signals.values():
            stage, elapsed = begins.get(signal.junction, (signal.stages[signal.phases[0].stage], 0.0))
            phase, left_s = signal.phase_at(stage, elapsed)
            self._shown.pop(signal.tls, None)
            # The phase for the time that is left of it; the program continues from there.
            self._lights.setPhase(signal.tls, phase)
            self._lights.setPhaseDuration(signal.tls, left_s + lead_s)

    def turn(self, junction: str, stage: str, light: str | None) -> None:
        """Show a stage from its beginning, or from where its `amber` or `red` begins; its program goes on from there.

        A `KeyError` for what the signal does not have.
        """
        signal = self._by_junction[junction]
        phase = signal.phase_of(stage, light)
        if phase is None:
            raise KeyError(stage)
        self._shown.pop(signal.tls, None)
        self._lights.setPhase(signal.tls, phase)
        self._lights.setPhaseDuration(signal.tls, signal.phases[phase].duration_s)

    def stage(self, tls: str) -> tuple[int, float]:
        """Return the stage that a signal shows (index) and the time since it began."""
        stage, since_s, _ = self.shown(tls)
        return stage, self.now_s - since_s

    def shown(self, tls: str) -> tuple[int, float, float]:
        """Return the stage that a signal shows, when it began, and until when, in SUMO's time since the run began."""
        known = self._shown.get(tls)
        if known is None or self.now_s >= known[2]:
            phase = self._signals[tls].phases[self._lights.getPhase(tls)]
            until_s = self._since_begin(self._lights.getNextSwitch(tls))
            known = self._shown[tls] = phase.stage, until_s - phase.duration_s - phase.since_stage_s, until_s
            self._states[tls] = str(self._lights.getRedYellowGreenState(tls))
        return known

    def state(self, tls: str) -> str:
        """Return the state string that a signal shows now."""
        self.shown(tls)
        return self._states[tls]

    def colour(self, tls: str, link: int) -> SignalColour:
        """Return what a signal shows to one of its links."""
        return colour_shown(self.state(tls), link)
