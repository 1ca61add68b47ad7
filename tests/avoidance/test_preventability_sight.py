"""What the careful driver can see: as the sensors do, with the heights and buildings of what was run."""

from __future__ import annotations

from dataclasses import replace

from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing.sight import in_view, sight_of
from tests.support.handmade_traces import clear_sight
from tests.support.scenes import Cruise, Town
from tests.support.worlds import VAN

EAST = ("n01_n11", "n11_n21", "n21_n31")


def test_heights_buildings_and_weather_count(town: Town) -> None:
    # A van 14 m ahead of somebody on foot 34 m ahead, in line.
    ego, van = town.ego(EAST, 20.0, speed=0.0), town.vehicle("van", EAST, 40.0, speed=0.0, waits=True, model=VAN)
    walker = town.walker("walker", [(ego.x + 32.0, ego.y), (ego.x + 32.0, ego.y + 9.0)], waits=True)
    bundle = town.bundle([ego, van, walker], end_s=0.2)
    trace = run(bundle, Cruise(0.0)).trace
    k = trace.index("walker")

    def seen(
        van_height_m: float, buildings: tuple[tuple[tuple[float, float], ...], ...] = (), fog: float = 0.0
    ) -> bool:
        actors = tuple(
            replace(a, model=replace(a.model, height_m=van_height_m if a.id == "van" else 1.75))
            for a in bundle.scene.actors
        )
        scene = replace(bundle.scene, actors=actors, fog=fog)
        network = replace(bundle.network, buildings=buildings)
        return in_view(trace, k, 0, sight_of(replace(bundle, scene=scene, network=network)))

    x, y = ego.x + 5.0, ego.y
    assert seen(1.2)
    assert not seen(2.4)
    assert not seen(1.2, (((x, y - 2.0), (x + 3.0, y - 2.0), (x + 3.0, y + 2.0), (x, y + 2.0)),))
    assert not seen(1.2, fog=1.0)
    assert not in_view(trace, k, 0, clear_sight(trace)), "vans are 2 m and more high"
