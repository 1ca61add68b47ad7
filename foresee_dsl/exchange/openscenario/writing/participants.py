"""Who takes part in an exported scenario, and where everybody is at the beginning."""

from __future__ import annotations

import math
from typing import Any

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.starts import WHEELS
from foresee_dsl.exchange.openscenario.writing.library import (
    at_once,
    behind_centre_m,
    figure,
    library,
    reference_point,
    world,
)
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

_CATEGORIES = {
    "car": "car",
    "van": "van",
    "truck": "truck",
    "bus": "bus",
    "motorcycle": "motorbike",
    "bicycle": "bicycle",
}
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


def entities(trace: Trace, specs: dict[str, ModelSpec]) -> Any:  # noqa: ANN401 - the library has no types
    """Return all actors of a run; `specs` by their ids."""
    cast = library().Entities()
    for info in trace.actors:
        cast.add_scenario_object(info.id, _object(specs[info.id]))
    return cast


def init(trace: Trace, specs: dict[str, ModelSpec], weather: Any) -> Any:  # noqa: ANN401 - as above
    """Return the places and speeds of those who are there at the first frame, and the weather (or None)."""
    osc = library()
    made = osc.Init()
    if weather is not None:
        made.add_global_action(weather)
    for k, info in enumerate(trace.actors):
        row = trace.states[0, k]
        if math.isnan(row[X]):
            continue
        x, y = reference_point(row[X], row[Y], row[HEADING], specs[info.id])
        made.add_init_action(info.id, osc.TeleportAction(world(x, y, row[HEADING])))
        if specs[info.id].kind != "obstacle":
            made.add_init_action(info.id, osc.AbsoluteSpeedAction(figure(row[SPEED]), at_once()))
    return made


def _object(spec: ModelSpec) -> Any:  # noqa: ANN401 - as above
    osc = library()
    box = osc.BoundingBox(
        figure(spec.width_m),
        figure(spec.length_m),
        figure(spec.height_m),
        figure(behind_centre_m(spec)),
        0,
        figure(spec.height_m / 2),
    )
    if spec.kind == "pedestrian":
        made = osc.Pedestrian(spec.name, figure(spec.mass_kg), osc.PedestrianCategory.pedestrian, box, spec.name)
    elif spec.kind in WHEELS:
        made = _vehicle(spec, box)
    else:
        made = osc.MiscObject(spec.name, figure(spec.mass_kg), osc.MiscObjectCategory.obstacle, box)
    if spec.kind == "pedestrian":
        for key, value in zip(
            WALKS, (spec.max_speed_mps, spec.acceleration_mps2, spec.emergency_braking_mps2), strict=True
        ):
            made.add_property(WALKS[key], str(figure(value)))
    made.add_property(MODEL, spec.name)
    if spec.kind != "obstacle":
        made.add_property(BRAKING, str(figure(spec.braking_mps2)))
    if spec.cruise_mps is not None:
        made.add_property(CRUISE, str(figure(spec.cruise_mps)))
    return made


def _vehicle(spec: ModelSpec, box: Any) -> Any:  # noqa: ANN401 - as above
    osc = library()
    wheel = _WHEEL_M.get(spec.kind, _CAR_WHEEL_M)
    track = figure(_TRACK * spec.width_m)
    made = osc.Vehicle(
        spec.name,
        getattr(osc.VehicleCategory, _CATEGORIES[spec.kind]),
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
