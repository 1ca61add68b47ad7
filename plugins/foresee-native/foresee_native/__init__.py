"""Reads the vehicles in SUMO after each step with compiled code: entry point `native` of `foresee_dsl.vehicle_readers`.

The library is built at its first use, where a C++ compiler is, into the user's cache folder (`building`).
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence

import libsumo
import numpy as np

from foresee_dsl.errors import SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.vehicle_reader import PythonReader
from foresee_native.building import library

OTHER_VEHICLES, SUMO_FAILED = -1, -2
"""Results of the library's functions that are not a number of vehicles; `reader.cpp` has the same."""


class NativeReader:
    """Reads with compiled code; see `foresee_dsl.simulate.vehicle_reader.VehicleReader`.

    Lanes on which the order of vehicles is wrong are rare, so `PythonReader` finds out which ones they are.
    """

    def __init__(self) -> None:
        """Build and load the library; raises `SimulationError` with the reason if that is not possible here."""
        self._library = _declared(ctypes.CDLL(str(library())))
        self._reader = self._library.foresee_new()
        self._python = PythonReader(libsumo, (libsumo.TraCIException, libsumo.FatalTraCIError))
        self._bodies: tuple[str, ...] = ()
        self.follow((), ())

    def __del__(self) -> None:
        """Free the memory of the library."""
        if hasattr(self, "_reader"):
            self._library.foresee_delete(self._reader)

    def follow(self, names: Sequence[str], on_road: Sequence[str]) -> None:
        """See `VehicleReader`."""
        self.numbers: FloatArray = np.empty(3 * len(names))
        self._changed = np.empty(len(names), dtype=np.int32)
        # ctypes takes longer to get the addresses than to make the call.
        self._addresses = self.numbers.ctypes.data, self._changed.ctypes.data
        self._library.foresee_follow(self._reader, _lines(names), _lines(on_road))

    def read(self) -> Sequence[int] | None:
        """See `VehicleReader`; raises `SimulationError` if SUMO cannot read a vehicle."""
        count = self._library.foresee_read(self._reader, *self._addresses)
        if count > 0:
            indices: list[int] = self._changed[:count].tolist()
            return indices
        if count == SUMO_FAILED:
            raise SimulationError("SUMO stopped: it cannot read a vehicle after a step")
        return None if count == OTHER_VEHICLES else ()

    def lane(self, index: int) -> str:
        """See `VehicleReader`."""
        name: bytes = self._library.foresee_lane(self._reader, index)
        return name.decode()

    def disordered(self, bodies: Sequence[str]) -> Sequence[str]:
        """See `VehicleReader`."""
        if bodies != self._bodies:
            self._bodies = tuple(bodies)
            self._library.foresee_watch(self._reader, _lines(bodies))
        return () if self._library.foresee_in_order(self._reader) == 1 else self._python.disordered(bodies)


def _lines(names: Iterable[str]) -> bytes:
    return "".join(f"{name}\n" for name in names).encode()


def _declared(library: ctypes.CDLL) -> ctypes.CDLL:
    """Declare the types of the library's functions."""
    pointer, text, number = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int
    functions: dict[str, tuple[object, list[object]]] = {
        "foresee_new": (pointer, []),
        "foresee_delete": (None, [pointer]),
        "foresee_follow": (None, [pointer, text, text]),
        "foresee_read": (number, [pointer, pointer, pointer]),
        "foresee_lane": (text, [pointer, number]),
        "foresee_watch": (None, [pointer, text]),
        "foresee_in_order": (number, [pointer]),
    }
    for name, (result, arguments) in functions.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
