"""Nominal drives: a driver drives through the bundled town in ordinary traffic, without unusual behaviour.

A drive is a scenario on a random route with background traffic. It counts if the driver arrives and never needed to
brake harder than `NEAR_MISS_MPS2`. The autoencoders are trained on its pictures, two per second.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from foresee_study.selforacle.pictures import EVERY_S, PALETTE, classes_seen, looked_at
from foresee_study.selforacle.ranker import waypoints_passed
from numpy.typing import NDArray

from foresee_dsl.campaign.driving import new_driver
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.placement.background_traffic import onward
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.protocol import Surroundings
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from training.selforacle.packing import Rides, save

NEAR_MISS_MPS2 = 3.35
"""Braking that makes a near miss: the deceleration rate to avoid a crash that conflict studies call critical
(Archer 2005, Guido et al. 2011)."""
EGO_MODELS = ("car.compact", "car.sedan", "car.hatchback", "car.wagon")
TURNS = {"straight": 3.0, "right": 1.0, "left": 1.0}
"""Weights of the ego's turns: three in five go straight on, as the background traffic does."""
LEAST_EDGES = 3
"""Smallest number of edges of a ride: it passes at least two junctions (ours)."""

_RIDE = """foresee 1

scenario ride_{seed} {{
  use network "{network}"
  ego: {model} {{
    route [{edges}]
    start at {start} m along {first}
    start speed {speed} km/h
    goal {goal} m along {last}
  }}
  traffic others {{
    count {vehicles}
    models [car.compact, car.sedan, car.suv, van.delivery, truck.light, bus.city, motorcycle.scooter, bicycle.city]
    within 130 m of ego.route
    seed {seed}
  }}
  traffic walkers {{
    count {walkers}
    models [pedestrian.adult, pedestrian.hurried, pedestrian.elderly, pedestrian.child]
    within 50 m of ego.route
    seed {seed}
  }}
  traffic parked {{
    count {parked}
    models [obstacle.parked_compact, obstacle.parked_car, obstacle.parked_suv, obstacle.parked_van]
    within 40 m of ego.route
    seed {seed}
  }}
  end after {end} s
}}
"""


@dataclass(frozen=True)
class Ride:
    """A finished ride: its run and its places."""

    seed: int
    result: RunResult
    surroundings: Surroundings

    @property
    def nominal(self) -> bool:
        """Whether the driver arrived without a near miss."""
        drac = self.result.near_misses.drac_mps2
        return self.result.verdict is Verdict.PASS and (drac is None or drac.value <= NEAR_MISS_MPS2)


def ride_text(network: RoadNetwork, seed: int, network_file: Path) -> str:
    """Return the scenario of a ride, drawn from its seed."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 14]))
    edges = _route(network, rng)
    first, last = (_length_m(network, edge) for edge in (edges[0], edges[-1]))
    return _RIDE.format(
        seed=seed,
        network=network_file,
        model=rng.choice(EGO_MODELS),
        edges=", ".join(edges),
        first=edges[0],
        last=edges[-1],
        start=round(float(rng.uniform(10, max(first - 30, 11)))),
        goal=round(float(rng.uniform(20, max(last - 10, 21)))),
        speed=round(float(rng.uniform(0, 30))),
        vehicles=int(rng.integers(6, 22)),
        walkers=int(rng.integers(2, 12)),
        parked=int(rng.integers(0, 10)),
        end=180,
    )


def drive(driver: str, seeds: range) -> Iterator[Ride]:
    """Drive the rides with these seeds; rides that cannot be placed are left out."""
    town = data_folder("scenarios") / "networks" / "town.foresee"
    network: RoadNetwork | None = None
    with TemporaryDirectory() as folder:
        for seed in seeds:
            file = Path(folder) / f"ride_{seed}.foresee"
            if network is None:
                network = _network(town, Path(folder))
            file.write_text(ride_text(network, seed, town), encoding="utf-8")
            try:
                bundle = compile_test_case(load_test_case(file))
                result = run(bundle, new_driver(driver), seed=seed, meta={"driver": driver})
            except ForeseeError as err:
                print(f"ride {seed}: {err}", flush=True)  # noqa: T201
                continue
            yield Ride(seed, result, Surroundings.of(bundle))


def packed(ride: Ride, every_s: float = EVERY_S) -> Rides:
    """Return a ride's pictures with the segments that they belong to."""
    trace = ride.result.trace
    frames = looked_at(trace, every_s)
    seen = classes_seen(trace, ride.surroundings, frames)
    ids: NDArray[np.int32] = np.full(len(frames), ride.seed, np.int32)
    return Rides(seen, ids, waypoints_passed(trace)[frames].astype(np.int32), PALETTE)


def _route(network: RoadNetwork, rng: np.random.Generator) -> list[str]:
    roads = sorted(edge for edge in network.edges if onward(network, edge, "car") and _length_m(network, edge) > 60)
    while len(edges := _walk(network, rng, roads)) < LEAST_EDGES:
        pass
    return edges


def _walk(network: RoadNetwork, rng: np.random.Generator, roads: list[str]) -> list[str]:
    edges = [str(rng.choice(roads))]
    wanted_m = rng.uniform(500, 1200)
    while wanted_m > 0:
        ways = [m for m in onward(network, edges[-1], "car") if m.turn in TURNS]
        if not ways:
            break
        weights = np.array([TURNS[m.turn] for m in ways])
        way = ways[int(rng.choice(len(ways), p=weights / weights.sum()))]
        edges.append(way.to_edge)
        wanted_m -= _length_m(network, way.to_edge)
    while _length_m(network, edges[-1]) < 40 and len(edges) > 2:  # no goal on a piece of the roundabout
        edges.pop()
    return edges


def _length_m(network: RoadNetwork, edge: str) -> float:
    return min(lane.line.length_m for lane in network.lanes.values() if lane.edge == edge)


def _network(town: Path, folder: Path) -> RoadNetwork:
    file = folder / "town_only.foresee"
    file.write_text(
        f'foresee 1\nscenario s {{\n use network "{town}"\n ego: car.sedan {{\n route [mill_west]\n'
        " start at 20 m along mill_west\n }\n end after 1 s\n}\n",
        encoding="utf-8",
    )
    return compile_test_case(load_test_case(file)).network


def main() -> None:
    """Drive rides and write their pictures, a file for each `--chunk` rides."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--driver", default="pdm")
    parser.add_argument("--first", type=int, default=0, help="seed of the first ride")
    parser.add_argument("--rides", type=int, default=100)
    parser.add_argument("--chunk", type=int, default=25, help="rides in a file")
    parser.add_argument("--every", type=float, default=EVERY_S, help="seconds between two pictures")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    kept: list[Rides] = []
    for ride in drive(options.driver, range(options.first, options.first + options.rides)):
        how = "nominal" if ride.nominal else f"not: {ride.result.reason}"
        print(f"ride {ride.seed}: {ride.result.duration_s:.0f} s, {how}", flush=True)  # noqa: T201
        if ride.nominal:
            kept.append(packed(ride, options.every))
        if len(kept) == options.chunk:
            save(Rides.joined(kept), options.out / f"{options.driver}_{kept[0].ride[0]:06d}.npz")
            kept = []
    if kept:
        save(Rides.joined(kept), options.out / f"{options.driver}_{kept[0].ride[0]:06d}.npz")


if __name__ == "__main__":
    main()
