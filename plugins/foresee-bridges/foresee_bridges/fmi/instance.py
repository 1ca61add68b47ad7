"""An FMU (FMI 2.0 or 3.0, co-simulation): its file, and one instance of it, which lives in an unpacked folder."""

from __future__ import annotations

import contextlib
import io
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.files import read_outside, short_hash
from foresee_dsl.limits import most, raised_by

_WHOLE_NUMBERS = ("Integer", "Enumeration", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))
_SHOWN = 3
"""Number of messages of the FMU that an error quotes."""


def fmpy() -> Any:  # noqa: ANN401  a module without types
    """Return the package fmpy.

    Raises:
        DriverUnavailableError: it is not installed.
    """
    try:
        import fmpy
    except ModuleNotFoundError:
        raise DriverUnavailableError("FMUs as drivers need fmpy: pip install 'foresee-bridges[fmi]'") from None
    return fmpy


class FmuFile:
    """The file of an FMU that can be instantiated here.

    Attributes:
        description: fmpy's model description. digest: the first digits of the file's SHA-256.
    """

    def __init__(self, file: Path) -> None:
        """Read and check an FMU.

        Raises:
            DriverError: the file cannot be read, or is not an FMU for co-simulation with a binary for this platform.
        """
        library = fmpy()
        try:
            self._content = read_outside(file)
        except OSError as err:
            raise DriverError(f"{file} cannot be read: {err.strerror or err}") from None
        self.digest = short_hash(self._content)
        try:
            with zipfile.ZipFile(io.BytesIO(self._content)) as archive:
                self._check_archive(archive, file)
            self.description: Any = library.read_model_description(io.BytesIO(self._content), validate=False)
            platforms = library.supported_platforms(io.BytesIO(self._content))
        except DriverError:
            raise
        except zipfile.BadZipFile:
            raise DriverError(f"{file} is not an FMU: it is not a ZIP archive") from None
        except Exception as err:  # fmpy's errors have no common class
            raise DriverError(f"{file} is not an FMU that fmpy can read: {_in_one_line(err)}") from None
        version = str(self.description.fmiVersion)
        if version != "2.0" and not version.startswith("3."):
            raise DriverError(f"{file} is an FMU of FMI {version}; export it as FMI 3.0 or 2.0")
        if self.description.coSimulation is None:
            raise DriverError(f"{file} is not for co-simulation; export the FMU with the interface type Co-Simulation")
        here = library.platform if version == "2.0" else library.platform_tuple
        if library.platform not in platforms and here not in platforms:
            raise DriverError(
                f"{file} has no binary for this platform ({here}); it has {', '.join(platforms) or 'none'}"
            )

    @staticmethod
    def _check_archive(archive: zipfile.ZipFile, file: Path) -> None:
        names = archive.namelist()
        if "modelDescription.xml" not in names:
            raise DriverError(f"{file} is not an FMU: it has no modelDescription.xml")
        outside = [name for name in names if name.startswith("/") or ".." in Path(name).parts or ":" in name]
        if outside or any("\\" in name for name in names):
            raise DriverError(f"{file} has files with paths that lead out of it: {(outside or names)[0]!r}")
        size_mb = sum(entry.file_size for entry in archive.infolist()) / 1e6
        if size_mb > most("file"):
            raise DriverError(f"{file} has {size_mb:.0f} MB unpacked; {raised_by('file', size_mb)}")

    def unpack(self, folder: Path) -> None:
        """Write the files of the FMU into a folder."""
        with zipfile.ZipFile(io.BytesIO(self._content)) as archive:
            archive.extractall(folder)


class FmuInstance:
    """An instance of an FMU in a temporary folder: set variables, `begin`, then `step` and `get`; `close` frees it."""

    def __init__(self, file: FmuFile) -> None:
        """Unpack and instantiate the FMU.

        Raises:
            DriverError: its binary cannot be loaded, or it refuses to be instantiated.
        """
        from fmpy.simulation import instantiate_fmu

        self._is_fmi3 = str(file.description.fmiVersion).startswith("3.")
        self._messages: list[str] = []
        self._fmu: Any = None
        self._folder = Path(tempfile.mkdtemp(prefix="foresee-fmu-"))
        try:
            file.unpack(self._folder)
            self._fmu = instantiate_fmu(str(self._folder), file.description, "CoSimulation", logger=self._log)
        except Exception as err:  # fmpy raises plain exceptions
            self.close()
            raise DriverError(f"the FMU cannot be instantiated: {_in_one_line(err)}{self._last_words()}") from None

    def begin(self) -> None:
        """Initialise the FMU at time 0; constants must be set before, inputs may be."""
        if not self._is_fmi3:
            self._call("setupExperiment", startTime=0.0)
        self._call("enterInitializationMode")
        self._call("exitInitializationMode")

    def set(self, variables: Iterable[tuple[Any, float | FloatArray]]) -> None:
        """Set variables; a longer array is cut, and a shorter one gets zeros behind it."""
        references: dict[str, list[int]] = {}
        numbers: dict[str, list[float]] = {}
        for variable, value in variables:
            references.setdefault(variable.type, []).append(variable.valueReference)
            numbers.setdefault(variable.type, []).extend(_fitted(value, variable.shape))
        for kind, group in references.items():
            self._call(f"set{self._suffix(kind)}", group, _typed(kind, numbers[kind]))

    def get(self, variables: Sequence[Any]) -> list[float]:
        """Return the values of variables that are single numbers."""
        return [
            float(self._call(f"get{self._suffix(variable.type)}", [variable.valueReference])[0])
            for variable in variables
        ]

    def step(self, time_s: float, step_s: float) -> bool:
        """Advance the FMU by a step; return False if it wants the simulation to end."""
        done = self._call("doStep", time_s, step_s)
        return not (self._is_fmi3 and done[1])

    def close(self) -> None:
        """Free the instance, unload its binary and remove its folder. It never raises, and may be called again."""
        fmu, self._fmu = self._fmu, None
        if fmu is not None:
            with contextlib.suppress(Exception):  # an FMU may refuse to end in order after an error
                fmu.terminate()
            with contextlib.suppress(Exception):
                fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _suffix(self, kind: str) -> str:
        if kind == "Enumeration":
            return "Int64" if self._is_fmi3 else "Integer"
        return kind

    def _call(self, name: str, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401  fmpy has no types
        try:
            return getattr(self._fmu, name)(*arguments, **options)
        except Exception as err:  # fmpy raises plain exceptions
            raise DriverError(f"the FMU failed: {_in_one_line(err)}{self._last_words()}") from None

    def _log(self, *arguments: Any) -> None:  # noqa: ANN401  FMI 2 and 3 pass different arguments
        """Keep the last of the FMU's messages; the text is the last argument in FMI 2 and 3."""
        text = arguments[-1]
        words = text.decode(errors="replace") if isinstance(text, bytes) else str(text)
        self._messages = [*self._messages, words][-_SHOWN:]

    def _last_words(self) -> str:
        words = " | ".join(" ".join(message.split()) for message in self._messages if message.strip())
        return f"; its last messages: {words}" if words else ""


def _fitted(value: float | FloatArray, shape: tuple[int, ...] | None) -> list[float]:
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    size = int(np.prod(shape)) if shape else 1
    fitted = np.zeros(size)
    fitted[: min(size, len(numbers))] = numbers[:size]
    return [float(number) for number in fitted]


def _typed(kind: str, numbers: list[float]) -> list[Any]:
    if kind == "Boolean":
        return [number != 0 for number in numbers]
    return [round(number) for number in numbers] if kind in _WHOLE_NUMBERS else numbers


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
