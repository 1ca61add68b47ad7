"""Compares two files or test cases that are named by address, with the networks and models that they use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.errors import InputError, with_article
from foresee_dsl.files import absolute, read_outside
from foresee_dsl.language import model as m
from foresee_dsl.language.diff.compare import diff_models
from foresee_dsl.language.diff.parts import GROUPS, Difference, Edit, Group, kind_of
from foresee_dsl.language.diff.plain import TextChange, texts
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import file_digest, models_named
from foresee_dsl.language.project import addresses
from foresee_dsl.language.project.catalogues import entries
from foresee_dsl.language.project.expand import expanded_model
from foresee_dsl.language.project.loading import Project

_Network = m.Network | Path | None
_RUNS = (m.Scenario, m.Extension, m.Clip, m.Mutant)
"""Kinds of definitions that are test cases, so that any two of them can be expanded and compared in full."""


@dataclass(frozen=True)
class Differences:
    """The result of comparing two addresses: `changes` lists the differences in meaning, `texts` the other
    differences."""

    old: str
    new: str
    changes: tuple[Difference, ...]
    texts: tuple[TextChange, ...] = ()

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"old": self.old, "new": self.new, "groups": self.groups, "changes": self.changes, "texts": self.texts}

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of the changes, in the order of the report."""
        return tuple(group for group in GROUPS if any(change.group == group for change in self.changes))


def compare_addresses(old: str, new: str, *, allow_outside: bool = True) -> Differences:
    """Return the comparison of two files, or of two test cases (`file.foresee::case`).

    Two files of one kind are compared as written, with the networks and models that they use. Two test cases, and a
    clip or mutant (even a stale one) and its parent, are compared as the full scenarios that they expand to. A scenario
    that extends another is expanded first.

    Raises:
        InputError: a file has an error, or the two files cannot be compared.
    """
    project = Project(check_pin=False, allow_outside=allow_outside)
    (old_file, old_case), (new_file, new_case) = addresses.parse_address(old), addresses.parse_address(new)
    a, b = project.definition(old_file), project.definition(new_file)
    if {type(a), type(b)} == {m.Scenario, m.Extension}:
        a, b = (project.whole_scenario(file, drawn=False) for file in (old_file, new_file))
    texts_only = texts(a, b) if type(a) is type(b) and old_file != new_file else ()
    if old_case or new_case or (type(a) is not type(b) and isinstance(a, _RUNS) and isinstance(b, _RUNS)):
        return Differences(old, new, diff_cases(*_cases(project, (old, a), (new, b))), texts_only)
    return Differences(old, new, diff_files(project, (old_file, a), (new_file, b)), texts_only)


def parent_address(derived: str) -> str:
    """Return the address of the parent of a clip or mutant, so that the file can be compared with it."""
    file, _ = addresses.parse_address(derived)
    model = Project(check_pin=False).definition(file)
    if not isinstance(model, m.Clip | m.Mutant | m.Extension):
        message = f"this holds {with_article(model.kind)} without a parent"
        raise addresses.mistake("FS132", message, "name two files to compare", addresses.display_path(file))
    case = model.case if isinstance(model, m.Clip) else None
    address = addresses.display_path(file.parent / model.parent)
    return f"{address}::{case}" if case else address


def _cases(project: Project, old: tuple[str, m.Definition], new: tuple[str, m.Definition]) -> tuple[TestCase, TestCase]:
    """Return both test cases. If one address is a clip or mutant and the other a scenario, the scenario's case is the
    clip's."""
    named = []
    for (address, model), (other, derived) in ((old, new), (new, old)):
        case = _case_of_parent(project, other, derived) if isinstance(model, m.Scenario | m.Extension) else None
        named.append(f"{address}::{case}" if case and not addresses.parse_address(address)[1] else address)
    return project.test_case(named[0]), project.test_case(named[1])


def _case_of_parent(project: Project, address: str, derived: m.Definition) -> str | None:
    if isinstance(derived, m.Mutant):
        case = project.test_case(address)
        return case.clip.case if case.clip is not None else None
    return derived.case if isinstance(derived, m.Clip) else None


def diff_cases(old: TestCase, new: TestCase) -> tuple[Difference, ...]:
    """Return all differences in meaning between two test cases: scenario, network, and the models that they name.

    The edits are those of `expanded_model`; edits of the network and the models begin with `network` and `models`.
    """
    a, b = (_without_files(expanded_model(case)) for case in (old, new))
    named = models_named(old.scenario) & models_named(new.scenario)
    models = (_catalogue(old.models, named), _catalogue(new.models, named))
    files = (*_diff_networks(old.network, new.network), *_diff_tracks(old.tracks, new.tracks))
    return (*diff_models(a, b), *files, *_under("models", diff_models(*models)))


def diff_files(
    project: Project, old: tuple[Path, m.Definition], new: tuple[Path, m.Definition]
) -> tuple[Difference, ...]:
    """Return the differences between two files as written, and between the networks and models that they use."""
    (old_file, a), (new_file, b) = old, new
    if isinstance(a, m.Clip | m.Mutant) and isinstance(b, m.Clip | m.Mutant):
        if absolute(old_file.parent / a.parent) == absolute(new_file.parent / b.parent):
            b = b.model_copy(update={"parent": a.parent})  # both sides may name the same file from two folders
        return diff_models(a, b)
    if not (isinstance(a, m.Scenario) and isinstance(b, m.Scenario)):
        return diff_models(a, b)
    try:
        networks = _used_network(project, old_file, a), _used_network(project, new_file, b)
        catalogues = _used_models(project, old_file, a), _used_models(project, new_file, b)
    except InputError:  # a file that they use is missing or has errors: only their own text is compared
        return diff_models(a, b)
    changes = diff_models(_without_files(a), _without_files(b))
    files = (*_diff_networks(*networks), *_diff_tracks(_used_tracks(old_file, a), _used_tracks(new_file, b)))
    return (*changes, *files, *_under("models", diff_models(*catalogues)))


def _without_files(scenario: m.Scenario) -> m.Scenario:
    files = m.UseNetwork | m.UseModels | m.UseTracks | m.Network
    body = tuple(item for item in scenario.body if not isinstance(item, files))
    return m.Scenario(name=scenario.name, body=body)


def _catalogue(models: Mapping[str, m.VehicleModel], named: Iterable[str]) -> m.Catalogue:
    return m.Catalogue(name="used", body=tuple(models[name] for name in sorted(named) if name in models))


def _diff_networks(a: _Network, b: _Network) -> tuple[Difference, ...]:
    if isinstance(a, m.Network) and isinstance(b, m.Network):
        return _under("network", diff_models(a, b))
    if a == b or (isinstance(a, Path) and isinstance(b, Path) and read_outside(a) == read_outside(b)):
        return ()
    return _another_file("network", "network", a, b)


def _diff_tracks(a: Path | None, b: Path | None) -> tuple[Difference, ...]:
    if a == b or (a is not None and b is not None and file_digest(a) == file_digest(b)):
        return ()
    return _another_file("stimulus", "tracks", a, b)


def _another_file(group: Group, what: str, a: _Network, b: _Network) -> tuple[Difference, ...]:
    """Return the difference between two files that are named, not compared."""
    was, now = (file.name if file is not None else None for file in (a, b))
    note = "other content" if was == now else ""
    return (Difference(group, what, kind_of(was, now), was, now, note, Edit("set", (what,), b)),)


def _under(root: str, changes: Iterable[Difference]) -> tuple[Difference, ...]:
    """Prefix the place of edits outside the scenario with their root, `network` or `models`."""
    return tuple(replace(change, edit=replace(change.edit, at=(root, *change.edit.at))) for change in changes)


def _used_network(project: Project, file: Path, scenario: m.Scenario) -> _Network:
    inline, used = scenario.first(m.Network), scenario.first(m.UseNetwork)
    if inline is not None or used is None:
        return inline
    path = file.parent / used.path
    if used.path.endswith(addresses.FOREIGN_NETWORKS) and addresses.is_file(path):
        return absolute(path)
    model = project.definition(path)
    if isinstance(model, m.Network):
        return model
    raise addresses.mistake("FS132", f"'{used.path}' does not hold a network", "", "")


def _used_tracks(file: Path, scenario: m.Scenario) -> Path | None:
    used = scenario.first(m.UseTracks)
    path = None if used is None else absolute(file.parent / used.path)
    return path if path is not None and addresses.is_file(path) else None


def _used_models(project: Project, file: Path, scenario: m.Scenario) -> m.Catalogue:
    models: dict[str, m.VehicleModel] = {}
    for used in scenario.all(m.UseModels):
        model = project.definition(file.parent / used.path)
        models |= entries(model) if isinstance(model, m.Catalogue) else {}
    return _catalogue(models, models)
