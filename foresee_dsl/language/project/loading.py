"""Loads test cases by address: finds, reads, checks and joins the files that a scenario, clip or mutant needs."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NoReturn

from foresee_dsl.errors import Diagnostic, ForeseeError, InputError, MessageText, subject
from foresee_dsl.files import data_folder
from foresee_dsl.helps import Help, HelpText, write
from foresee_dsl.language import model as m
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.meaning import meaning_hash, pin_of
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.addresses import absolute, display_path, is_folder, mistake
from foresee_dsl.language.project.catalogues import check_models, entries
from foresee_dsl.language.project.concretise import cases, concretise, settled_network
from foresee_dsl.language.project.document import Document, TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.extend import extended, softened
from foresee_dsl.language.sampling.draws import with_drawn_cases
from foresee_dsl.limits import most, raised_by

DEPTH_LIMIT = 32
"""Maximum number of parents, one above the other (ours: a campaign makes two; a longer chain is generated)."""


def load_test_case(address: str | Path, *, allow_outside: bool = True, check_pin: bool = True) -> TestCase:
    """Load one test case with everything it needs.

    Args:
        address: a scenario, clip or mutant file, or `file.foresee::case`.
        allow_outside: whether the files that it uses may lie outside the project folder: of the working folder, or of
            the addressed file (`addresses.project_folder`).
        check_pin: whether a clip or mutant whose parent has changed is an error (code `STALE_PIN`).

    Raises:
        InputError: the errors in any of the files, with their places.
    """
    return Project(allow_outside=allow_outside, check_pin=check_pin).test_case(address)


def load_test_cases(paths: Iterable[str | Path], *, allow_outside: bool = True) -> tuple[TestCase, ...]:
    """Load all test cases of files, folders and addresses, in the order named.

    A scenario with cases gives one test case for each. Folders are searched for scenarios, in the order of their paths;
    networks, models, clips and mutants in them are skipped, but a clip or mutant that is named itself is loaded.

    Raises:
        InputError: the errors of all files together; or there is no scenario.
    """
    return Project(allow_outside=allow_outside).test_cases(paths)


@cache
def _bundled() -> Mapping[str, m.VehicleModel]:
    from foresee_dsl.language.parser import load

    path = data_folder("scenarios") / "models.foresee"
    if not path.is_file():
        raise ForeseeError(f"the bundled catalogue of models is missing from this installation: {path}")
    model = load(path).model
    if not isinstance(model, m.Catalogue):
        raise ForeseeError(f"the bundled catalogue of models is damaged: {path}")
    return entries(model)


def bundled_models() -> dict[str, m.VehicleModel]:
    """Return the models that ship with the package, by name; read once in a process."""
    return dict(_bundled())


def load_catalogue(path: Path | None = None) -> dict[str, m.VehicleModel]:
    """Return the models of a catalogue's file, by name; without a file, the models that ship with the package."""
    return bundled_models() if path is None else Project().catalogue(path)


@dataclass(frozen=True)
class _File:
    path: Path
    """Absolute."""
    document: Document


@dataclass(frozen=True)
class _Use:
    """A statement that names another file: the item, its field with the path, and the path as written."""

    file: _File
    item: m.Item
    field: str
    written: str

    @property
    def path(self) -> Path:
        return absolute(self.file.path.parent / self.written)

    @property
    def display_path(self) -> str:
        return display_path(Path(self.file.document.path).parent / self.written)

    def fail(self, code: str, message: MessageText, help: HelpText = "", *, field: str | None = None) -> NoReturn:
        name = self.field if field is None else field
        raise InputError((self.file.document.diagnostic(self.item, name, code, message, help),))


class Project:
    """Loads test cases with a cache: every file is read once, every parent is built once.

    It does not notice changes of files: create a new project after a change.
    """

    def __init__(
        self, *, allow_outside: bool = True, check_pin: bool = True, overlay: Mapping[Path, str] | None = None
    ) -> None:
        """Make a project; `overlay`: texts that replace those on the disk, by absolute path (an editor's)."""
        self._overlay = overlay or {}
        self._allow_outside = allow_outside
        self._check_pin = check_pin
        self._files: dict[Path, _File] = {}
        self._wholes: dict[Path, _File] = {}
        self._undrawn: dict[Path, Document] = {}
        self._cases: dict[tuple[Path, str | None], TestCase] = {}
        self._roots: tuple[Path, ...] = ()
        self._drawn = 0
        self.warnings: list[Diagnostic] = []
        """Warnings about the files read so far."""

    def test_case(self, address: str | Path) -> TestCase:
        """Load one test case; see `load_test_case`."""
        path, case = a.parse_address(str(address))
        if not self._is_file(path):
            raise a.missing(path)
        self._allow_near(path)
        return self._load(absolute(path), display_path(path), case, None, ())

    def test_cases(self, paths: Iterable[str | Path]) -> tuple[TestCase, ...]:
        """Load all test cases of files, folders and addresses; see `load_test_cases`."""
        loaded: dict[tuple[Path, str | None], TestCase] = {}
        mistakes: dict[Diagnostic, None] = {}  # a set in order: cases of one file share mistakes
        for file, case in self._addresses(paths):
            try:
                for name in (case,) if case else self._case_names(file):
                    key = (absolute(file), name)
                    loaded[key] = self._load(key[0], display_path(file), name, None, ())
            except InputError as error:
                mistakes |= dict.fromkeys(error.diagnostics)
        if mistakes:
            raise InputError(tuple(mistakes))
        return tuple(loaded.values())

    def definition(self, file: str | Path) -> m.Definition:
        """Load and check one file of any kind; calculations in a network are replaced by their values."""
        return _settled(self.document(file))

    def document(self, file: str | Path) -> Document:
        """Load and check one file of any kind, with the places of its items."""
        return self._named(Path(file)).document

    def catalogue(self, file: str | Path) -> dict[str, m.VehicleModel]:
        """Load the models of a catalogue's file, by name."""
        model = self.definition(file)
        if isinstance(model, m.Catalogue):
            return entries(model)
        raise mistake(c.WRONG_KIND, f"this holds {_a(model)}, not models", "", display_path(file))

    def _addresses(self, paths: Iterable[str | Path]) -> Iterable[tuple[Path, str | None]]:
        for address in map(str, paths):
            path, case = a.parse_address(address)
            self._allow_near(path)
            if not is_folder(path):
                yield path, case
                continue
            scenarios = [file for file in a.scenario_files([path]) if a.kind_of(file) in ("scenario", "")]
            if not scenarios:
                message = f"there is no scenario in folder '{display_path(path)}'"
                raise mistake(c.MISSING_FILE, message, "", display_path(path))
            yield from ((file, None) for file in scenarios)

    def whole_scenario(self, file: str | Path, *, drawn: bool = True) -> m.Scenario:
        """Load a file's scenario, joined with the one that it extends; if `drawn`, `cases N from seed S` becomes N
        cases."""
        path = Path(file)
        self._allow_near(path)
        whole = self._whole(self._named(path), ())
        document = whole.document if drawn else self._undrawn.get(absolute(path), whole.document)
        if isinstance(document.model, m.Scenario):
            return document.model
        raise mistake(c.WRONG_KIND, f"this holds {_a(whole.document.model)}, not a scenario", "", display_path(path))

    def _case_names(self, file: Path) -> tuple[str | None, ...]:
        return cases(self._whole(self._named(file), ()).document) or (None,)

    def _named(self, file: Path) -> _File:
        """Read a file that the user named."""
        if not self._is_file(file):
            raise a.missing(file)
        return self._read(absolute(file), display_path(file))

    def _whole(self, file: _File, chain: tuple[_File, ...]) -> _File:
        """Return a scenario's file, joined and with its drawn cases; every other file unchanged."""
        if not isinstance(file.document.model, m.Scenario | m.Extension):
            return file
        if file.path not in self._wholes:
            self._undrawn[file.path] = undrawn = self._joined(file, chain)
            self._count_drawn(undrawn)
            self._wholes[file.path] = replace(file, document=with_drawn_cases(undrawn))
        return self._wholes[file.path]

    def _count_drawn(self, document: Document) -> None:
        """Raise for the file with which all files together exceed the limit of drawn cases."""
        model = document.model
        for item in model.all(m.Cases) if isinstance(model, m.Scenario) else ():
            self._drawn += int(item.count.value)
            if self._drawn > most("cases"):
                message = f"with these all files together have more than {most('cases'):,.0f} drawn cases"
                help = f"name fewer files; {raised_by('cases')}"
                raise InputError((document.diagnostic(item, "count", c.TOO_MANY_CASES, message, help),))

    def _joined(self, file: _File, chain: tuple[_File, ...]) -> Document:
        extension = file.document.model
        if not isinstance(extension, m.Extension):
            return file.document
        from foresee_dsl.language.checks.documents import check_document

        above = _Use(file, extension, "parent", extension.parent)
        chain = chain if chain and chain[-1] is file else (*chain, file)
        self._check_parent(above, chain)
        parent = self._whole(self._read(above.path, above.display_path), chain)
        if not isinstance(parent.document.model, m.Scenario):
            above.fail(c.WRONG_KIND, f"'{extension.parent}' holds {_a(parent.document.model)}, not a scenario")
        # The other's cases are drawn again, because parameters and requirements may differ here.
        base = self._undrawn[parent.path]
        joined = extended(file.document, base, folder=file.path.parent, parent_folder=parent.path.parent)
        if mistakes := check_document(joined):
            raise InputError(mistakes)
        place = joined.span(extension, "parent")  # of warnings about the other file, which reports them itself
        self.warnings.extend(d for d in softened(joined) if d.span != place)
        return joined

    def _check_parent(self, use: _Use, chain: tuple[_File, ...]) -> None:
        _check_cycle(use, chain)
        if len(chain) > DEPTH_LIMIT:
            use.fail(c.TOO_DEEP, f"more than {DEPTH_LIMIT} parents in a row, each the parent of the one before")
        self._check_reachable(use, chain)

    def _read(self, path: Path, shown_as: str) -> _File:
        if path not in self._files:
            from foresee_dsl.language.checks.documents import check_document
            from foresee_dsl.language.parser import load, parse

            text = self._overlay.get(path)
            document = load(path, shown_as=shown_as) if text is None else parse(text, shown_as)
            if mistakes := check_document(document):
                raise InputError(mistakes)
            self._files[path] = _File(path, document)
        return self._files[path]

    def _check_reachable(self, use: _Use, chain: tuple[_File, ...]) -> None:
        if not self._allow_outside and not a.is_inside(use.path, self._roots or (chain[0].path.parent,)):
            root = a.project_folder(absolute(Path()))
            message = f"'{use.written}' lies outside the project folder '{root.as_posix()}'"
            use.fail(c.OUTSIDE, message, "move the file there, or allow it with " + write("--allow-outside"))
        if not self._is_file(use.path):
            use.fail(c.MISSING_FILE, f"there is no file '{use.written}'", a.near_files(use.path))

    def _allow_near(self, path: Path) -> None:
        """Allow files of the project folders of a named path and of the working folder."""
        if not self._allow_outside:
            here = absolute(path) if is_folder(path) else absolute(path).parent
            roots = (*self._roots, a.project_folder(absolute(Path())), a.project_folder(here))
            self._roots = tuple(dict.fromkeys(roots))

    def _is_file(self, path: Path) -> bool:
        return absolute(path) in self._overlay or a.is_file(path)

    def _load(
        self, path: Path, shown_as: str, case: str | None, use: _Use | None, chain: tuple[_File, ...]
    ) -> TestCase:
        if (path, case) not in self._cases:
            file = self._read(path, shown_as)
            self._cases[path, case] = self._build(file, case, use, (*chain, file))
        return self._cases[path, case]

    def _build(self, file: _File, case: str | None, use: _Use | None, chain: tuple[_File, ...]) -> TestCase:
        model = file.document.model
        if isinstance(model, m.Scenario | m.Extension):
            return self._seed(self._whole(file, chain), case, use, chain)
        if case is not None:
            _fail_case(file, use, c.UNKNOWN_CASE, f"a {model.kind} has no cases", "leave out the case")
        if isinstance(model, m.Clip):
            parent = self._parent(_Use(file, model, "parent", model.parent), model.case, model.pin, chain)
            return expand_clip(model, parent, source=file.path, document=file.document)
        if isinstance(model, m.Mutant):
            above = _Use(file, model, "parent", model.parent)
            parent = self._parent(above, None, model.pin, chain)
            if parent.clip is None:
                above.fail(c.WRONG_KIND, f"'{model.parent}' holds a scenario, but a mutant changes a clip")
            return expand_mutant(model, parent, source=file.path, document=file.document)
        message = f"this holds {_a(model)}"
        if use is not None:
            message = f"'{use.written}' cannot be a parent: {message}"
            use.fail(c.WRONG_KIND, message, "name a scenario, clip or mutant")
        help = "name a scenario, clip or mutant"
        message += ", not a test case"
        raise InputError((file.document.diagnostic(model, "", c.WRONG_KIND, message, help),))

    def _seed(self, file: _File, case: str | None, use: _Use | None, chain: tuple[_File, ...]) -> TestCase:
        scenario = file.document.model
        if not isinstance(scenario, m.Scenario):
            raise TypeError("a file is joined before its test cases are built")
        names = cases(file.document)
        if case is not None and case not in names:
            message = f"'{file.document.path}' has no case '{case}'"
            help = did_you_mean(case, names) or "it has no cases: leave out the case"
            _fail_case(file, use, c.UNKNOWN_CASE, message, help)
        if case is None and names:
            message = f"'{file.document.path}' has {len(names)} cases, but this needs a single one"
            written = f"case {names[0]}" if use else f"{file.document.path}::{names[0]}"
            _fail_case(
                file,
                use,
                c.WHICH_CASE,
                message,
                "write " + write(written) + ", for example; " + did_you_mean("", names),
            )
        concrete = concretise(scenario, case, document=file.document)
        network = self._network(file, concrete, chain)
        models = self._models(file, concrete, chain)
        check_models(concrete, models, file.document, case)
        return TestCase(
            id=f"{file.document.path}::{case}" if case else file.document.path,
            scenario=concrete,
            network=network,
            models=models,
            meaning=meaning_hash(concrete, network, models),
            source=file.path,
            document=file.document,
        )

    def _parent(self, use: _Use, case: str | None, pin: str, chain: tuple[_File, ...]) -> TestCase:
        self._check_parent(use, chain)
        parent = self._load(use.path, use.display_path, case, use, chain)
        now = pin_of(parent)
        if self._check_pin and now != pin:
            message = (
                f"the parent '{parent.id}' has the hash " + subject(now) + " now, but " + subject(pin) + " is pinned"
            )
            help = "the parent has changed: run `foresee repin` to see the effect on this file"
            use.fail(c.STALE_PIN, message, help, field="pin")
        return parent

    def _network(self, file: _File, scenario: m.Scenario, chain: tuple[_File, ...]) -> m.Network | Path:
        inline, used = scenario.first(m.Network), scenario.first(m.UseNetwork)
        if inline is not None:
            return inline
        if used is None:
            help = "write " + write('use network "file"') + ", or a block `network { ... }`"
            message = f"scenario '{scenario.name}' has no network"
            raise InputError((file.document.diagnostic(file.document.model, "name", c.NO_NETWORK, message, help),))
        use = _Use(file, used, "path", used.path)
        if used.path.endswith(a.FOREIGN_NETWORKS):
            self._check_reachable(use, chain)
            if not os.access(use.path, os.R_OK):
                use.fail(c.MISSING_FILE, f"'{used.path}' cannot be read", "check its permissions")
            return use.path
        model = self._used_model(use, chain)
        if not isinstance(model, m.Network):
            use.fail(c.WRONG_KIND, f"'{used.path}' holds {_a(model)}, not a network", _name_another(use, "network"))
        return model

    def _models(self, file: _File, scenario: m.Scenario, chain: tuple[_File, ...]) -> dict[str, m.VehicleModel]:
        models = bundled_models()
        for item in scenario.all(m.UseModels):
            use = _Use(file, item, "path", item.path)
            model = self._used_model(use, chain)
            if not isinstance(model, m.Catalogue):
                use.fail(c.WRONG_KIND, f"'{item.path}' holds {_a(model)}, not models", _name_another(use, "models"))
            models |= entries(model)
        return models

    def _used_model(self, use: _Use, chain: tuple[_File, ...]) -> m.Item:
        _check_cycle(use, chain)
        if not use.written.endswith(".foresee"):
            network = isinstance(use.item, m.UseNetwork)
            suffixes = ".foresee, .net.xml or .xodr" if network else ".foresee"
            help = f"name a file that ends in {suffixes}; " + _name_another(use, "network" if network else "models")
            use.fail(c.UNKNOWN_SUFFIX, f"'{use.written}' is a file of an unknown kind", help)
        self._check_reachable(use, chain)
        return _settled(self._read(use.path, use.display_path).document)


def _settled(document: Document) -> m.Definition:
    model = document.model
    return settled_network(model) if document.calculates and isinstance(model, m.Network) else model


def _check_cycle(use: _Use, chain: tuple[_File, ...]) -> None:
    if any(file.path == use.path for file in chain):
        names = [file.document.path for file in chain]
        word = "network" if isinstance(use.item, m.UseNetwork) else "models"
        help = _name_another(use, word) if isinstance(use.item, m.UseNetwork | m.UseModels) else "name another file"
        use.fail(c.USES_ITSELF, f"'{names[0]}' uses itself: {' -> '.join([*names, use.display_path])}", help)


def _name_another(use: _Use, word: str) -> Help:
    """Return a help that names files in the same folder whose definition begins with a word."""
    names = a.files_with(use.path.parent, word)
    help = Help(f"name a file with `{word} ...`")
    for k, name in enumerate(names):
        help += (" or " if k else ", such as ") + write(f'"{Path(use.written).with_name(name).as_posix()}"')
    return help


def _fail_case(file: _File, use: _Use | None, code: str, message: str, help: HelpText) -> NoReturn:
    """Raise at the clip that names the case; if the address named it, at the file."""
    if use is not None:
        use.fail(code, message, help, field="case")
    raise InputError((file.document.diagnostic(None, "", code, message, help),))


def _a(model: m.Item) -> str:
    if isinstance(model, m.Extension):
        return "a scenario"
    return "models" if isinstance(model, m.Catalogue) else f"a {getattr(model, 'kind', 'definition')}"
