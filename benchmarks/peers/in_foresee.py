"""This tool: the child of the benchmark `engine`, recorded and judged, driven by `pdm` with sensors or coasting.

Arguments: rounds, `pdm` or `nothing`. Prints JSON.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from benchmarks.bench_engine import Nothing, child_of
from benchmarks.figures import cpu_of
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.simulate.runner import run


def main(rounds: int, driver: str) -> None:
    """Print the CPU time of one run with its reset."""
    driver_class: type[Driver] = PdmDriver if driver == "pdm" else Nothing
    with tempfile.TemporaryDirectory() as folder:
        child = child_of(Path(folder))
        run(child, driver_class(), seed=0)
        spent_s = min(cpu_of(lambda: run(child, driver_class(), seed=0)) for _ in range(rounds))
    sys.stdout.write(json.dumps({"cpu_s": spent_s, "actors": len(child.scene.actors)}) + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
