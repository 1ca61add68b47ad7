"""Builds the library from `reader.cpp`, once for each version of SUMO and of the source, into the user's cache
folder.

It is linked to the library inside libsumo's Python package, which exports SUMO's C++ functions and is loaded in the
process already. Their headers come with the package `eclipse-sumo` of the same version.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import libsumo
import sumo

from foresee_dsl.errors import SimulationError
from foresee_dsl.files import cache_folder, replacing

SOURCE = Path(__file__).parent / "reader.cpp"
COMPILERS = ("c++", "g++", "clang++")
"""Names of C++ compilers, tried in this order; the environment variable CXX comes before them."""
OPTIONS = ("-std=c++17", "-O2", "-shared", "-fPIC", "-Wl,--allow-shlib-undefined")
"""Options of the compiler. The last one: the libraries that SUMO itself needs are found when it is loaded."""
_LONGEST_S = 120.0
"""Time after which a compiler is stopped, s. Ours: it takes 1 s of CPU time."""


def library() -> Path:
    """Return the built library; raises `SimulationError` with the reason if it cannot be built here."""
    if sys.platform != "linux":
        raise SimulationError("the compiled reader is for Linux only")
    linked = _library_of_sumo()
    parts = (SOURCE.read_bytes(), str(linked).encode(), version("libsumo").encode(), " ".join(OPTIONS).encode())
    key = hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]
    built = cache_folder("native") / f"reader-{key}.so"
    if built.exists():
        return built
    refusal = built.with_suffix(".txt")
    if refusal.exists():
        raise SimulationError(f"{refusal.read_text(encoding='utf-8')}; to try again, delete {refusal}")
    compiler, headers = _compiler(), _headers()
    with replacing(built) as temporary:
        command = (compiler, *OPTIONS, f"-I{headers}", "-o", str(temporary), str(SOURCE), str(linked))
        try:
            subprocess.run(command, capture_output=True, text=True, check=True, timeout=_LONGEST_S)  # noqa: S603 - the compiler of this machine, with our own source
        except (OSError, subprocess.SubprocessError) as err:
            message = f"{compiler} cannot build the compiled reader: {_first_line(err)}"
            refusal.write_text(message, encoding="utf-8")
            raise SimulationError(message) from err
    return built


def _compiler() -> str:
    names = (os.environ["CXX"],) if os.environ.get("CXX") else COMPILERS
    for name in names:
        if path := shutil.which(name):
            return path
    raise SimulationError(f"no C++ compiler: none of {', '.join(names)} is installed")


def _library_of_sumo() -> Path:
    """Return the shared library inside the package `libsumo`."""
    for folder in libsumo.__path__:
        for file in sorted(Path(folder).glob("_libsumo*.so")):
            return file.resolve()
    raise SimulationError("the package libsumo has no shared library")


def _headers() -> Path:
    """Return the folder with the folder of SUMO's C++ headers, of the same version as libsumo."""
    try:
        beside = version("eclipse-sumo")
    except PackageNotFoundError as err:
        raise SimulationError("the package eclipse-sumo, which has SUMO's headers, is not installed") from err
    if beside != version("libsumo"):
        raise SimulationError(f"the headers of eclipse-sumo {beside} do not belong to libsumo {version('libsumo')}")
    headers = Path(sumo.SUMO_HOME) / "include"
    if not (headers / "libsumo" / "Vehicle.h").is_file():
        raise SimulationError("the package eclipse-sumo has no C++ headers")
    return headers


def _first_line(err: Exception) -> str:
    stderr = getattr(err, "stderr", None) or ""
    lines = [line for line in str(stderr).splitlines() if "error" in line] or str(err).splitlines()
    return lines[0] if lines else type(err).__name__
