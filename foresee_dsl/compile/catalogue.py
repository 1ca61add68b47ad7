"""Converts catalogue entries to `ModelSpec`s; missing values are the defaults of the class."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import cast

from foresee_dsl.compile.bundle import ActorKind, ModelSpec
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import SUM_SLACK_M, AnyValue, Quantity, VehicleModel
from foresee_dsl.language.printer import written
from foresee_dsl.language.project.catalogues import cruise_speed_mps

_KMH = 1 / 3.6


@dataclass(frozen=True, slots=True)
class ClassDefaults:
    """Default values of a class; wheelbase and front overhang are shares of the length."""

    wheelbase_share: float
    overhang_share: float
    mass_kg: float
    max_speed_mps: float
    acceleration_mps2: float
    braking_mps2: float
    emergency_braking_mps2: float
    max_steer_deg: float
    steer_rate_deg_s: float
    height_m: float


# Acceleration and both brakings: SUMO's documentation, "Vehicle Type Parameter Defaults" (classes passenger, delivery,
# truck, bus, motorcycle, bicycle, pedestrian), except the motorcycle's braking: SUMO's 10 m/s^2 (both) is more than a
# road gives; ours are 5 and 9 m/s^2. Top speeds and masses: ours, usual values of the class; SUMO's top speeds of
# 200 km/h (vans), 130 km/h (lorries), 50 km/h (bicycles) and 37.6 km/h (on foot) are those of the fastest.
# Shares: ours, typical of the class (a compact: 2.6 m and 0.85 m of 4.2 m).
# Steering: ours. 35 deg gives a car of 2.7 m wheelbase its usual turning circle of 11 m; 40 deg/s results from a
# steering wheel that is turned at 600 deg/s, as in an evasive manoeuvre, with a steering ratio of 15; heavy vehicles
# have a ratio of about 20. Obstacles do not move. Heights: ours, usual of the class, with the rider; SUMO 1.28's own
# are 1.5 m (car, motorcycle), 2.86 m (van), 2.4 m (lorry), 3.4 m (bus), 1.7 m (bicycle) and 1.719 m (on foot), as
# libsumo's `vehicletype.getHeight` gives them.
CLASS_DEFAULTS: Mapping[ActorKind, ClassDefaults] = MappingProxyType(
    {
        "car": ClassDefaults(0.61, 0.20, 1500, 180 * _KMH, 2.6, 4.5, 9.0, 35, 40, 1.5),
        "van": ClassDefaults(0.61, 0.17, 2500, 160 * _KMH, 2.6, 4.5, 9.0, 36, 35, 2.3),
        "truck": ClassDefaults(0.55, 0.16, 12000, 90 * _KMH, 1.3, 4.0, 7.0, 42, 30, 3.5),
        "bus": ClassDefaults(0.50, 0.23, 12000, 85 * _KMH, 1.2, 4.0, 7.0, 45, 30, 3.1),
        "motorcycle": ClassDefaults(0.67, 0.15, 280, 180 * _KMH, 6.0, 5.0, 9.0, 38, 60, 1.6),
        "bicycle": ClassDefaults(0.60, 0.19, 90, 25 * _KMH, 1.2, 3.0, 7.0, 50, 90, 1.75),
        "pedestrian": ClassDefaults(0.0, 0.0, 75, 5.0, 1.5, 2.0, 5.0, 0, 0, 1.7),
        "obstacle": ClassDefaults(0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 1.0),
    }
)
"""Defaults by class: the word before the dot in a model's name."""
USUAL_HEIGHTS_M: Mapping[str, float] = MappingProxyType({kind: base.height_m for kind, base in CLASS_DEFAULTS.items()})
"""Height of actors whose model is not at hand, m, by class."""


def spec_of(model: VehicleModel) -> ModelSpec:
    """Return a catalogue entry with all values filled in.

    Raises:
        CompileError: its class is unknown, a value is a parameter or is not positive although it must be, wheelbase and
            overhangs do not add up to its length, or its cruise speed exceeds its maximum speed.
    """
    kind = model.name.partition(".")[0]
    if kind not in CLASS_DEFAULTS:
        raise CompileError(f"model {model.name}: the class {kind} is not one of {', '.join(CLASS_DEFAULTS)}")
    actor_kind = cast(ActorKind, kind)
    base = CLASS_DEFAULTS[actor_kind]
    length = _si(model, model.length, 0.0)
    front, wheelbase = _axles(model, base, length)
    spec = ModelSpec(
        name=model.name,
        kind=actor_kind,
        length_m=length,
        width_m=_si(model, model.width, 0.0),
        wheelbase_m=wheelbase,
        front_overhang_m=front,
        mass_kg=_si(model, model.mass, base.mass_kg),
        max_speed_mps=_si(model, model.max_speed, base.max_speed_mps),
        acceleration_mps2=_si(model, model.acceleration, base.acceleration_mps2),
        braking_mps2=_si(model, model.braking, base.braking_mps2),
        emergency_braking_mps2=_si(model, model.emergency_braking, base.emergency_braking_mps2),
        max_steer_rad=_si(model, model.max_steer, math.radians(base.max_steer_deg)),
        steer_rate_rad_s=_si(model, model.steer_rate, math.radians(base.steer_rate_deg_s)),
        height_m=_si(model, model.height, base.height_m),
        cruise_mps=None if actor_kind == "obstacle" else _cruise(model),
    )
    _check(spec)
    return spec


def cruise_speed(spec: ModelSpec, limit_mps: float) -> float:
    """Return the default speed of an actor on a road with the limit `limit_mps`, m/s."""
    top = spec.max_speed_mps if spec.cruise_mps is None else min(spec.cruise_mps, spec.max_speed_mps)
    return min(limit_mps, top)


def _axles(model: VehicleModel, base: ClassDefaults, length_m: float) -> tuple[float, float]:
    """Return front overhang and wheelbase, m; if one part is not stated, it is the length minus the other two."""
    front, wheelbase = base.overhang_share * length_m, base.wheelbase_share * length_m
    stated_front, stated_wheelbase = _si(model, model.front_overhang, front), _si(model, model.wheelbase, wheelbase)
    if model.rear_overhang is None:
        return stated_front, stated_wheelbase
    rest = length_m - _si(model, model.rear_overhang, 0.0)
    if model.wheelbase is None:
        return stated_front, rest - stated_front
    if model.front_overhang is None:
        return rest - stated_wheelbase, stated_wheelbase
    if abs(rest - stated_front - stated_wheelbase) > SUM_SLACK_M:
        raise CompileError(f"model {model.name}: overhangs and wheelbase do not make up its length")
    return stated_front, stated_wheelbase


def _cruise(model: VehicleModel) -> float | None:
    _si(model, model.cruise_speed, 0.0)
    return cruise_speed_mps(model)


def _check(spec: ModelSpec) -> None:
    wheels = spec.kind not in ("pedestrian", "obstacle")
    positive = ["length_m", "width_m", "height_m"]
    if spec.kind != "obstacle":
        positive.append("max_speed_mps")
    if wheels:
        positive += ["wheelbase_m", "mass_kg", "acceleration_mps2", "braking_mps2", "max_steer_rad", "steer_rate_rad_s"]
    for name in positive:
        if getattr(spec, name) <= 0:
            raise CompileError(f"model {spec.name}: its {name.rpartition('_')[0]} must be above zero")
    if wheels and spec.front_overhang_m + spec.wheelbase_m > spec.length_m:
        raise CompileError(f"model {spec.name}: front overhang and wheelbase together are longer than the vehicle")
    if spec.emergency_braking_mps2 < spec.braking_mps2:
        raise CompileError(f"model {spec.name}: its emergency braking is weaker than its braking")
    if spec.front_overhang_m < 0:
        raise CompileError(f"model {spec.name}: rear overhang and wheelbase together are longer than the vehicle")
    if wheels and spec.max_steer_rad >= math.radians(80):
        raise CompileError(f"model {spec.name}: wheels cannot be turned by 80 deg or more")


def _si(model: VehicleModel, value: AnyValue | None, default: float) -> float:
    if value is None:
        return default
    if not isinstance(value, Quantity):
        raise CompileError(f"model {model.name} cannot use the parameter in `{written(value)}`")
    return value.si
