"""Computes the keys of results: steps with the same key have the same result, so only one of them is run.

A key is a hash of everything that can affect the result, and of nothing else: the meaning of the test case, the driver
with its code and weights, the settings of that step, and the code of this package that the step runs. File names, the
number of workers and settings of later steps are not part of it.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from foresee_dsl import __version__
from foresee_dsl.campaign.import_closure import DIGITS, code_of, imports_in, top_of, with_plug_ins
from foresee_dsl.campaign.steps.step import Step
from foresee_dsl.derive.operators import OPERATORS
from foresee_dsl.drivers.process_state import put_back
from foresee_dsl.drivers.registry import DRIVERS, files_in, load_driver, name_in
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.protocol import Learned
from foresee_dsl.forecast.registry import RANKERS, load_ranker
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.plugins import PluginGroup
from foresee_dsl.simulate.sensing.views import RASTER_VIEWS

_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"))


def key(step: type[Step[Any, Any]], **parts: str | float | None) -> str:
    """Return the key of a step: a hash of these parts and of the code that the step's module imports."""
    everything = {"kind": step.kind, "tool": __version__, "code": step_code(step.__module__), **parts}
    return hashlib.sha256(_ENCODER.encode(everything).encode()).hexdigest()[:DIGITS]


@cache
def step_code(module: str) -> str:
    """Return a hash of the code that a module imports, this package's data files, and SUMO's version."""
    parts = [code_of(module), *(_digest(data_folder(name)) for name in ("grammars", "templates"))]
    parts += [_version("libsumo"), _version("eclipse-sumo")]
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()[:DIGITS]


def driver_identity(address: str) -> str:
    """Return a text that identifies a driver: its address, version, weights, and a hash of its code.

    A driver may provide its weights' hash as the attribute `weights_hash`. For a program (`external:python3 mine.py`)
    the files on its command line are hashed. A driver of another package may request pictures, so the code of all
    installed views is included for it.

    Raises:
        DriverError: there is no such driver.
    """
    with put_back(0):
        driver = load_driver(address)
    weights = str(getattr(driver, "weights_hash", "") or "")
    files = " ".join(map(_digest, files_in(address)))
    parts = [address, driver.version, weights, _plugin(DRIVERS, name_in(address)), files]
    if top_of(DRIVERS.find(name_in(address)).module) != "foresee_dsl":
        parts.append(views_identity())
    return json.dumps(parts)


def judged_identity(address: str, rules: RulesMode) -> str:
    """Return a text that identifies a driver together with the effect of a broken traffic rule on its runs."""
    return f"{driver_identity(address)} {rules}"


def ranker_identity(name: str, driver: str) -> str:
    """Return a text that identifies a ranker: its name, a hash of its code and, if it is learned, of its weights for
    the driver and of the views that it may use.

    Raises:
        ForeseeError: there is no such ranker, or no weights for this driver.
    """
    ranker = load_ranker(name)
    weights = [ranker.weights_hash(driver), views_identity()] if isinstance(ranker, Learned) else []
    return json.dumps([name, _plugin(RANKERS, name), *weights])


def operators_identity() -> str:
    """Return a text that identifies the mutation operators of other packages."""
    return json.dumps([[name, _plugin(OPERATORS, name)] for name in OPERATORS.names()])


@cache
def views_identity() -> str:
    """Return a text that identifies the views of other packages; each process reads a package's files once."""
    return json.dumps([[name, _plugin(RASTER_VIEWS, name)] for name in RASTER_VIEWS.names()])


def _plugin(group: PluginGroup, name: str) -> str:
    """Return package, version and code hash of an entry point."""
    entry = group.find(name)
    top = top_of(entry.module)
    if top == "foresee_dsl":
        return code_of(entry.module)
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else ""
    return f"{package} {_package_digest(top)}"


def _package_digest(top: str) -> str:
    """Return a hash of another package's files, and of the code that it imports from us and from other plug-ins.

    All files count, whether imported or not, because a package may load modules and data in any way.
    """
    with suppress(ImportError, ValueError):
        spec = find_spec(top)
        folders = (spec.submodule_search_locations if spec is not None else None) or ()
        place = next(iter(folders), spec.origin if spec is not None else None)
        if place is not None:
            sources = [file for file in _files(Path(place)) if file.suffix == ".py"]
            others = with_plug_ins() - {top}
            imported = {module for module in imports_in(sources) if top_of(module) in others}
            return f"{_digest(Path(place))} {code_of(*sorted(imported))}"
    return ""


def _digest(place: Path) -> str:
    """Return a hash of a file, or of the names and files in a folder without Python's caches."""
    lines = (f"{file.relative_to(place).as_posix()} {hashlib.sha256(file.read_bytes()).hexdigest()}\n"
             for file in _files(place))  # fmt: skip
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:DIGITS]


def _files(place: Path) -> list[Path]:
    if place.is_file():
        return [place]
    files = (f for f in place.rglob("*") if f.is_file() and "__pycache__" not in f.parts and f.suffix != ".pyc")
    return sorted(files, key=lambda file: file.relative_to(place).as_posix())


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
