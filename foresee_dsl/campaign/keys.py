"""What a result stands on, as a key: two steps with the same key give the same result, so one of them is enough.

A key is a hash over everything that the result can depend on, and over nothing else: the meaning of what is run, the
driver with its code and weights, the settings of that step alone, the code of this package that the step goes through.
Names of files, the number of workers, and settings of later steps are in none.
"""

from __future__ import annotations

import hashlib
import json
import shlex
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from pathlib import Path

from foresee_dsl import __version__
from foresee_dsl.derive.operators import GROUP as OPERATORS
from foresee_dsl.drivers.registry import DRIVERS, load_driver
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.registry import RANKERS

KEY_DIGITS = 40
"""Hexadecimal digits of a key. Ours: 160 bits; two of a billion keys are the same with a chance below 1e-30."""
_LANGUAGE = (
    "language",
    "errors.py",
    "files.py",
    "plugins.py",
    *(f"campaign/{name}.py" for name in ("storage/records", "results", "steps", "work")),
)
_RUN = (*_LANGUAGE, "compile", "drivers", "kernels", "simulate")
CODE = {
    "seed": _RUN,
    "forecast": (*_LANGUAGE, "kernels", "simulate/trace.py", "forecast", "derive"),
    "clip": (*_RUN, "derive"),
    "mutants": (*_LANGUAGE, "compile", "kernels", "simulate", "derive"),
    "child": (*_RUN, "derive"),
}
"""Which parts of this package a step goes through: an edit of one of them makes its results new ones."""


def key(kind: str, **parts: str | float | None) -> str:
    """Return the key of a step of a kind (one of `CODE`) that stands on these parts."""
    said = {"kind": kind, "tool": __version__, "code": code_of(kind), **parts}
    text = json.dumps(said, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_DIGITS]


@cache
def code_of(kind: str) -> str:
    """Return a hash over the code of this package that a kind of step goes through, and over SUMO's version.

    It is the same for a checkout and for a wheel that was built from it.
    """
    package = Path(__file__).resolve().parents[1]
    parts = [_digest(package / part) for part in CODE[kind]]
    parts += [_digest(data_folder(name)) for name in ("grammars", "templates")]
    parts += [_version("libsumo"), _version("eclipse-sumo")]
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()[:KEY_DIGITS]


def driver_identity(address: str) -> str:
    """Return what stands for a driver: its address, version, weights, and a hash of its package's code.

    A driver may name its weights' hash in an attribute `weights_hash`. Of a program (`external:python3 mine.py`) the
    files that its command line names are hashed.

    Raises:
        DriverError: there is no such driver.
    """
    driver = load_driver(address)
    weights = str(getattr(driver, "weights_hash", "") or "")
    name, _, argument = address.partition(":")
    return json.dumps([address, driver.version, weights, _plugin(DRIVERS.name, name), _files_named(argument)])


def ranker_identity(name: str) -> str:
    """Return what stands for a ranker: its name and a hash of its package's code."""
    return json.dumps([name, _plugin(RANKERS.name, name)])


def operators_identity() -> str:
    """Return what stands for the operators that packages have added to ours."""
    return json.dumps(
        sorted({entry.name: _plugin(OPERATORS, entry.name) for entry in entry_points(group=OPERATORS)}.items())
    )


def _plugin(group: str, name: str) -> str:
    """Return package, version and code of what an entry point names; our own code is in every key anyway."""
    for entry in entry_points(group=group, name=name):
        top = entry.module.partition(".")[0]
        if top == "foresee_dsl":
            return ""
        package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else ""
        return f"{package} {_module_digest(top)}"
    return ""


def _module_digest(top: str) -> str:
    with suppress(ImportError, ValueError):
        spec = find_spec(top)
        if spec is not None and spec.submodule_search_locations:
            return _digest(Path(next(iter(spec.submodule_search_locations))))
        if spec is not None and spec.origin is not None:
            return _digest(Path(spec.origin))
    return ""


def _files_named(argument: str) -> str:
    try:
        words = shlex.split(argument)
    except ValueError:
        words = [argument]
    return " ".join(_digest(Path(word)) for word in words if word and Path(word).is_file())


def _digest(place: Path) -> str:
    """Return a hash over a file, or over the names and files of a folder without what Python leaves there."""
    digest = hashlib.sha256()
    for file in _sources(place):
        data = file.read_bytes()
        digest.update(f"{file.relative_to(place).as_posix()} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()[:KEY_DIGITS]


def _sources(place: Path) -> list[Path]:
    if place.is_file():
        return [place]
    found = (f for f in place.rglob("*") if f.is_file() and "__pycache__" not in f.parts and f.suffix != ".pyc")
    return sorted(found, key=lambda file: file.relative_to(place).as_posix())


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
