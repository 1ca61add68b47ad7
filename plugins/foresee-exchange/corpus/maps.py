"""Judges one foreign map in a process with limits: imports it, checks its geometry, and lets `idm` drive on it
alone."""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path

LIMIT_S = 60.0
MEMORY_BYTES = 2_000_000_000

IMPORTED, GOOD_REASON, OURS, NOT_ARRIVED = "imported", "refused for a good reason", "refused for ours", "not arrived"

_KINDS = {
    "opendrive": (".xodr",),
    "osm": (".osm", ".osm.xml", ".osm.gz", ".osm.xml.gz", ".osm.pbf", ".osm.bz2"),
    "sumo": (".net.xml", ".net.xml.gz"),
}
_GOOD_REASONS = (
    "a damaged one",  # no XML, or cut off
    "without roads",
    "no lanes for cars",
    "has no streets",
    "has no nodes",
    "no street that leads anywhere",
    "has no route of 3 m for a car",
    "is not a complete SUMO network",
    "its root is",
    "not a sound OpenDRIVE map",
    "sound SUMO network",
    "the language cannot express",
    "is missing in definition of",  # netconvert's words for an attribute that the schema asks for
    "Invalid Number Format",
    "No edges loaded",
    "that are read: cut out",  # too large
)
"""Parts of messages about files without a map that a car could drive on."""


@dataclass(frozen=True)
class MapRow:
    """The result of one map.

    Attributes:
        file: its name.
        kind: `opendrive`, `osm` or `sumo`.
        verdict: one of the four words above.
        detail: the message, or the result of the drive.
        broken: number of places that the check of the geometry names, after repairs.
        seconds, memory_mb: time and memory of the whole process, including netconvert.
    """

    file: str
    kind: str
    verdict: str
    detail: str
    broken: int
    seconds: float
    memory_mb: float


def kind_of(path: Path) -> str | None:
    """Return the importer for a file; None if there is none."""
    return next((kind for kind, endings in _KINDS.items() if path.name.endswith(endings)), None)


def check_map(path: Path) -> MapRow:
    """Import a map, check its geometry and let `idm` drive the starter alone, within 60 s and 2 GB.

    The process is a fork, so that slow imports and machine code are loaded once for all maps.
    """
    _load()
    begin = time.perf_counter()
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    worker = context.Process(target=_answer, args=(path, theirs))
    worker.start()
    theirs.close()
    ours.poll(LIMIT_S)
    try:
        answer = ours.recv() if ours.poll(0) else {"detail": f"took more than {LIMIT_S:.0f} s"}
    except EOFError:
        worker.join(LIMIT_S)
        answer = {"detail": f"its process ended with {worker.exitcode}"}
    if worker.is_alive():
        worker.join(5)
        worker.kill()
    worker.join()
    seconds, memory_mb = round(time.perf_counter() - begin, 1), round(answer.pop("memory_mb", 0.0))
    return MapRow(path.name, kind_of(path) or "", seconds=seconds, memory_mb=memory_mb, **{**_NOTHING, **answer})


_NOTHING = {"verdict": OURS, "broken": 0}


@cache
def _load() -> None:
    from foresee_dsl.drivers.registry import load_driver

    load_driver("idm")


def _answer(path: Path, to: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES * 2, MEMORY_BYTES * 2))  # numba maps more than it uses
    with tempfile.TemporaryDirectory(prefix="foresee-corpus-") as name:
        verdict, detail, broken = _work(path, Path(name) / "out")
    used = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    to.send({"verdict": verdict, "detail": detail, "broken": broken, "memory_mb": used / 1000})


def _work(path: Path, out: Path) -> tuple[str, str, int]:
    """Import and drive; return the verdict, the detail, and the number of broken places."""
    from foresee_exchange.maps import opendrive, osm, sumo

    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.exchange.outcome import Imported

    importers: dict[str, Callable[..., Imported]] = {"opendrive": opendrive.run, "osm": osm.run, "sumo": sumo.run}
    kind = kind_of(path)
    if kind is None:
        return GOOD_REASON, "no map by its name", 0
    try:
        done = importers[kind](path, out=out)
    except ForeseeError as err:
        good = any(part in str(err) for part in _GOOD_REASONS)
        return (GOOD_REASON if good else OURS), str(err).replace(str(path), path.name), 0
    scenario = next(file for file in done.files if file.suffix == ".foresee")
    broken = sum(_count(note) for note in done.notes)
    try:
        passed, reason = _driven_alone(scenario)
    except ForeseeError as err:
        return NOT_ARRIVED, str(err), broken
    return (IMPORTED if passed else NOT_ARRIVED), reason, broken


def _count(note: str) -> int:
    """Return the number of broken places in a note of an import."""
    words = note.split()
    return int(words[0]) if "broken" in words and words[0].isdecimal() else 0


def _driven_alone(scenario: Path) -> tuple[bool, str]:
    """Drive a starter without its traffic; return whether it passed, and the verdict with its reason."""
    from foresee_dsl.campaign.driving import run_test_case
    from foresee_dsl.language.model import Scenario, Traffic
    from foresee_dsl.language.parser import parse
    from foresee_dsl.language.printer import print_model
    from foresee_dsl.language.project.loading import load_test_case
    from foresee_dsl.simulate.results.verdict import Verdict

    model = parse(scenario.read_text(encoding="utf-8"), str(scenario)).model
    assert isinstance(model, Scenario)
    alone = model.model_copy(update={"body": tuple(item for item in model.body if not isinstance(item, Traffic))})
    file = scenario.with_name(f"{scenario.stem}_alone.foresee")
    file.write_text(print_model(alone), encoding="utf-8")
    result = run_test_case(load_test_case(file), "idm", 0, deadlines=None)
    return result.verdict is Verdict.PASS, f"{result.verdict.name}: {result.reason}"
