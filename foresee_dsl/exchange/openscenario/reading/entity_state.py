"""What is known of an entity while its actions are read."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.exchange.openscenario.reading.entities import Entity
from foresee_dsl.exchange.openscenario.reading.ways.trajectories import SpeedProfile


@dataclass
class EntityState:
    """What is known of an entity while its actions are read.

    Attributes:
        speed_mps: what it drives as far as is known, m/s.
        lane: its lane's id, where its road is known; ahead: it looks in the road's direction.
        on_lanes: it follows lanes, and can change them.
        profile: the speeds of its trajectory; actions follow it once the trajectory begins.
    """

    entity: Entity
    speed_mps: float | None = None
    lane: int | None = None
    ahead: bool = True
    on_lanes: bool = False
    profile: SpeedProfile | None = None
