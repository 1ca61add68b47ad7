"""The code that a module depends on: itself and all modules of this package that it imports, directly or not.

Imports are read from the sources, those inside functions included and those for type checkers alone left out; nothing
is imported. So the answer is the same in a checkout and in a wheel that was built from it.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from foresee_dsl.files import cache_folder, write_whole

DIGITS = 40
"""Hexadecimal digits of a hash. Ours: 160 bits; two of a billion are the same with a chance below 1e-30."""
_PACKAGE = Path(__file__).resolve().parents[1]
_CACHE = "imports-1.json"
"""What each source imports, by the source's hash, is cached between processes: reading 230 sources took 2 s. The
number is raised when `imports_of` changes."""


def import_closure(modules: Iterable[str]) -> tuple[str, ...]:
    """Return modules of this package and all that they import, sorted. What is no module of it is left out."""
    known, found, ahead = _modules(), set[str](), list(modules)
    imports, fresh = _cached_imports(), dict[str, list[str]]()
    while ahead:
        name = ahead.pop()
        if name in found or name not in known:
            continue
        found.add(name)
        ahead.extend(name[:end] for end in range(len(name)) if name[end] == ".")  # packages run before what is in them
        digest = file_hash(known[name])
        if digest not in imports:
            imports[digest] = fresh[digest] = sorted(set(imports_of(known[name].read_bytes())))
        ahead.extend(imports[digest])
    if fresh:
        _cache_imports(imports)
    return tuple(sorted(found))


@cache
def code_of(*modules: str) -> str:
    """Return a hash over the code of modules of this package and of all that they import."""
    known = _modules()
    parts = (f"{name} {file_hash(known[name])}\n" for name in import_closure(modules))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:DIGITS]


def imports_of(source: bytes) -> Iterator[str]:
    """Yield what a source imports from this package: modules, and `MODULE.NAME` where it may be a module or not."""
    ahead: list[ast.AST] = [ast.parse(source)]
    while ahead:
        node = ahead.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if _ours(alias.name))
        elif isinstance(node, ast.ImportFrom):
            # Relative imports are another package's own: this one has none (a test looks).
            if node.module and not node.level and _ours(node.module):
                yield node.module
                yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            ahead.extend(node.orelse)
        else:
            ahead.extend(ast.iter_child_nodes(node))


@cache
def file_hash(file: Path) -> str:
    """Return a hash over a file's bytes; a process reads each file once."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:DIGITS]


@cache
def _modules() -> dict[str, Path]:
    """Return the sources of this package by the modules' names."""
    found = {}
    for file in _PACKAGE.rglob("*.py"):
        parts = (_PACKAGE.name, *file.relative_to(_PACKAGE).with_suffix("").parts)
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def _ours(name: str) -> bool:
    return name.partition(".")[0] == _PACKAGE.name


@cache
def _cached_imports() -> dict[str, list[str]]:
    with suppress(OSError, ValueError):
        cached: dict[str, list[str]] = json.loads((cache_folder("imports") / _CACHE).read_text(encoding="utf-8"))
        return cached
    return {}


def _cache_imports(imports: dict[str, list[str]]) -> None:
    with suppress(OSError):  # a cache that cannot be written costs time, nothing else
        there = {file_hash(file) for file in _modules().values()}
        used = {digest: names for digest, names in imports.items() if digest in there}
        write_whole(cache_folder("imports") / _CACHE, json.dumps(used))
