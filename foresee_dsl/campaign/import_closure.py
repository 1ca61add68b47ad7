"""Finds the code that a module depends on: all modules that it imports, directly or indirectly.

Only modules of this package and of plug-in packages count.

Imports are read from the sources, including imports inside functions but not those for type checkers only; no module is
imported. So the result is the same in a checkout and in a wheel built from it. This package imports none of its
plug-ins, so its own code hash is the same with and without them.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path

from foresee_dsl.files import PACKAGE, cache_folder, write_whole

DIGITS = 40
"""Number of hexadecimal digits of a hash. Ours: 160 bits; among a billion hashes, the probability that two are equal is
below 1e-30.
"""
_CACHE = "imports-2.json"
"""Cache file of the imports of each source, by the source's hash, as reading 230 sources took 2 s. The number in the
name must be raised when `imports_of` changes."""
_GROUPS = "foresee_dsl."
"""Prefix of the entry-point groups of plug-ins."""


def import_closure(modules: Iterable[str]) -> tuple[str, ...]:
    """Return modules and all that they import, sorted: of this package, of their packages and of plug-in packages."""
    ahead = list(modules)
    sources, closure = _modules(_followed(ahead)), set[str]()
    imports, fresh = _cached_imports(), dict[str, list[str]]()
    while ahead:
        name = ahead.pop()
        if name in closure or name not in sources:
            continue
        closure.add(name)
        ahead.extend(
            name[:end] for end in range(len(name)) if name[end] == "."
        )  # packages are executed before their modules
        digest = file_hash(sources[name])
        if digest not in imports:
            imports[digest] = fresh[digest] = sorted(set(imports_of(sources[name].read_bytes())))
        ahead.extend(_absolute(imported, name, sources[name]) for imported in imports[digest])
    if fresh:
        _cache_imports(imports)
    return tuple(sorted(closure))


def imports_in(files: Sequence[Path]) -> set[str]:
    """Return the imports of source files (`imports_of`); one that this version of Python cannot parse has none."""
    imports, fresh, names = _cached_imports(), False, set[str]()
    for file in files:
        source = file.read_bytes()
        digest = hashlib.sha256(source).hexdigest()[:DIGITS]
        if digest not in imports:
            with suppress(SyntaxError, ValueError):
                imports[digest], fresh = sorted(set(imports_of(source))), True
        names.update(imports.get(digest, ()))
    if fresh:
        _cache_imports(imports)
    return names


@cache
def code_of(*modules: str) -> str:
    """Return a hash of the code of modules and of all that they import (`import_closure`)."""
    sources = _modules(_followed(modules))
    parts = (f"{name} {file_hash(sources[name])}\n" for name in import_closure(modules))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:DIGITS]


def imports_of(source: bytes) -> Iterator[str]:
    """Yield the imports of a source: modules, and `MODULE.NAME`, which may be a module or not.

    Relative imports are yielded as written: `.near.by`.
    """
    ahead: list[ast.AST] = [ast.parse(source)]
    while ahead:
        node = ahead.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            yield module
            yield from (f"{module}{'.' if node.module else ''}{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            ahead.extend(node.orelse)
        else:
            ahead.extend(ast.iter_child_nodes(node))


def with_plug_ins() -> frozenset[str]:
    """Return the names of this package and of all plug-in packages; no package is imported."""
    entries = (e for package in distributions() for e in package.entry_points if e.group.startswith(_GROUPS))
    return frozenset({PACKAGE.name, *(top_of(entry.module) for entry in entries)})


def top_of(module: str) -> str:
    """Return the top-level package of a module."""
    return module.partition(".")[0]


@cache
def file_hash(file: Path) -> str:
    """Return a hash of a file's bytes; each process reads a file once."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:DIGITS]


def _followed(modules: Iterable[str]) -> frozenset[str]:
    """Return the packages in which the imports of these modules are followed."""
    tops = {PACKAGE.name, *map(top_of, modules)}
    return frozenset(tops) if len(tops) == 1 else frozenset(tops | with_plug_ins())


@cache
def _modules(packages: frozenset[str]) -> dict[str, Path]:
    """Return the sources of packages, by module name."""
    return {name: file for package in packages for name, file in _modules_of(package).items()}


@cache
def _modules_of(package: str) -> dict[str, Path]:
    """Return the sources of one package, by module name; empty if it is not installed."""
    spec = None
    with suppress(ImportError, ValueError):
        spec = find_spec(package)
    if spec is None or not (folders := spec.submodule_search_locations):
        file = Path(spec.origin or "") if spec is not None else Path()
        return {package: file} if file.suffix == ".py" else {}
    sources = {}
    for folder in map(Path, folders):
        for file in folder.rglob("*.py"):
            parts = (package, *file.relative_to(folder).with_suffix("").parts)
            sources[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return sources


def _absolute(imported: str, module: str, file: Path) -> str:
    """Return the absolute name of an import: `.near` in `ours.far` is `ours.near`."""
    name = imported.lstrip(".")
    level = len(imported) - len(name)
    if not level:
        return name
    parts = module.split(".") if file.stem == "__init__" else module.split(".")[:-1]
    return ".".join([*parts[: len(parts) - level + 1], *([name] if name else [])])


@cache
def _cached_imports() -> dict[str, list[str]]:
    with suppress(OSError, ValueError):
        cached: dict[str, list[str]] = json.loads((cache_folder("imports") / _CACHE).read_text(encoding="utf-8"))
        return cached
    return {}


def _cache_imports(imports: dict[str, list[str]]) -> None:
    with suppress(OSError):  # a cache that cannot be written costs only time
        there = {file_hash(file) for package in with_plug_ins() for file in _modules_of(package).values()}
        used = {digest: names for digest, names in imports.items() if digest in there}
        write_whole(cache_folder("imports") / _CACHE, json.dumps(used))
