"""The storyboard's `<Init>`: places, speeds, ways, weather, and actions that begin with the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.placement.scene import DRY_FRICTION, WET_FRICTION
from foresee_dsl.language import model as m
from foresee_dsl.simulate.sensing.weather import FOG_VISIBILITY_M, RAIN_MM_H
from foresee_exchange.naming import number, quantity
from foresee_exchange.openscenario.losses import Losses
from foresee_exchange.openscenario.reading.actions import ROUTING, action_name
from foresee_exchange.openscenario.reading.source import Source
from foresee_exchange.openscenario.reading.storyboard import Event
from foresee_exchange.openscenario.writing.participants import CLEAR_M

PLAIN_CONTROLLERS = (
    "simple_vehicle_control",
    "npc_vehicle_control",
    "vehicle_longitudinal_control",
    "pedestrian_control",
    "external_control",
)
"""Controllers of CARLA's scenario_runner (property `module`) that only follow lanes or a given way."""
_CONTROLLING = ("AssignControllerAction", "ActivateControllerAction", "OverrideControllerValueAction")


@dataclass
class Inits:
    """The state and actions at the beginning of the run.

    Attributes:
        positions: places of the entities; earlier: their places before a later action of `<Init>` moved them.
        speeds: in m/s. routing: their routes, targets and trajectories.
        removed: entities that are deleted at the beginning. events: their other actions.
    """

    positions: dict[str, Element] = field(default_factory=dict)
    earlier: dict[str, list[Element]] = field(default_factory=dict)
    speeds: dict[str, float] = field(default_factory=dict)
    routing: dict[str, Element] = field(default_factory=dict)
    removed: set[str] = field(default_factory=set)
    events: list[Event] = field(default_factory=list)
    _environment: Element | None = None

    @classmethod
    def read(cls, source: Source, ego: str, losses: Losses) -> Inits:
        """Read the beginning of a storyboard; controllers of `ego`, the vehicle under test, do not count."""
        inits = cls()
        actions = source.root.find("Storyboard/Init/Actions")
        for action in actions if actions is not None else ():
            if action.tag == "Private":
                for private in action.iterfind("PrivateAction"):
                    inits._private(source, action.get("entityRef", ""), private, ego, losses)
            else:
                inits._global(source, action, losses)
        return inits

    def take_at_once(self, events: list[Event]) -> None:
        """Move places and speeds from events at time 0 into the beginning, because some tools write them in such
        events."""
        for event in events:
            kept = []
            for kind in event.actions:
                position, speed = kind.find("TeleportAction/Position"), _speed_at_once(kind, self.speeds)
                if position is not None and all(ref not in self.positions for ref in event.refs):
                    self.positions |= dict.fromkeys(event.refs, position)
                elif speed is not None:
                    self.speeds |= dict.fromkeys(event.refs, speed)
                    kept.append(kind)  # other events may wait for its end, and an action of the ego is reported
                else:
                    kept.append(kind)
            event.actions = tuple(kept)

    def weather(self) -> list[m.Weather]:
        """Return the weather statement, if any: visual range, mm/h and friction are converted to ratios."""
        environment = self._environment
        if environment is None:
            return []
        fog, rain, road = (environment.find(p) for p in ("Weather/Fog", "Weather/Precipitation", "RoadCondition"))
        visual_range_m = number(fog, "visualRange", 0.0) if fog is not None else 0.0
        rain_mm_h = 0.0
        if rain is not None:  # in version 1.0 the value is a ratio
            rain_mm_h = number(rain, "precipitationIntensity", number(rain, "intensity", 0.0) * RAIN_MM_H)
        friction = number(road, "frictionScaleFactor", 1.0) if road is not None else 1.0
        ratios = {
            "fog": FOG_VISIBILITY_M / visual_range_m if visual_range_m and visual_range_m < CLEAR_M / 10 else 0.0,
            "rain": rain_mm_h / RAIN_MM_H,
            "wetness": (1.0 - friction) * DRY_FRICTION / (DRY_FRICTION - WET_FRICTION),
        }
        over_zero = {
            key: quantity(min(round(value, 3), 1.0), "ratio") for key, value in ratios.items() if round(value, 3) > 0
        }
        return [m.Weather.model_validate(over_zero)] if over_zero else []

    def _global(self, source: Source, action: Element, losses: Losses) -> None:
        kind = next(iter(action), action)
        if kind.tag == "EnvironmentAction":
            reference = kind.find("CatalogReference")
            self._environment = kind.find("Environment") if reference is None else source.entry(reference)
        elif kind.tag == "EntityAction" and (position := kind.find("AddEntityAction/Position")) is not None:
            self.positions[kind.get("entityRef", "")] = position
        elif kind.tag == "EntityAction" and kind.find("DeleteEntityAction") is not None:
            self.removed.add(kind.get("entityRef", ""))
            losses.note("entities that are deleted at the beginning are not there")
        else:
            losses.lose(f"actions: {action_name(action)}", "at the beginning")

    def _private(self, source: Source, ref: str, private: Element, ego: str, losses: Losses) -> None:
        position, speed = private.find("TeleportAction/Position"), _speed_at_once(private, self.speeds)
        tag = action_name(private)
        inner = next((e for e in private.iter() if e.tag in ROUTING), None)
        if position is not None:
            if ref in self.positions:
                self.earlier.setdefault(ref, []).append(self.positions[ref])
            self.positions[ref] = position
        elif speed is not None:
            self.speeds[ref] = speed
            relative = private.find("LongitudinalAction/SpeedAction/SpeedActionTarget/RelativeTargetSpeed")
            if relative is not None and relative.get("continuous") == "true" and ref != ego:
                self.events.append(Event("", (ref,), (private,)))  # the entity begins with that speed and keeps it
        elif inner is not None:
            self.routing[ref] = inner
        elif tag in _CONTROLLING or tag == "ControllerAction":
            if ref == ego:
                losses.left_out["controllers of the ego, whose driver decides"] += 1
            elif not _is_plain(source, ref, private):
                losses.lose("controllers of others than the ego", f"'{ref}'")
        else:
            self.events.append(Event("", (ref,), (private,)))


def _speed_at_once(action: Element, speeds: Mapping[str, float]) -> float | None:
    """Return the speed that an action sets immediately, m/s; None for other actions."""
    speed = action.find("LongitudinalAction/SpeedAction")
    if speed is None:
        return None
    dynamics, relative = speed.find("SpeedActionDynamics"), speed.find("SpeedActionTarget/RelativeTargetSpeed")
    at_once = dynamics is None or dynamics.get("dynamicsShape") == "step" or number(dynamics, "value", 0.0) == 0.0
    if not at_once:
        return None
    if relative is not None and relative.get("entityRef") in speeds:
        other, value = speeds[relative.get("entityRef", "")], number(relative, "value")
        return max(other * value if relative.get("speedTargetValueType") == "factor" else other + value, 0.0)
    target = speed.find("SpeedActionTarget/AbsoluteTargetSpeed")
    return max(number(target, "value"), 0.0) if target is not None else None


def _is_plain(source: Source, ref: str, private: Element) -> bool:
    """Return whether a controller only follows lanes or a given way, or whether there is no controller to activate."""
    for override in private.iter("OverrideControllerValueAction"):
        if any(part.get("active") == "true" for part in override):
            return False
    assigned = [*private.iter("Controller"), *private.iter("CatalogReference")]
    if assigned:
        return all(plain_controller(e) for e in assigned)
    own = source.root.find(f"Entities/ScenarioObject[@name='{ref}']/ObjectController") if "'" not in ref else None
    return own is None or not len(own) or all(plain_controller(e) for e in own)


def plain_controller(controller: Element) -> bool:
    """Return whether a `<Controller>` is one of those that only follow lanes."""
    modules = [p.get("value", "") for p in controller.iter("Property") if p.get("name") == "module"]
    named = f"{controller.get('name', '')} {controller.get('entryName', '')}".lower()
    return (bool(modules) and all(module in PLAIN_CONTROLLERS for module in modules)) or "default" in named
