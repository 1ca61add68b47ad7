"""The cost of a campaign's child compared with libsumo alone, and the speed of a run with the driver `pdm`.

The simple scene is 10 s in the middle of a drive through the bundled town, with 20 other actors, restored from a clip.
libsumo alone loads the same moment from its own saved state, and steps. The same comparison is made for clips of the
bundled library, with pedestrians, conditions and signals.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import libsumo

from benchmarks import library
from benchmarks.bound import compiled_reader, plain_reader, run_bound
from benchmarks.figures import Figure, costs, cpu_of
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World

ROUNDS = 12
SOURCE = "busy.foresee"
"""The file of the scenario from which the child is cut."""
CHILD_S, FROM_S = 10.0, 4.0
_TOWN = Path(__file__).parent.parent / "scenarios" / "networks" / "town.foresee"
_SCENE = f"""foresee 1

scenario busy {{
  use network "{_TOWN.as_posix()}"

  ego: car.sedan {{
    route from king_out straight over king_quay straight over king_oak straight over king_elm straight over king_ash
    start at 60 m along ego.route
    start speed 30 km/h
    speed 40 km/h
  }}
  traffic others {{
    count 20
    models [car.compact, car.suv, car.sedan, van.small, motorcycle.moped]
    within 150 m of ego.route
    seed 3
  }}
  end after 20 s
}}
"""
_BARE, _BOUND, _GETTERS, _LIBRARY, _SLOWEST_PDM = 1.9, 1.4, 1.3, 2.5, 350.0
"""Targets (docs/background/performance.md)."""
LIBRARY_ROUNDS = 5


class Nothing:
    """A driver that coasts and ignores its observations."""

    name, version = "nothing", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Do nothing."""

    def step(self, _: Observation) -> Control:
        """Return zero throttle, brake and steering."""
        return Control(0.0, 0.0, 0.0)


def figures() -> Iterator[Figure]:
    """Measure, and return the figures of the engine."""
    with tempfile.TemporaryDirectory() as folder:
        child = child_of(Path(folder))
        state = _state_of(child, Path(folder))
        steps = round(CHILD_S / STEP_S)
        trace = run(child, PdmDriver(), seed=0).trace  # a worker's first run is slower
        works = {
            "child": lambda: cpu_of(lambda: run(child, Nothing(), seed=0)),
            "bare": lambda: cpu_of(lambda: _bare(state, steps, reads=False)),
            "getters": lambda: cpu_of(lambda: _bare(state, steps, reads=True)),
            "pdm": lambda: cpu_of(lambda: run(child, PdmDriver(), seed=0)),
            "plain": lambda: cpu_of(lambda: run_bound(state, trace, plain_reader)),
            "placed": lambda: cpu_of(lambda: Simulation(child, World.shared(child))),
            "load": lambda: cpu_of(lambda: libsumo.simulation.loadState(str(state))),
        }
        read = compiled_reader(Path(folder))
        if read is not None:
            works["bound"] = lambda: cpu_of(lambda: run_bound(state, trace, read))
        taken = costs(works, ROUNDS)
        World.close_shared()
    # The minimum counts, because other programs on the machine only add to the cost.
    least = {name: min(kinds[0]) for name, kinds in taken.items()}
    means = "a child of 10 s with 20 actors and a driver that does nothing, over libsumo"
    yield Figure("child_vs_bare", least["child"] / least["bare"], "ratio", means, _BARE)
    yield Figure(
        "child_vs_getters", least["child"] / least["getters"], "ratio", f"{means} that reads all vehicles", _GETTERS
    )
    for name, step in (("least_vs_bare", "plain"), ("least_compiled_vs_bare", "bound")):
        if step in least:  # a run places its actors instead of loading a state
            by = "its functions" if step == "plain" else "compiled code"
            means = f"placing the actors, and libsumo that moves the ego and reads all vehicles by {by}, over libsumo"
            yield Figure(name, (least["placed"] + least[step] - least["load"]) / least["bare"], "ratio", means)
    if "bound" in least:
        means = "the child over libsumo that moves the ego and reads all vehicles by compiled code"
        yield Figure("child_vs_bound", least["child"] / least["bound"], "ratio", means, _BOUND)
    rate = CHILD_S / least["pdm"]
    means = "simulated seconds a second of CPU: the same child with pdm"
    yield Figure("simulated_s_per_wall_s_pdm", rate, "ratio", means, _SLOWEST_PDM, more=True)
    clips, ratio = library_ratio(library.clips())
    means = (
        f"CPU of {clips} clips of the bundled library with pdm, over libsumo that reads all vehicles at these moments"
    )
    yield Figure("library_child_vs_getters", ratio, "ratio", means, _LIBRARY)
    yield Figure("child_s", least["child"], "s", "a child, reset included")
    yield Figure("bare_s", least["bare"], "s", "libsumo: loading a state, and stepping")


def library_ratio(clips: Iterable[SumoBundle]) -> tuple[int, float]:
    """Return the number of clips, and the cost of their runs with `pdm` over that of libsumo, which starts from the
    same first frames, takes as many steps and reads all vehicles; the minimum of each clip is summed."""
    ours, bare = [], []
    for child in clips:
        with tempfile.TemporaryDirectory() as folder:
            steps = run(child, PdmDriver(), seed=0).steps  # a worker's first run is slower
            state = _state_of(child, Path(folder))
            works = {
                "ours": partial(cpu_of, partial(run, child, PdmDriver(), seed=0)),
                "bare": partial(cpu_of, partial(_bare, state, steps, reads=True)),
            }
            taken = costs(works, LIBRARY_ROUNDS)
        ours.append(min(taken["ours"][0]))
        bare.append(min(taken["bare"][0]))
    World.close_shared()
    return len(ours), sum(ours) / sum(bare)


def child_of(folder: Path) -> SumoBundle:
    """Return a compiled clip of 10 s in the middle of a run."""
    file = folder / SOURCE
    file.write_text(_SCENE)
    case = load_test_case(str(file), allow_outside=True)
    trace = run(compile_test_case(case), PdmDriver(), seed=0).trace
    frame = round(FROM_S / STEP_S)
    point = RiskyPoint(1, frame, FROM_S, "", "none", math.nan, math.nan, 0.0, "a benchmark")
    model = clip(case, trace, point, before_s=0.0, after_s=CHILD_S, name="child", parent=file.name)
    return compile_test_case(expand_clip(model, case, source=file))


def _state_of(child: SumoBundle, folder: Path) -> Path:
    """Save the child's first frame as a state of SUMO, and return the file."""
    state = folder / "state.xml"
    Simulation(child, World.shared(child))
    libsumo.simulation.saveState(str(state))
    return state


def _bare(state: Path, steps: int, *, reads: bool) -> None:
    """Let libsumo load a state and step; `reads`: also read position, speed and angle of all vehicles after each
    step."""
    vehicle = libsumo.vehicle
    reading: list[Callable[[str], object]] = [vehicle.getPosition, vehicle.getSpeed, vehicle.getAngle] if reads else []
    libsumo.simulation.loadState(str(state))
    for _ in range(steps):
        libsumo.simulationStep()
        for name in vehicle.getIDList() if reads else ():
            for read in reading:
                read(name)
