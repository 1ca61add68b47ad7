"""An ego of constant speed, in our run and in the player's: what the other actors do depends on it alone."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from foresee_exchange.openscenario.reading.source import Source

from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits

_LOOKS_AHEAD_M, _LOOKS_AHEAD_S = 6.0, 0.8
_GAIN_PER_S = 3.0
"""Ours: the speed of an ego that steers through a bend stays within 0.1 m/s."""


class SteadyDriver:
    """Follows the middle of its route (pure pursuit) with the speed that it begins with."""

    name, version = "steady", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin a run; `seed` is not used."""
        del seed
        self._line, self._vehicle = np.asarray(mission.centreline)[:, :2], vehicle
        self._speed_mps: float | None = None

    def step(self, observation: Observation) -> Control:
        """Return pedals that keep the speed, and the wheel towards the route."""
        ego = observation.ego
        if self._speed_mps is None:
            self._speed_mps = ego.speed_mps
        reach_m = max(_LOOKS_AHEAD_M, ego.speed_mps * _LOOKS_AHEAD_S)
        nearest = int(np.hypot(*(self._line - (ego.x, ego.y)).T).argmin())
        along = np.cumsum(np.hypot(*np.diff(self._line[nearest:], axis=0).T))
        x, y = self._line[min(nearest + int(np.searchsorted(along, reach_m)), len(self._line) - 1)]
        angle = math.remainder(math.atan2(y - ego.y, x - ego.x) - ego.heading_rad, math.tau)
        steer = math.atan2(2 * self._vehicle.wheelbase_m * math.sin(angle), reach_m) / self._vehicle.steer_max_rad
        wanted = _GAIN_PER_S * (self._speed_mps - ego.speed_mps)
        return Control(
            min(max(steer, -1.0), 1.0),
            min(max(wanted / self._vehicle.acceleration_mps2, 0.0), 1.0),
            min(max(-wanted / self._vehicle.emergency_braking_mps2, 0.0), 1.0),
        )


def steady_copy(source: Source, ego: str, until_s: float) -> Path:
    """Write the file beside itself, without what changes the ego's speed and lane, and without an earlier end.

    The ego's events stay, as others may wait for them; in place of such an action each has one that does nothing.
    """
    tree = ElementTree.parse(source.path)
    root = tree.getroot()
    for group in root.iter("ManeuverGroup"):
        refs = {entity.get("entityRef", "") for entity in group.iterfind("Actors/EntityRef")}
        if refs != {ego}:
            continue
        for action in group.iter("Action"):
            for private in action.findall("PrivateAction"):
                if private.find("RoutingAction") is None:
                    action.remove(private)
                    nothing = ElementTree.SubElement(action, "UserDefinedAction")
                    ElementTree.SubElement(nothing, "CustomCommandAction", {"type": "none"})
    for entity in root.iter("ScenarioObject"):
        if entity.get("name") == ego:
            for controller in entity.findall("ObjectController"):
                entity.remove(controller)
    for private in root.iter("Private"):
        if private.get("entityRef") == ego:
            for action in private.findall("PrivateAction"):
                dynamics = action.find("LongitudinalAction/SpeedAction/SpeedActionDynamics")
                ramp = dynamics is not None and dynamics.get("dynamicsShape") != "step"
                if ramp or any(
                    action.find(tag) is not None for tag in ("ControllerAction", "ActivateControllerAction")
                ):
                    private.remove(action)
    storyboard = root.find("Storyboard")
    assert storyboard is not None
    for end in storyboard.findall("StopTrigger"):
        storyboard.remove(end)
    group = ElementTree.SubElement(ElementTree.SubElement(storyboard, "StopTrigger"), "ConditionGroup")
    condition = ElementTree.SubElement(group, "Condition", {"name": "end", "delay": "0", "conditionEdge": "none"})
    by_value = ElementTree.SubElement(condition, "ByValueCondition")
    ElementTree.SubElement(by_value, "SimulationTimeCondition", {"value": f"{until_s}", "rule": "greaterThan"})
    copy = source.path.with_name(f"{source.path.stem}__steady.xosc")
    tree.write(copy)
    return copy
