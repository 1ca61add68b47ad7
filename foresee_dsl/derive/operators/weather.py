"""Heavy weather: the paper's fifth question changes the weather of a clip and nothing else (section 4.4)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from numpy.random import Generator

from foresee_dsl.derive.operators.situation import ActorsRun, BuiltIn, Situation
from foresee_dsl.derive.presets import Preset
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.language.model import Change, Quantity

HEAVY: Mapping[str, float] = MappingProxyType({"rain": 1.0, "fog": 0.5, "wetness": 1.0})
"""The paper names high fog density, wetness and precipitation, and a sun at 45 degrees, which dazzles nobody. Ours: as
much rain and water as there can be, and fog in which one sees 100 m."""


class HeavyWeather(BuiltIn):
    """As much rain and wetness as there can be, in fog; nothing is drawn."""

    name, property = "heavy_weather", "weather"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Return what becomes worse."""
        del target, preset, rng
        return tuple(
            Change(actor="weather", property=name, was=situation.weather[name], now=Quantity.of(value, "ratio", 2))
            for name, value in HEAVY.items()
            if situation.weather[name].si < value
        )

    def letter_target(self, situation: Situation) -> str:
        """The weather is nobody's."""
        del situation
        return "weather"

    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Return the track as it was: the roll-out knows no weather."""
        del change, run
        return boxes
