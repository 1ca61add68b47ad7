"""The cost of starting: `foresee run` of a clip minus its run, and `foresee verify` of 60 mutants over their runs."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from compileall import compile_dir
from contextlib import suppress
from pathlib import Path

import foresee_dsl
from benchmarks.figures import Figure, costs, cpu_of
from benchmarks.library import ADDRESSES, AFTER_S, BEFORE_S
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.campaign.workers.processes import adopt_orphans
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.model import Definition
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case

ROUNDS, VERIFY_ROUNDS = 9, 3
MUTANTS = 10
"""Number of mutants of each clip; six clips have the required sixty."""
_BEYOND_S = 1.5
"""Target (docs/background/performance.md), s: half a second more than before the use of numba's own cache."""
_FORESEE = "from foresee_dsl.cli import main; main()"
_LIBRARIES = """\
import lark, libsumo, networkx, pydantic, rich, shapely, typer
from numba.core.registry import cpu_target
cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
"""
"""What a run needs of other people's code before it can begin: imports, and what numba prepares for its first function,
even if the machine code is stored."""
_DRIVER = "pdm"


def figures() -> Iterator[Figure]:
    """Measure, and yield the costs of starting."""
    compile_dir(Path(foresee_dsl.__file__).parent, quiet=1)  # like an installed package
    with tempfile.TemporaryDirectory(prefix="foresee-bench-") as name:
        clips, mutants = _children(Path(name))
        yield from _run(clips[0])
        yield from _verify(mutants)


def _children(folder: Path) -> tuple[list[Path], list[Path]]:
    """Write a clip of each test case, and its mutants; return their files."""
    shutil.copytree(data_folder("scenarios"), folder, dirs_exist_ok=True)
    clips: list[Path] = []
    mutants: list[Path] = []
    ranker = load_ranker("foresee")

    def written(model: Definition, file: Path) -> Path:
        file.write_text(print_model(model), encoding="utf-8")
        return file

    for number, address in enumerate(ADDRESSES):
        case = load_test_case(folder / address)
        trace = run_test_case(case, _DRIVER, 0).trace
        point = ranker.rank(trace, seed=0, before_s=BEFORE_S, after_s=AFTER_S)[0]
        file = case.source.parent / f"clip_{number}.foresee"
        clip_model = clip_around(case, trace, point, file, before_s=BEFORE_S, after_s=AFTER_S)
        clips.append(written(clip_model, file))
        clip_case = load_test_case(clips[-1])
        children = mutate(clip_case, clip_model, run_test_case(clip_case, _DRIVER, 0).trace, count=MUTANTS)
        mutants += [written(child, file.with_name(f"{child.name}.foresee")) for child in children]
    return clips, mutants


def _run(clip: Path) -> Iterator[Figure]:
    """Yield the cost of a new process, and of the same run in this process, which is warm."""
    case = load_test_case(clip)
    cost = costs(
        {
            "numpy": lambda: _cpu_of_all([sys.executable, "-c", "import numpy"]),
            "libraries": lambda: _cpu_of_all([sys.executable, "-c", _LIBRARIES]),
            "command": lambda: _cpu_of_all([sys.executable, "-c", _FORESEE, "run", str(clip), "--exit-zero"]),
            "warm": lambda: cpu_of(lambda: run_test_case(case, _DRIVER, 0)),
        },
        ROUNDS,
    )
    least = {name: min(kinds[0]) for name, kinds in cost.items()}
    beyond_s = least["command"] - least["warm"]
    means = "CPU of `foresee run` of a clip of 10 s, less that of the same run in a process that has run others"
    yield Figure("run_beyond_simulation_s", beyond_s, "s", means, _BEYOND_S)
    yield Figure("run_beyond_over_numpy", beyond_s / least["numpy"], "ratio", "the same over `import numpy`")
    of_others = "the same over what the libraries take that a run needs"
    yield Figure("run_beyond_over_libraries", beyond_s / least["libraries"], "ratio", of_others)
    yield Figure("libraries_s", least["libraries"], "s", "CPU of importing the libraries that a run needs")


def _verify(mutants: Sequence[Path]) -> Iterator[Figure]:
    """Yield the cost of a command for all mutants, and of each mutant's run in this process, which is warm."""
    cases = [load_test_case(file) for file in mutants]
    command = [sys.executable, "-c", _FORESEE, "verify", "--jobs", "2", *map(str, mutants)]

    def runs() -> None:
        for case in cases:
            run_test_case(case, _DRIVER, 0)

    cost = costs({"command": lambda: _cpu_of_all(command), "runs": lambda: cpu_of(runs)}, VERIFY_ROUNDS)
    least = {name: min(kinds[0]) for name, kinds in cost.items()}
    means = f"CPU of `foresee verify` of {len(cases)} mutants on two workers"
    yield Figure("verify_s", least["command"], "s", means)
    yield Figure("verify_over_runs", least["command"] / least["runs"], "ratio", f"{means}, over that of their runs")


def _cpu_of_all(command: Sequence[str]) -> float:
    """Return the CPU time of a program and of its child processes, s; its exit status may be 1 (a test changed)."""
    code = "from benchmarks.bench_start import _report; _report()"
    done = subprocess.run([sys.executable, "-c", code, *command], stdout=subprocess.PIPE, check=True)  # noqa: S603 - ours
    return float(done.stdout)


def _report() -> None:
    """Run the command of this process's arguments, and print its CPU time, s.

    The fork server ends a moment after the command; this process adopts it, if the system supports that.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    adopt_orphans()
    done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=False)  # noqa: S603 - ours
    if done.returncode not in (0, 1):
        sys.exit(done.returncode)
    with suppress(ChildProcessError):
        while True:
            os.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    sys.stdout.write(str(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
