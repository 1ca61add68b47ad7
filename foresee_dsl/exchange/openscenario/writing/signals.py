"""What signals show during a run, as programs for the heads that netconvert puts into the OpenDRIVE map."""

from __future__ import annotations

import re
from typing import Any

from foresee_dsl.compile.bundle import Signal, SumoBundle
from foresee_dsl.exchange.openscenario.writing.library import figure, library

_HEAD = re.compile(rb'<signal\b[^>]*?\bid="([^"]*)"')
_COLOURS = {"G": "green", "g": "green", "y": "yellow", "r": "red"}
"""SUMO's letters in words; OpenSCENARIO leaves the words to the simulators."""


def add_signals(road_network: Any, bundle: SumoBundle, road: bytes, until_s: float) -> int:  # noqa: ANN401 - no types
    """Add a controller for each signal whose heads the map has.

    A controller repeats its phases; the first one is what is left of it at the beginning, and so many follow that it
    repeats nothing before the end.

    Args:
        road_network: gets the controllers. bundle: the test case. road: its map. until_s: when the scenario ends.

    Returns:
        How many signals have no heads in the map.
    """
    heads = {found.decode() for found in _HEAD.findall(road)}
    said = {junction: (stage, elapsed_s) for junction, stage, elapsed_s in bundle.scene.signals}
    missing = 0
    for signal in {s.tls: s for s in bundle.signals.values()}.values():
        links = [k for k in range(len(signal.phases[0].state)) if f"{signal.tls}_{k}" in heads]
        if not links:
            missing += 1
            continue
        controller = library().TrafficSignalController(signal.tls)
        for k, (phase, duration_s) in enumerate(_shown(signal, said.get(signal.junction), until_s)):
            made = library().Phase(f"{signal.stages[signal.phases[phase].stage]}_{k + 1}", figure(duration_s))
            for link in links:
                letter = signal.phases[phase].state[link]
                made.add_signal_state(f"{signal.tls}_{link}", _COLOURS.get(letter, "off"))
            controller.add_phase(made)
        road_network.add_traffic_signal_controller(controller)
    return missing


def _shown(signal: Signal, at: tuple[str, float] | None, until_s: float) -> list[tuple[int, float]]:
    """Return the phases that a signal goes through, each with its time, s."""
    stage, elapsed_s = at or (signal.stages[signal.phases[0].stage], 0.0)
    phase, left_s = signal.phase_at(stage, elapsed_s)
    found = [(phase, left_s)] if left_s > 0 else []
    covered = left_s
    while covered <= until_s:
        phase = (phase + 1) % len(signal.phases)
        found.append((phase, signal.phases[phase].duration_s))
        covered += max(signal.phases[phase].duration_s, 0.05)
    return found
