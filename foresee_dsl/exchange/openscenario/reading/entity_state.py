"""What is known of an entity while its actions are read."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.exchange.openscenario.reading.entities import Entity
from foresee_dsl.exchange.openscenario.reading.ways.trajectories import SpeedProfile


@dataclass
class EntityState:
    """What is known of an entity while its actions are read.

    Attributes:
        speed_mps: what it drives as far as is known, m/s.
        lane: its lane's id, where its road is known; ahead: it looks in the road's direction.
        on_lanes: it follows lanes, and can change them.
        way: the routing action that its way comes from.
        profile: the speeds of its trajectory; actions follow it once the trajectory begins.
        most_mps: the fastest that it has been told so far.
        rises_mps2, falls_mps2: the hardest that it has to speed up and brake; `changes` keeps them.
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
        """Note a change of speed, which its model has to be able to do; `within_limits`: as hard as the file's vehicle
        can, at most."""
        rises, falls = (to - was) / over_s, (was - to) / over_s
        if within_limits:
            rises, falls = 0.0, min(falls, self.entity.spec.emergency_braking_mps2)
        self.rises_mps2, self.falls_mps2 = max(self.rises_mps2, rises), max(self.falls_mps2, falls)
