"""The machine code of all kernels in one file, which numba makes once and which is loaded without numba.

To import numba and to load each kernel from its own file took a run 1.2 s of CPU; llvmlite, which numba is made of,
links the same machine code in 50 ms. What it calls while it runs is in three C modules of numba's, which are loaded
by themselves. This holds for the versions and the system with which it was tried (`_TRIED`); with others, numba loads
and compiles each kernel as it does for everybody.
"""

from __future__ import annotations

import builtins
import ctypes
import fcntl
import hashlib
import importlib.util
import os
import pickle
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

_HERE = Path(__file__).parent
_TRIED = ("0.68.", "linux", "x86_64")
"""numba's version begins so; the system; the processor."""
_MATHS = (
    *("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh", "atanh", "atan2", "exp"),
    *("expm1", "log", "log10", "log1p", "pow", "sqrt", "fabs", "fmod", "floor", "ceil", "round", "trunc"),
)
"""What numba (0.68.1) binds to the functions that it was linked with."""
SUM_BYTES = 32
_BUILDING = f"{__package__}.building"


class Code(NamedTuple):
    """One kernel's machine code: an object file.

    Attributes:
        symbol: of the function that takes Python's arguments. environment: of what it finds its constants by.
        constants: by such symbols, its own and those of the functions inside it.
    """

    content: bytes
    symbol: str
    environment: str
    constants: dict[str, list[Any]]


@cache
def state_of(folder: Path) -> str:
    """Return a short hash of the contents of all Python files in a folder and those within it."""
    found = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        found.update(file.read_bytes())
    return found.hexdigest()[:12]


@cache
def ensure() -> None:
    """Compile all kernels of this folder where that was not done yet, and where it can be stored."""
    file = _file()
    if _BUILDING in sys.modules or file is None or file.exists():
        return
    with suppress(OSError), _alone(file.parent):
        if file.exists():  # another process was faster
            return
        if sys.stderr.isatty():
            sys.stderr.write("compiling the inner loops for this machine, once (about a minute) ...\n")
        # In a process of its own, so that this one does without numba.
        code = f"import sys; sys.path.insert(0, sys.argv[1]); from {_BUILDING} import build; build(sys.argv[2])"
        command = [sys.executable, "-c", code, str(_HERE.parent.parent), str(file)]
        subprocess.run(command, check=False, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)  # noqa: S603 - ours


@cache
def stored() -> Mapping[str, Callable[..., Any]]:
    """Return the machine code of kernels, by name; none where it is not stored, or cannot be loaded."""
    file = _file()
    if file is None or not file.exists():
        return {}
    try:
        found = file.read_bytes()
        if hashlib.sha256(found[SUM_BYTES:]).digest() != found[:SUM_BYTES]:
            raise ValueError("it is damaged")
        return _linked(pickle.loads(found[SUM_BYTES:]))  # noqa: S301 - our own, whole, and beside our modules
    except (OSError, ValueError, LookupError, AttributeError, ImportError, RuntimeError):
        with suppress(OSError):
            file.unlink()  # the next process compiles it again
        return {}


def _linked(codes: Mapping[str, Code]) -> dict[str, Callable[..., Any]]:
    """Link machine code as numba does, into this process."""
    import llvmlite.binding as llvm

    functions: Any = _named_to_the_linker()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    for code in codes.values():
        engine.add_object_file(llvm.ObjectFileRef.from_data(code.content))
    engine.finalize_object()
    found: dict[str, Callable[..., Any]] = {}
    held: dict[str, object] = {}
    for name, code in codes.items():
        module = sys.modules.get(name.rpartition(".")[0]) or ModuleType(name.rpartition(".")[0])
        for symbol, constants in code.constants.items():
            place = engine.get_global_value_address(symbol)
            if place and symbol not in held:
                held[symbol] = environment = functions.Environment(vars(module))
                environment.consts.extend(constants)
                ctypes.c_void_p.from_address(place).value = id(environment)
        address = engine.get_function_address(code.symbol)
        if not address:
            raise LookupError(f"no machine code of {name}")
        environment = held.get(code.environment) or functions.Environment(vars(module))
        found[name] = functions.make_function(module, name.rpartition(".")[2], "", address, environment, (engine, held))
    return found


def _named_to_the_linker() -> Any:  # noqa: ANN401 - a module without types
    """Name to LLVM what machine code calls, as numba (0.68.1) does; return its module of functions."""
    import llvmlite.binding as llvm

    functions, helpers, memory = map(_part_of_numba, ("_dynfunc", "_helperlib", "core.runtime._nrt_python"))
    addresses = {f"numba_{name}": address for part in (helpers, functions) for name, address in part.c_helpers.items()}
    addresses |= {name: helpers.c_helpers[name] for name in _MATHS}
    for name, address in memory.c_helpers.items():
        addresses[name if name.startswith("_") else f"NRT_{name}"] = address
    for error in vars(builtins).values():
        if isinstance(error, type) and issubclass(error, BaseException):
            addresses[f"PyExc_{error.__name__}"] = id(error)
    addresses["_Py_NoneStruct"] = id(None)
    addresses["numba_unpickle"] = ctypes.cast(_UNPICKLE, ctypes.c_void_p).value or 0
    for name, address in addresses.items():
        llvm.add_symbol(name, address)
    return functions


def _part_of_numba(name: str) -> Any:  # noqa: ANN401 - a module without types
    """Load a C module of numba's without numba."""
    if (whole := sys.modules.get(f"numba.{name}")) is not None:
        return whole
    package = importlib.util.find_spec("numba")
    if package is None or package.origin is None:
        raise ImportError("numba is not installed")
    file = Path(package.origin).parent.joinpath(*name.split(".")).with_suffix(EXTENSION_SUFFIXES[0])
    spec = importlib.util.spec_from_file_location(f"numba.{name}", file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is no module")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_constants: dict[int, object] = {}


def _unpickled_at(place: int, size: int, _: int) -> object:
    """Return a constant in our machine code, which stays where it is; `numpy.ndarray`, for example."""
    if place not in _constants:
        _constants[place] = pickle.loads(ctypes.string_at(place, size))  # noqa: S301 - ours
    return _constants[place]


_UNPICKLE = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)(_unpickled_at)
"""Stands for numba's function of that name, which imports numba (0.68.1)."""


@cache
def _file() -> Path | None:
    """Return where machine code is stored: for these kernels, this processor, and these versions; None for nowhere."""
    version, system, processor = _TRIED
    numba, llvm = importlib.util.find_spec("numba"), importlib.util.find_spec("llvmlite")
    if numba is None or numba.origin is None or llvm is None or llvm.origin is None:
        return None
    versions = [Path(one.origin or "").with_name("_version.py").read_text("utf-8") for one in (numba, llvm)]
    told = [name for name in os.environ if name.startswith("NUMBA_") and name != "NUMBA_CACHE_DIR"]
    if f'"version": "{version}' not in versions[0] or (sys.platform, platform.machine()) != (system, processor) or told:
        return None
    from llvmlite import binding

    parts = (*versions, sys.version, binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten())
    machine = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]
    folder = _HERE / "__pycache__"
    file = folder / f"kernels.{machine}-{state_of(_HERE)}"
    # Where it can neither be read nor written, numba has a folder of its own in the user's cache.
    return file if file.exists() or os.access(folder if folder.exists() else _HERE, os.W_OK) else None


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let one process at a time do what is in this block."""
    folder.mkdir(exist_ok=True)
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)
