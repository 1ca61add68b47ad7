"""Compiles all kernels, in a process that is there for nothing else, and stores their machine code in one file."""

from __future__ import annotations

import hashlib
import os
import pickle
import pkgutil
import tempfile
from importlib import import_module
from pathlib import Path

from foresee_dsl.kernels.compiling import Kernel, name_of
from foresee_dsl.kernels.machine_code import Code

_FOLDER = Path(__file__).parent
_PACKAGE = __name__.rpartition(".")[0]


def build(name: str) -> None:
    """Compile all kernels, and store their machine code in a file."""
    file, found = Path(name), dict[str, Code]()
    with tempfile.TemporaryDirectory() as empty:  # what numba reads from its files has no machine code to store
        os.environ["NUMBA_CACHE_DIR"] = empty
        for info in pkgutil.walk_packages([str(_FOLDER)], f"{_PACKAGE}."):
            for value in list(vars(import_module(info.name)).values()):
                if isinstance(value, Kernel) and name_of(value.py_func) not in found:
                    found[name_of(value.py_func)] = _code_of(value)
    content = pickle.dumps(found)
    with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as out:
        out.write(hashlib.sha256(content).digest() + content)
    Path(out.name).chmod(0o644)
    Path(out.name).replace(file)
    for other in file.parent.glob(f"{file.name.rpartition('-')[0]}-*"):
        if other != file:  # of the kernels before they were edited
            other.unlink(missing_ok=True)


def _code_of(kernel: Kernel) -> Code:
    (result,) = kernel.dispatcher.overloads.values()
    _, _, (content, _) = result.library.serialize_using_object_code()
    constants = {
        one.env_name: list(one.consts) for one in (*result._find_referenced_environments(), result.environment)
    }
    return Code(content, result.fndesc.llvm_cpython_wrapper_name, result.fndesc.env_name, constants)
