"""`python -m benchmarks.peers [--write]`: simulated seconds per second of CPU, compared with alternative tools.

Each tool is installed into an environment under `build/peers`; a tool that cannot be installed is left out, with the
reason. `--write` puts the table into `docs/background/measurements.md`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.peers.scene import STEPS, write_scene
from benchmarks.sections import table, write_section
from foresee_dsl.simulate.trace import STEP_S

_HERE = Path(__file__).parent
_ROOT = _HERE.parents[1]
ENVIRONMENTS = _ROOT / "build" / "peers"
ROUNDS = 5
PASSES = 2
"""Number of turns of each tool, of which the cheapest counts, because other programs may use the machine meanwhile."""
INSTALL_S, RUN_S = 900, 600
ACTORS = 20


@dataclass(frozen=True)
class Peer:
    """A tool to compare.

    Attributes:
        title: title in the table. script: name of `in_SCRIPT.py`.
        arguments: arguments of the script; FOLDER stands for the scene's folder.
        packages: packages to install, of which the first has the tool's version; without any, the script runs in this
            project's own environment.
        differs: how its scene differs.
    """

    title: str
    script: str
    arguments: tuple[str, ...]
    packages: tuple[str, ...]
    differs: str


_SUMO = ("FOLDER", str(STEPS), str(ROUNDS))
PEERS = (
    Peer("foresee-dsl, a driver that coasts", "foresee", (str(ROUNDS), "nothing"), (),
         "the scene: a clip of the bundled town; states recorded, contacts and near misses judged"),
    Peer("foresee-dsl with `pdm`", "foresee", (str(ROUNDS), "pdm"), (),
         "the same, with sensors and a driver that plans in each step"),
    Peer("SUMO by TraCI, getters", "sumo", (*_SUMO, "getters"), ("eclipse-sumo", "traci"),
         "the same first frame; position, speed and angle of all are read in each step; SUMO drives the ego"),
    Peer("SUMO by TraCI, subscriptions", "sumo", (*_SUMO, "subscriptions"), ("eclipse-sumo", "traci"),
         "the same, read by one call a step"),
    Peer("commonroad-sumo", "commonroad", _SUMO, ("commonroad-sumo", "eclipse-sumo"),
         "the same places on the same roads, all begin standing; no planner; SUMO's start is in it"),
    Peer("Scenic, Newtonian", "scenic", (*_SUMO, str(ACTORS)), ("scenic",),
         "the same town as OpenDRIVE, cars at random places that follow their lanes and do not react to others"),
    Peer("highway-env", "highway", (str(STEPS), str(ROUNDS), str(ACTORS)), ("highway-env",),
         "a straight road with four lanes, no junctions; cars follow each other (IDM, MOBIL)"),
)  # fmt: skip


class NotMeasuredError(Exception):
    """A tool cannot be measured here; the message states the reason."""


def main(words: Sequence[str]) -> int:
    """Measure all tools, print the table, and with `--write` put it into the docs."""
    if unknown := [word for word in words if word != "--write"]:
        sys.stderr.write(f"{unknown[0]} is not an option; there is --write\n")
        return 2
    results: dict[str, dict[str, Any]] = {}
    reasons: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_scene(folder)
        for peer in PEERS * PASSES:
            try:
                _keep(results, peer.title, measured(peer, folder))
            except NotMeasuredError as err:
                reasons.setdefault(peer.title, str(err))
                sys.stderr.write(f"{peer.title}: {err}\n")
    text = as_text(results, reasons)
    sys.stdout.write(text)
    if "--write" in words:
        write_section("peers", "python -m benchmarks.peers --write", text)
    return 0


def _keep(results: dict[str, dict[str, Any]], title: str, new: dict[str, Any]) -> None:
    if title not in results or new["cpu_s"] < results[title]["cpu_s"]:
        results[title] = new


def measured(peer: Peer, folder: Path) -> dict[str, Any]:
    """Return the measurements of a tool: CPU time for the scene, s, number of actors, version.

    Raises:
        NotMeasuredError: it cannot be installed, or does not run.
    """
    python = Path(sys.executable) if not peer.packages else _environment(peer)
    arguments = [str(folder) if word == "FOLDER" else word for word in peer.arguments]
    path = os.pathsep.join((str(python.parent), os.environ.get("PATH", "")))
    own = {"PYTHONPATH": str(_ROOT)} if not peer.packages else {}
    environment = {**os.environ, **own, "PATH": path, "SDL_VIDEODRIVER": "dummy", "OMP_NUM_THREADS": "1"}
    if peer.packages:
        environment.pop("PYTHONPATH", None)
        environment.pop("SUMO_HOME", None)
    printed = _run([str(python), str(_HERE / f"in_{peer.script}.py"), *arguments], "run", RUN_S, environment, folder)
    result: dict[str, Any] = json.loads(printed.strip().splitlines()[-1])
    return {**result, "version": _version(python, peer.packages[0] if peer.packages else "foresee-dsl")}


def _environment(peer: Peer) -> Path:
    """Return the interpreter of a tool's environment, which is created if it is missing."""
    folder = ENVIRONMENTS / peer.packages[0]
    python = folder / "bin" / "python"
    if not (folder / "installed").exists():
        venv.create(folder, clear=True, with_pip=True)
        _run([str(python), "-m", "pip", "install", "--quiet", *peer.packages], "install", INSTALL_S)
        (folder / "installed").touch()
    return python


def _run(
    command: Sequence[str], what: str, limit_s: float, environment: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> str:  # fmt: skip
    try:
        done = subprocess.run(  # noqa: S603 - the commands above
            command, capture_output=True, text=True, timeout=limit_s, check=False, env=environment, cwd=folder
        )
    except subprocess.TimeoutExpired as err:
        raise NotMeasuredError(f"it did not {what} within {limit_s:g} s") from err
    if done.returncode:
        sys.stderr.write(done.stderr[-2000:])
        raise NotMeasuredError(f"it does not {what} here (exit code {done.returncode})")
    return done.stdout


def _version(python: Path, package: str) -> str:
    code = "import importlib.metadata as m, sys; print(m.version(sys.argv[1]))"
    return _run([str(python), "-c", code, package], "tell its version", 60).strip()


def as_text(results: Mapping[str, Mapping[str, Any]], reasons: Mapping[str, str]) -> str:
    """Return the table, and below it the tools that were not measured."""
    simulated_s = STEPS * STEP_S
    rows = [
        (peer.title, result["version"], result["actors"], f"{simulated_s / result['cpu_s']:.0f}", peer.differs)
        for peer in PEERS
        if (result := results.get(peer.title)) is not None
    ]
    headings = ("", "version", "actors", "simulated s a second of CPU", "its scene")
    missing = [f"Not measured: {title}, as {why}.\n" for title, why in reasons.items() if title not in results]
    return "\n".join((table(headings, rows, words=1), *missing))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
