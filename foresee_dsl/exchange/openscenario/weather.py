"""Weather here and in OpenSCENARIO: ratios from 0 to 1 there, visual range, millimetres an hour and friction here."""

from __future__ import annotations

from typing import Any

from foresee_dsl.compile.bundle import Scene
from foresee_dsl.compile.placement.scene import DRY_FRICTION, WET_FRICTION
from foresee_dsl.exchange.openscenario.writing.library import figure, library
from foresee_dsl.simulate.sensing.weather import FOG_VISIBILITY_M, RAIN_MM_H

CLEAR_M = 100_000.0
"""The visual range that says that there is no fog (ours; OpenSCENARIO has no word for it)."""
SUN_LUX = 100_000.0
"""Direct sunlight, illuminance of a clear noon (cited from memory and not checked)."""
LOW_SUN_RAD = 0.15
"""The elevation of a low sun, which dazzles: under 10 degrees (ours)."""
HIGH_SUN_RAD = 0.8


def environment(scene: Scene) -> Any:  # noqa: ANN401 - the library has no types
    """Return the action that sets a scene's weather, or None where it is the usual one."""
    if not (scene.rain or scene.fog or scene.sun or scene.friction < DRY_FRICTION):
        return None
    osc = library()
    low = scene.sun > 0
    rain = osc.PrecipitationType.rain if scene.rain else osc.PrecipitationType.dry
    weather = osc.Weather(
        osc.FractionalCloudCover.zeroOktas if low else osc.FractionalCloudCover.fourOktas,
        sun=osc.Sun(SUN_LUX * scene.sun if low else SUN_LUX / 10, 0, LOW_SUN_RAD if low else HIGH_SUN_RAD),
        fog=osc.Fog(figure(FOG_VISIBILITY_M / scene.fog) if scene.fog else CLEAR_M),
        precipitation=osc.Precipitation(rain, figure(RAIN_MM_H * scene.rain)),
    )
    road = osc.RoadCondition(figure(scene.friction / DRY_FRICTION))
    made = osc.Environment("weather", osc.TimeOfDay(False, 2020, 6, 21, 12, 0, 0), weather, road)
    return osc.EnvironmentAction(made)


def ratios(visual_range_m: float | None, rain_mm_h: float | None, friction: float | None) -> dict[str, float]:
    """Return the language's ratios, those over zero.

    Args:
        visual_range_m: in fog. rain_mm_h: how much it rains. friction: the scale factor of the road.
    """
    found = {
        "fog": FOG_VISIBILITY_M / visual_range_m if visual_range_m and visual_range_m < CLEAR_M / 10 else 0.0,
        "rain": (rain_mm_h or 0.0) / RAIN_MM_H,
        "wetness": (1.0 - (1.0 if friction is None else friction)) * DRY_FRICTION / (DRY_FRICTION - WET_FRICTION),
    }
    return {name: min(round(value, 3), 1.0) for name, value in found.items() if round(value, 3) > 0}
