"""What the driver sees. For now ideal: everybody within range, exactly, at once."""

from __future__ import annotations

from foresee_dsl.drivers.protocol import Mission, Observation, SeenActor, SignalColour
from foresee_dsl.simulate.cast import Cast

RANGE_M = 80.0
"""How far the driver sees others. Ours: what automotive lidars resolve a pedestrian at."""
SIGNAL_RANGE_M = 100.0
"""How far the driver sees signals. Ours: braking from 70 km/h in comfort takes 65 m, and a second to decide."""


def observe(cast: Cast, mission: Mission, tracks: dict[str, int]) -> Observation:
    """Return what the driver sees at the frame that a cast is at.

    Args:
        cast: the actors. mission: whose signals are meant. tracks: a number per actor's id; the driver learns no ids.
    """
    ego = cast.ego
    seen = tuple(
        SeenActor(
            tracks[a.id],
            a.placed.model.kind,
            a.x,
            a.y,
            a.heading,
            a.speed,
            a.length,
            a.width,
        )
        for a in cast.actors[1:]
        if a.present and (a.x - ego.x) ** 2 + (a.y - ego.y) ** 2 <= RANGE_M * RANGE_M
    )
    return Observation(cast.time_s, ego.bicycle().as_ego(), seen, _signals(cast, mission))


def _signals(cast: Cast, mission: Mission) -> dict[str, SignalColour]:
    signals: dict[str, SignalColour] = {}
    s, _ = cast.progress.of(cast.ego, cast.frame)
    s += mission.start_s - cast.scene.start_s  # the mission's line may begin elsewhere than the scene's
    for passage in mission.junctions:
        if passage.signal is not None and passage.exit_s > s and passage.stop_s - s <= SIGNAL_RANGE_M:
            tls, _, link = passage.signal.rpartition(":")
            signals[passage.signal] = cast.world.colour(tls, int(link))
    return signals
