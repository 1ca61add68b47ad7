"""Reader of OpenSCENARIO XML: parameters are replaced by values, catalogue references by their entries."""

from __future__ import annotations

import glob
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.project.addresses import is_inside, project_folder
from foresee_exchange.openscenario.losses import SourceError
from foresee_exchange.openscenario.reading.expressions import value_of

WHAT = "an OpenSCENARIO file"
_MOST_CATALOGUES = 200
"""Maximum number of files in a folder that are read (ours: collections have a few dozen)."""
_NAMES = ("name", "storyboardElementRef", "description", "author", "catalogName", "entryName", "license")
"""Attributes that are labels: they may look like expressions without being any."""
_REFERENCES = ("parameterRef", "variableRef")
"""Attributes that name a parameter itself, with or without a `$`, and not its value."""
_MINOR = ("0", "1", "2", "3")


@dataclass
class Source:
    """One file, with its parameters replaced by their values.

    Attributes:
        path: the file. root: its `<OpenSCENARIO>`.
        roots: folders in which the file may name other files.
        values: the values of the parameters of the whole file.
        missing: catalogue folders that do not exist. elsewhere: folder in which these are searched instead; or None.
    """

    path: Path
    root: Element
    roots: tuple[Path, ...]
    values: Mapping[str, str] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    elsewhere: Path | None = None

    def named(self, written: str, what: str, suffixes: tuple[str, ...] = ()) -> Path:
        """Return a file or folder that the scenario names, relative to itself; its name may lack one of `suffixes`.
        `ExchangeError` if it is missing or outside the scenario's project."""
        path = self.path.parent / written.replace("\\", "/")
        longer = [path.with_name(path.name + suffix) for suffix in suffixes if path.name]
        path = next((p for p in (path, *longer) if p.is_file()), path) if suffixes else path
        if not is_inside(path, self.roots):
            raise ExchangeError(
                f"{self.path} names {what} '{written}' outside its project folder: move it there, or allow it with "
                "--allow-outside"
            )
        if not path.exists():
            raise SourceError(f"{self.path} names {what} '{written}', which does not exist")
        return path

    def entry(self, reference: Element) -> Element:
        """Return the entry that a `<CatalogReference>` names, with the parameters that it assigns."""
        catalogue, name = reference.get("catalogName", ""), reference.get("entryName", "")
        entries = self._all.get(catalogue) or self._elsewhere(catalogue)
        if entries is None:
            names = ", ".join(sorted(self._all)) or "none"
            missing = "".join(f"; the folder '{folder}' does not exist" for folder in self.missing)
            raise SourceError(
                f"{self.path} takes '{name}' from the catalogue '{catalogue}', which is not in its folders of "
                f"catalogues (there: {names}){missing}"
            )
        element = entries.get(name)
        if element is None:
            raise SourceError(f"the catalogue '{catalogue}' of {self.path} has no entry '{name}'")
        assigned = {
            item.get("parameterRef", "").removeprefix("$"): item.get("value", "")
            for item in reference.iterfind("ParameterAssignments/ParameterAssignment")
        }
        return resolved(element, self.values, assigned)

    def referred(self, holder: Element | None, tag: str) -> Element | None:
        """Return the child element of a kind, or the one in a catalogue that the holder refers to."""
        if holder is None:
            return None
        reference = holder.find("CatalogReference")
        element = self.entry(reference) if reference is not None else holder.find(tag)
        return element if element is not None and element.tag == tag else None

    def variables(self) -> dict[str, str]:
        """Return the values of parameters and variables at the beginning."""
        values = dict(self.values)
        for item in self.root.iterfind("VariableDeclarations/VariableDeclaration"):
            values[item.get("name", "").removeprefix("$")] = item.get("value", "")
        return values

    @property
    def minor(self) -> int:
        """Return the second number of the standard's version."""
        header = self.root.find("FileHeader")
        return int(header.get("revMinor", "0")) if header is not None else 0

    @property
    def description(self) -> str:
        """Return the description in the file's header."""
        header = self.root.find("FileHeader")
        return header.get("description", "").strip() if header is not None else ""

    def _elsewhere(self, name: str) -> dict[str, Element] | None:
        """Return the entries of a catalogue whose folder is missing, from the folder `elsewhere`."""
        if self.elsewhere is None or not self.missing:
            return None
        entries: dict[str, Element] = {}
        for file in sorted(self.elsewhere.rglob(f"{name}.xosc"))[:_MOST_CATALOGUES]:
            catalogue = parse_xml(file, "OpenSCENARIO", WHAT, ExchangeError).find("Catalog")
            if catalogue is not None:
                entries = {entry.get("name", ""): entry for entry in catalogue} | entries
        return entries or None

    @cached_property
    def _all(self) -> dict[str, dict[str, Element]]:
        """Return all catalogues by name, with their entries by name."""
        catalogues: dict[str, dict[str, Element]] = {}
        for directory in self.root.iterfind("CatalogLocations/*/Directory"):
            written = directory.get("path", "")
            try:
                folder = self.named(written, "the folder of catalogues")
            except SourceError:
                self.missing.append(written)
                continue
            files = [folder] if folder.is_file() else sorted(folder.glob("*.xosc"))[:_MOST_CATALOGUES]
            for file in files:
                catalogue = parse_xml(file, "OpenSCENARIO", WHAT, ExchangeError).find("Catalog")
                if catalogue is not None:
                    for name in {catalogue.get("name", ""), file.stem}:  # references use either of the two names
                        entries = catalogues.setdefault(name, {})
                        entries |= {entry.get("name", ""): entry for entry in catalogue}
        return catalogues


def network_file(source: Source, chosen: Path | None, suffixes: tuple[str, ...]) -> Path:
    """Return the network of a scenario: the file `chosen`, or the named one (searched in `chosen` if that is a folder).

    A name without an ending, such as that of a CARLA town, belongs to a file with one of `suffixes`.
    """
    if chosen is None or chosen.is_dir():
        logic = source.root.find("RoadNetwork/LogicFile")
        written = logic.get("filepath", "") if logic is not None else ""
        if not written:
            raise SourceError(f"{source.path} names no network: choose one with --map")
        chosen = (
            source.named(written, "the network", suffixes) if chosen is None else _in_folder(source, chosen, written)
        )
    if not chosen.name.endswith(suffixes):
        raise ExchangeError(
            f"the network {chosen} is of an unsupported kind: choose a file {' or '.join(suffixes)} with --map"
        )
    return chosen


def _in_folder(source: Source, folder: Path, written: str) -> Path:
    try:
        return source.named(written, "the network", ())
    except SourceError:
        name = PurePosixPath(written.replace("\\", "/")).name
        files = [file for file in sorted(folder.rglob(f"{glob.escape(name)}*")) if file.is_file()]
        # The map is preferred to a net made from it, because a net may have other coordinates.
        for wanted in (name, f"{name}.xodr", f"{name}.net.xml"):
            for file in files:
                if file.name == wanted:
                    return file
        raise SourceError(f"{source.path} names the network '{written}', which is not in {folder}") from None


def project_roots(path: Path, *, allow_outside: bool) -> tuple[Path, ...]:
    """Return the folders in which a file may name other files: all folders with `allow_outside`, otherwise the folders
    of its project."""
    folder = path.absolute().parent
    return (Path(folder.anchor),) if allow_outside else (project_folder(folder), project_folder(Path.cwd()))


def declared_names(path: Path) -> set[str]:
    """Return the names of the parameters that a file declares."""
    root = parse_xml(path, "OpenSCENARIO", WHAT, ExchangeError)
    declarations = root.iterfind("ParameterDeclarations/ParameterDeclaration")
    return {item.get("name", "").removeprefix("$") for item in declarations}


def read_source(path: Path, *, allow_outside: bool, assigned: Mapping[str, str] | None = None) -> Source:
    """Read a `.xosc` file of version 1; with `allow_outside` it may name files anywhere, otherwise in its project.

    `assigned`: values that replace those of its parameter declarations.
    """
    root = parse_xml(path, "OpenSCENARIO", WHAT, ExchangeError)
    header = root.find("FileHeader")
    if header is None or header.get("revMajor") != "1" or header.get("revMinor") not in _MINOR:
        version = "nothing" if header is None else f"{header.get('revMajor')}.{header.get('revMinor')}"
        raise SourceError(f"{path} is of version {version}; OpenSCENARIO XML 1.0 to 1.3 are read")
    if root.find("Storyboard") is None:
        raise SourceError(f"{path} has no storyboard: it is a catalogue")
    roots, assigned = project_roots(path, allow_outside=allow_outside), assigned or {}
    try:
        return Source(path, resolved(root, {}, assigned), roots, declared(root, {}, assigned))
    except ExchangeError as err:
        raise type(err)(f"{path}: {err}") from err


def declared(element: Element, values: Mapping[str, str], assigned: Mapping[str, str]) -> dict[str, str]:
    """Return the parameters inside an element: the surrounding ones (`values`) and those that it declares."""
    inside = dict(values)
    for item in element.iterfind("ParameterDeclarations/ParameterDeclaration"):
        name = item.get("name", "").removeprefix("$")
        inside[name] = assigned.get(name) or value_of(item.get("value", ""), inside)
    return inside


def resolved(element: Element, values: Mapping[str, str], assigned: Mapping[str, str]) -> Element:
    """Return a copy of an element in which `$parameter` and `${expression}` are replaced by their values.

    `values`: surrounding parameters. `assigned`: values that replace those of the element's own declarations.
    """
    from xml.etree.ElementTree import Element as New

    inside = declared(element, values, assigned)
    copy = New(element.tag, {name: _attribute(element, name, text, inside) for name, text in element.attrib.items()})
    copy.text = element.text
    copy.extend([resolved(child, inside, {}) for child in element if child.tag != "ParameterDeclarations"])
    return copy


def _attribute(element: Element, name: str, text: str, values: Mapping[str, str]) -> str:
    if name in _REFERENCES:
        return text.removeprefix("$")
    return value_of(text, values, name=name in _NAMES or element.tag == "FileHeader")
