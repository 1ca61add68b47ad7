"""The least that a step can cost: the ego is moved and all vehicles are read, by libsumo or by compiled code.

The compiled function needs a C++ compiler. It is linked to the library inside libsumo's Python package, which exports
SUMO's C++ functions; their headers come with the package `eclipse-sumo`.
"""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import libsumo
import numpy as np
import sumo

from foresee_dsl.simulate.moved_bodies import MATCH_M, degrees
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

MOST = 1000
"""Maximum number of vehicles that are read."""
OPTIONS = ("-std=c++17", "-O2", "-shared", "-fPIC", "-Wl,--allow-shlib-undefined")
"""The last one: libraries that SUMO itself needs are found when it is loaded."""


def compiled_reader(folder: Path) -> Callable[[], int] | None:
    """Build the function that reads all vehicles, in a folder, and return it; None where no compiler is installed.

    Raises:
        CalledProcessError: the compiler reports an error.
    """
    compiler = shutil.which("c++")
    if compiler is None:
        return None
    (linked,) = sorted(Path(libsumo.__path__[0]).glob("_libsumo*.so"))
    built = folder / "bound.so"
    source, headers = Path(__file__).with_suffix(".cpp"), Path(sumo.SUMO_HOME) / "include"
    subprocess.run([compiler, *OPTIONS, f"-I{headers}", "-o", built, source, linked], check=True)  # noqa: S603 - our own source
    read = ctypes.CDLL(str(built)).read_vehicles
    read.restype, read.argtypes = ctypes.c_int, [ctypes.c_void_p, ctypes.c_int]
    values = np.empty((MOST, 4))

    def read_vehicles() -> int:
        return int(read(values.ctypes.data, MOST))

    return read_vehicles


def plain_reader() -> int:
    """Read position, speed and lane of all vehicles by libsumo's functions; return the number of vehicles."""
    vehicle = libsumo.vehicle
    names = vehicle.getIDList()
    for read in (vehicle.getPosition, vehicle.getSpeed, vehicle.getLaneID):
        list(map(read, names))
    return len(names)


def run_bound(state: Path, trace: Trace, read: Callable[[], int]) -> None:
    """Let libsumo load a state and step; before each step move the ego as in a run, after it read all vehicles."""
    vehicle, ego = libsumo.vehicle, trace.actors[0]
    poses = trace.states[:, 0, [X, Y, HEADING]].tolist()
    libsumo.simulation.loadState(str(state))
    for x, y, heading in poses[1:]:
        front_x, front_y = x + ego.length_m / 2 * math.cos(heading), y + ego.length_m / 2 * math.sin(heading)
        vehicle.moveToXY(ego.id, "", -1, front_x, front_y, degrees(heading), 2, MATCH_M)
        libsumo.simulationStep()
        if read() < 1:
            raise ValueError("SUMO has no vehicle that can be read")
