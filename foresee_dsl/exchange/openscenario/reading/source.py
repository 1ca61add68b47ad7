"""Reads OpenSCENARIO XML: parameters get their values, references to catalogues the entries that they mean."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.project.addresses import is_inside, project_folder

WHAT = "an OpenSCENARIO file"
_LONGEST_EXPRESSION = 500
_MOST_CATALOGUES = 200
"""Files of a folder that are looked at (ours: collections have a few dozen)."""
_PARAMETER = re.compile(r"\$([A-Za-z_][\w.]*)")
_OPERATORS: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    function.__name__: function for function in (round, math.floor, math.ceil, math.sqrt, math.pow, abs, min, max)
}


@dataclass
class Source:
    """One file, with its parameters' values put in.

    Attributes:
        path: the file. root: its `<OpenSCENARIO>`.
        roots: folders that the file may name other files in.
    """

    path: Path
    root: Element
    roots: tuple[Path, ...]

    def named(self, written: str, what: str) -> Path:
        """Return a file or folder that the scenario names, relative to itself; an `ExchangeError` for one that is
        missing or lies outside the scenario's project."""
        path = self.path.parent / written.replace("\\", "/")
        if not is_inside(path, self.roots):
            raise ExchangeError(
                f"{self.path} names {what} '{written}' outside its project folder: move it there, or allow it with "
                "--allow-outside"
            )
        if not path.exists():
            raise ExchangeError(f"{self.path} names {what} '{written}', which does not exist")
        return path

    def entry(self, reference: Element) -> Element:
        """Return what a `<CatalogReference>` means, with the parameters that it assigns."""
        catalogue, name = reference.get("catalogName", ""), reference.get("entryName", "")
        if catalogue not in self._all:
            known = ", ".join(sorted(self._all)) or "none"
            raise ExchangeError(
                f"{self.path} takes '{name}' from the catalogue '{catalogue}', which is not in its folders of "
                f"catalogues (there: {known})"
            )
        found = self._all[catalogue].get(name)
        if found is None:
            raise ExchangeError(f"the catalogue '{catalogue}' of {self.path} has no entry '{name}'")
        given = {
            item.get("parameterRef", "").lstrip("$"): item.get("value", "")
            for item in reference.iterfind("ParameterAssignments/ParameterAssignment")
        }
        return resolved(found, {}, given)

    @property
    def description(self) -> str:
        """What the file's header says of it."""
        header = self.root.find("FileHeader")
        return header.get("description", "").strip() if header is not None else ""

    @cached_property
    def _all(self) -> dict[str, dict[str, Element]]:
        """All catalogues by name, with their entries by name."""
        found: dict[str, dict[str, Element]] = {}
        for directory in self.root.iterfind("CatalogLocations/*/Directory"):
            folder = self.named(directory.get("path", ""), "the folder of catalogues")
            files = [folder] if folder.is_file() else sorted(folder.glob("*.xosc"))[:_MOST_CATALOGUES]
            for file in files:
                catalogue = parse_xml(file, "OpenSCENARIO", WHAT, ExchangeError).find("Catalog")
                if catalogue is not None:
                    entries = found.setdefault(catalogue.get("name", ""), {})
                    entries |= {entry.get("name", ""): entry for entry in catalogue}
        return found


def read_source(path: Path, *, allow_outside: bool) -> Source:
    """Read a `.xosc` file of version 1; with `allow_outside` it may name files anywhere, else in its project folder."""
    root = parse_xml(path, "OpenSCENARIO", WHAT, ExchangeError)
    header = root.find("FileHeader")
    if header is None or header.get("revMajor") != "1":
        version = "nothing" if header is None else f"{header.get('revMajor')}.{header.get('revMinor')}"
        raise ExchangeError(f"{path} is of version {version}; OpenSCENARIO XML 1.0 to 1.3 are read")
    if root.find("Storyboard") is None:
        raise ExchangeError(f"{path} has no storyboard: it is a catalogue or a distribution of parameters")
    folder = path.absolute().parent
    roots = (Path(folder.anchor),) if allow_outside else (project_folder(folder), project_folder(Path.cwd()))
    try:
        return Source(path, resolved(root, {}, {}), roots)
    except ExchangeError as err:
        raise ExchangeError(f"{path}: {err}") from err


def resolved(element: Element, values: Mapping[str, str], given: Mapping[str, str]) -> Element:
    """Return a copy of an element in which `$parameter` and `${expression}` are replaced by their values.

    Parameters that it declares hold inside it; those of what it stands in are `values`. `given`: values for its own.
    """
    from xml.etree.ElementTree import Element as New

    declared = element.iterfind("ParameterDeclarations/ParameterDeclaration")
    inside = dict(values)
    for item in declared:
        name = item.get("name", "")
        inside[name] = given.get(name) or value_of(item.get("value", ""), inside)
    copy = New(element.tag, {name: value_of(text, inside) for name, text in element.attrib.items()})
    copy.text = element.text
    copy.extend([resolved(child, inside, {}) for child in element if child.tag != "ParameterDeclarations"])
    return copy


def value_of(text: str, values: Mapping[str, str]) -> str:
    """Return an attribute's text with its parameters and expressions replaced by their values.

    A parameter that is not declared, or an expression that is none, is an `ExchangeError`.
    """

    def given(match: re.Match[str]) -> str:
        if match.group(1) not in values:
            raise ExchangeError(f"the parameter ${match.group(1)} is not declared")
        return values[match.group(1)]

    if text.startswith("${") and text.endswith("}"):
        return _calculated(_PARAMETER.sub(given, text[2:-1]))
    return _PARAMETER.sub(given, text)


def _calculated(expression: str) -> str:
    """Return the value of an arithmetic expression; nothing else is understood, so that nothing can be executed."""
    try:
        if len(expression) > _LONGEST_EXPRESSION:
            raise ValueError("it is too long")
        value = _number(ast.parse(expression.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError, TypeError, RecursionError, MemoryError) as err:
        raise ExchangeError(f"the expression '{expression[:80]}' cannot be computed: {err}") from err
    return repr(value)


def _number(node: ast.expr) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_number(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return float(_OPERATORS[type(node.op)](_number(node.left), _number(node.right)))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS:
        return float(_FUNCTIONS[node.func.id](*(_number(argument) for argument in node.args)))
    raise ValueError("only numbers, + - * / %, brackets and simple functions are understood")
