"""The colours of the signals, kept for a moment where a lorry or a bend takes one out of sight."""

from __future__ import annotations

from collections.abc import Mapping

from foresee_dsl.drivers.protocol import Observation, SignalColour

KEPT_S = 1.0
"""Ours: how long a colour counts that is not seen any more; a third of the shortest amber time (3 s), so that nobody
drives by a green that has become red."""


class SignalMemory:
    """What is known of the signals on the way."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[float, SignalColour]] = {}

    def update(self, observation: Observation) -> Mapping[str, SignalColour]:
        """Take in an observation, and return the colours that are seen or were seen within `KEPT_S`, by signal."""
        now_s = observation.time_s
        if not observation.signals and not self._known:
            return {}
        self._known.update((signal, (now_s, colour)) for signal, colour in observation.signals.items())
        if len(self._known) > len(observation.signals):
            self._known = {k: seen for k, seen in self._known.items() if 0.0 <= now_s - seen[0] <= KEPT_S}
        return {signal: colour for signal, (_, colour) in self._known.items()}
