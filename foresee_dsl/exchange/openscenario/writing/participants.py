"""The entities of an exported scenario, and its `Init`: where each is at the beginning, and the weather."""

from __future__ import annotations

import math

from foresee_dsl.compile.bundle import ActorKind, ModelSpec, Scene
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.exchange.openscenario.writing.library import (
    Xosc,
    at_once,
    behind_centre_m,
    figure,
    osc,
    reference_position,
)
from foresee_dsl.simulate.sensing.weather import FOG_VISIBILITY_M, RAIN_MM_H
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

CATEGORIES: dict[ActorKind, str] = {
    **{kind: kind for kind in ("car", "van", "truck", "bus", "bicycle")},
    "motorcycle": "motorbike",
}
"""OpenSCENARIO's vehicle category of each kind of vehicle."""
CLEAR_M = 100_000.0
"""The visual range that says that there is no fog (ours; OpenSCENARIO has no word for it)."""
SUN_LUX = 100_000.0
"""Direct sunlight at a clear noon, lx: up to 100 klx on the ground (common tables of illuminance)."""
LOW_SUN_RAD, HIGH_SUN_RAD = 0.15, 0.8
"""The elevation of a low sun, which dazzles (ours: under 10 degrees), and of any other."""
_WHEEL_M = {"truck": 1.0, "bus": 1.0, "motorcycle": 0.6, "bicycle": 0.7}
_CAR_WHEEL_M = 0.65
"""Wheels' diameters, of which nothing depends here: usual sizes (ours)."""
_TRACK = 0.85
"""The track as a share of the width (ours: 1.55 m of 1.8 m)."""
MODEL, BRAKING, CRUISE, STEER_RATE = "foresee:model", "foresee:braking", "foresee:cruise_speed", "foresee:steer_rate"
"""Properties of an entity that say what OpenSCENARIO has no place for: the model's name, its comfortable braking
(m/s^2), what it walks or drives by itself (m/s), and how fast its wheels turn (rad/s)."""
WALKS = {
    "max_speed": "foresee:max_speed",
    "acceleration": "foresee:acceleration",
    "emergency_braking": "foresee:emergency_braking",
}
"""What vehicles have a place for and pedestrians not, in m/s and m/s^2."""


def entities(trace: Trace, specs: dict[str, ModelSpec]) -> Xosc:
    """Return all actors of a run; `specs` by their ids."""
    found = osc.Entities()
    for info in trace.actors:
        found.add_scenario_object(info.id, _object(specs[info.id]))
    return found


def init(trace: Trace, specs: dict[str, ModelSpec], scene: Scene) -> Xosc:
    """Return the weather, and the places and speeds of the actors that are there in the first frame."""
    made = osc.Init()
    if scene.rain or scene.fog or scene.sun or scene.friction < DRY_FRICTION:
        made.add_global_action(_weather(scene))
    for k, info in enumerate(trace.actors):
        row = trace.states[0, k]
        if math.isnan(row[X]):
            continue
        place = reference_position(row[X], row[Y], row[HEADING], specs[info.id])
        made.add_init_action(info.id, osc.TeleportAction(place))
        if specs[info.id].kind != "obstacle":
            made.add_init_action(info.id, osc.AbsoluteSpeedAction(figure(row[SPEED]), at_once()))
    return made


def _weather(scene: Scene) -> Xosc:
    """Return the action that sets the weather: ratios from 0 to 1 here, visual range, mm/h and friction there."""
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


def _object(spec: ModelSpec) -> Xosc:
    size = (figure(spec.width_m), figure(spec.length_m), figure(spec.height_m))
    box = osc.BoundingBox(*size, figure(behind_centre_m(spec)), 0, figure(spec.height_m / 2))
    if spec.kind == "pedestrian":
        made = osc.Pedestrian(spec.name, figure(spec.mass_kg), osc.PedestrianCategory.pedestrian, box, spec.name)
        values = (spec.max_speed_mps, spec.acceleration_mps2, spec.emergency_braking_mps2)
        for name, value in zip(WALKS.values(), values, strict=True):
            made.add_property(name, str(figure(value)))
    elif spec.kind in WHEELS:
        made = _vehicle(spec, box)
    else:
        made = osc.MiscObject(spec.name, figure(spec.mass_kg), osc.MiscObjectCategory.obstacle, box)
    made.add_property(MODEL, spec.name)
    if spec.kind != "obstacle":
        made.add_property(BRAKING, str(figure(spec.braking_mps2)))
    if spec.cruise_mps is not None:
        made.add_property(CRUISE, str(figure(spec.cruise_mps)))
    return made


def _vehicle(spec: ModelSpec, box: Xosc) -> Xosc:
    wheel = _WHEEL_M.get(spec.kind, _CAR_WHEEL_M)
    track = figure(_TRACK * spec.width_m)
    made = osc.Vehicle(
        spec.name,
        getattr(osc.VehicleCategory, CATEGORIES[spec.kind]),
        box,
        osc.Axle(figure(spec.max_steer_rad), wheel, track, figure(spec.wheelbase_m), wheel / 2),
        osc.Axle(0, wheel, track, 0, wheel / 2),
        figure(spec.max_speed_mps),
        figure(spec.acceleration_mps2),
        figure(spec.emergency_braking_mps2),
        figure(spec.mass_kg),
    )
    made.add_property(STEER_RATE, str(figure(spec.steer_rate_rad_s)))
    return made
