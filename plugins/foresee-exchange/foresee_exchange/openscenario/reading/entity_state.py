"""The state of an entity while its actions are read."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_exchange.openscenario.reading.entities import Entity
from foresee_exchange.openscenario.reading.ways.trajectories import SpeedProfile


@dataclass
class EntityState:
    """The state of an entity while its actions are read.

    Attributes:
        speed_mps: its speed, m/s; None if unknown.
        lane: its lane's id; None if its road is unknown. ahead: it faces in the road's direction.
        on_lanes: it follows lanes and can change them.
        way: the routing action that determines its way.
        profile: the speeds of its trajectory, which actions apply once the trajectory begins.
        most_mps: the highest speed ordered so far, m/s.
        rises_mps2, falls_mps2: the strongest acceleration and braking that the orders need, m/s^2.
    """

    entity: Entity
    speed_mps: float | None = None
    lane: int | None = None
    ahead: bool = True
    on_lanes: bool = False
    way: Element | None = None
    profile: SpeedProfile | None = None
    most_mps: float = 0.0
    rises_mps2: float = 0.0
    falls_mps2: float = 0.0

    def __post_init__(self) -> None:
        self.most_mps = max(self.most_mps, self.speed_mps or 0.0)

    def changes(self, was: float, to: float, over_s: float, *, within_limits: bool) -> None:
        """Record a change of speed that its model must be able to do; `within_limits`: braking is at most as strong as
        that of the file's vehicle."""
        rises, falls = (to - was) / over_s, (was - to) / over_s
        if within_limits:
            rises, falls = 0.0, min(falls, self.entity.spec.emergency_braking_mps2)
        self.rises_mps2, self.falls_mps2 = max(self.rises_mps2, rises), max(self.falls_mps2, falls)
