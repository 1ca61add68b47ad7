"""The entities of an exported scenario, and its `Init`: their places at the beginning, and the weather."""

from __future__ import annotations

import math

from foresee_dsl.compile.bundle import ActorKind, ModelSpec, Scene
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.simulate.sensing.weather import FOG_VISIBILITY_M, RAIN_MM_H
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_exchange.openscenario.writing.library import (
    Xosc,
    at_once,
    behind_centre_m,
    figure,
    osc,
    reference_position,
)

CATEGORIES: dict[ActorKind, str] = {
    **{kind: kind for kind in ("car", "van", "truck", "bus", "bicycle")},
    "motorcycle": "motorbike",
}
"""OpenSCENARIO's category of each kind of vehicle."""
CLEAR_M = 100_000.0
"""Visual range that means no fog, m (ours; OpenSCENARIO has no value for it)."""
SUN_LUX = 100_000.0
"""Direct sunlight at a clear noon, lx: up to 100 klx on the ground (common tables of illuminance)."""
LOW_SUN_RAD, HIGH_SUN_RAD = 0.15, 0.8
"""Elevation of a low sun, which dazzles (ours: below 10 degrees), and of any other, rad."""
_WHEEL_M = {"truck": 1.0, "bus": 1.0, "motorcycle": 0.6, "bicycle": 0.7}
_CAR_WHEEL_M = 0.65
"""Diameters of wheels, m: usual sizes without effect here (ours)."""
_TRACK = 0.85
"""Track width as a share of the vehicle's width (ours: 1.55 m of 1.8 m)."""
MODEL, BRAKING, CRUISE, STEER_RATE = "foresee:model", "foresee:braking", "foresee:cruise_speed", "foresee:steer_rate"
"""Properties of an entity for values that OpenSCENARIO has no place for: the model's name, its comfortable braking
(m/s^2), its own walking or driving speed (m/s), and its steering rate (rad/s)."""
WALKS = {
    "max_speed": "foresee:max_speed",
    "acceleration": "foresee:acceleration",
    "emergency_braking": "foresee:emergency_braking",
}
"""Properties of pedestrians that only vehicles have a place for, in m/s and m/s^2."""


def entities(trace: Trace, specs: dict[str, ModelSpec]) -> Xosc:
    """Return all actors of a run as entities; `specs` has their models by id."""
    objects = osc.Entities()
    for info in trace.actors:
        objects.add_scenario_object(info.id, _object(specs[info.id]))
    return objects


def init(trace: Trace, specs: dict[str, ModelSpec], scene: Scene) -> Xosc:
    """Return the weather, and the places and speeds of the actors that are present in the first frame."""
    start = osc.Init()
    if scene.rain or scene.fog or scene.sun or scene.friction < DRY_FRICTION:
        start.add_global_action(_weather(scene))
    for k, info in enumerate(trace.actors):
        row = trace.states[0, k]
        if math.isnan(row[X]):
            continue
        place = reference_position(row[X], row[Y], row[HEADING], specs[info.id])
        start.add_init_action(info.id, osc.TeleportAction(place))
        if specs[info.id].kind != "obstacle":
            start.add_init_action(info.id, osc.AbsoluteSpeedAction(figure(row[SPEED]), at_once()))
    return start


def _weather(scene: Scene) -> Xosc:
    """Return the action that sets the weather: ratios are converted to visual range, mm/h and friction."""
    low = scene.sun > 0
    rain = osc.PrecipitationType.rain if scene.rain else osc.PrecipitationType.dry
    weather = osc.Weather(
        osc.FractionalCloudCover.zeroOktas if low else osc.FractionalCloudCover.fourOktas,
        sun=osc.Sun(SUN_LUX * scene.sun if low else SUN_LUX / 10, 0, LOW_SUN_RAD if low else HIGH_SUN_RAD),
        fog=osc.Fog(figure(FOG_VISIBILITY_M / scene.fog) if scene.fog else CLEAR_M),
        precipitation=osc.Precipitation(rain, figure(RAIN_MM_H * scene.rain)),
    )
    road = osc.RoadCondition(figure(scene.friction / DRY_FRICTION))
    environment = osc.Environment("weather", osc.TimeOfDay(False, 2020, 6, 21, 12, 0, 0), weather, road)
    return osc.EnvironmentAction(environment)


def _object(spec: ModelSpec) -> Xosc:
    size = (figure(spec.width_m), figure(spec.length_m), figure(spec.height_m))
    box = osc.BoundingBox(*size, figure(behind_centre_m(spec)), 0, figure(spec.height_m / 2))
    if spec.kind == "pedestrian":
        new_object = osc.Pedestrian(spec.name, figure(spec.mass_kg), osc.PedestrianCategory.pedestrian, box, spec.name)
        values = (spec.max_speed_mps, spec.acceleration_mps2, spec.emergency_braking_mps2)
        for name, value in zip(WALKS.values(), values, strict=True):
            new_object.add_property(name, str(figure(value)))
    elif spec.kind in WHEELS:
        new_object = _vehicle(spec, box)
    else:
        new_object = osc.MiscObject(spec.name, figure(spec.mass_kg), osc.MiscObjectCategory.obstacle, box)
    new_object.add_property(MODEL, spec.name)
    if spec.kind != "obstacle":
        new_object.add_property(BRAKING, str(figure(spec.braking_mps2)))
    if spec.cruise_mps is not None:
        new_object.add_property(CRUISE, str(figure(spec.cruise_mps)))
    return new_object


def _vehicle(spec: ModelSpec, box: Xosc) -> Xosc:
    wheel = _WHEEL_M.get(spec.kind, _CAR_WHEEL_M)
    track = figure(_TRACK * spec.width_m)
    vehicle = osc.Vehicle(
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
    vehicle.add_property(STEER_RATE, str(figure(spec.steer_rate_rad_s)))
    return vehicle
