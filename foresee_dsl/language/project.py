"""From an address to a test case: finds, reads, checks and joins the files that a scenario, clip or mutant needs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.addresses import (
    FOREIGN_NETWORKS,
    is_file,
    is_folder,
    kind_of,
    missing,
    near_files,
    parse_address,
    recorded_children,
    scenario_files,
    shown,
)
from foresee_dsl.language.catalogues import bundled_models, check_models, entries
from foresee_dsl.language.concretise import cases, concretise
from foresee_dsl.language.diagnose import diagnose
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.expand import absolute, expand_clip, expand_mutant
from foresee_dsl.language.meaning import meaning_hash, pin_of
from foresee_dsl.language.model import (
    Catalogue,
    Clip,
    Definition,
    Item,
    Mutant,
    Network,
    Scenario,
    UseModels,
    UseNetwork,
    VehicleModel,
)
from foresee_dsl.language.project_codes import (
    MISSING_FILE,
    NO_NETWORK,
    OUTSIDE,
    STALE_PIN,
    TOO_DEEP,
    UNKNOWN_CASE,
    UNKNOWN_SUFFIX,
    USES_ITSELF,
    WHICH_CASE,
    WRONG_KIND,
)
from foresee_dsl.language.suggest import did_you_mean

__all__ = [
    "STALE_PIN",
    "Project",
    "diagnose",
    "load_catalogue",
    "load_test_case",
    "load_test_cases",
    "parse_address",
    "recorded_children",
    "scenario_files",
]


DEPTH_LIMIT = 32
"""How many parents a child may have, one above the other (ours: a campaign makes two; more is a generated chain)."""


def load_test_case(address: str | Path, *, allow_outside: bool = True, check_pin: bool = True) -> TestCase:
    """Load one test case with everything it needs.

    Args:
        address: a scenario, clip or mutant file, or `file.foresee::case`.
        allow_outside: whether the files that it uses may lie outside the working folder (or, where the addressed file
            does itself, outside that file's folder).
        check_pin: whether a child whose parent has changed is an error (code `STALE_PIN`).

    Raises:
        InputError: any mistake in any of the files, with its place.
    """
    return Project(allow_outside=allow_outside, check_pin=check_pin).test_case(address)


def load_test_cases(
    paths: Iterable[str | Path], *, allow_outside: bool = True, check_pin: bool = True
) -> tuple[TestCase, ...]:
    """Load all test cases of files, folders and addresses, in the order named.

    A scenario with cases gives one test case each. Folders are searched for scenarios, in the order of their paths;
    networks, models, clips and mutants in them are left out, but a clip or mutant that is named itself is loaded.

    Raises:
        InputError: the mistakes of all files together; or there is no scenario.
    """
    return Project(allow_outside=allow_outside, check_pin=check_pin).test_cases(paths)


def load_catalogue(path: Path | None = None) -> dict[str, VehicleModel]:
    """Return the models of a catalogue's file, by name; without a file those that ship with the package.

    Raises:
        InputError: the file has mistakes, or holds no catalogue.
    """
    return bundled_models() if path is None else Project().catalogue(path)


@dataclass(frozen=True)
class _File:
    path: Path
    """Absolute."""
    document: Document


@dataclass(frozen=True)
class _Use:
    """A statement that names another file."""

    file: _File
    item: Item
    field: str
    written: str

    @property
    def path(self) -> Path:
        return absolute(self.file.path.parent / self.written)

    @property
    def shown(self) -> str:
        return shown(Path(self.file.document.path).parent / self.written)

    def fail(self, code: str, message: str, help: str = "", *, field: str | None = None) -> NoReturn:
        name = self.field if field is None else field
        raise InputError((self.file.document.diagnostic(self.item, name, code, message, help),))


class Project:
    """Loads test cases and keeps what it has read: every file is read once, every parent built once.

    It does not notice when files change: make a new one then.
    """

    def __init__(self, *, allow_outside: bool = True, check_pin: bool = True) -> None:
        self._allow_outside = allow_outside
        self._check_pin = check_pin
        self._files: dict[Path, _File] = {}
        self._cases: dict[tuple[Path, str | None], TestCase] = {}
        self.warnings: list[Diagnostic] = []
        """What was found in the files read so far that is no error."""

    def test_case(self, address: str | Path) -> TestCase:
        """Load one test case; see `load_test_case`."""
        path, case = parse_address(str(address))
        if not is_file(path):
            raise missing(path)
        return self._load(absolute(path), shown(path), case, None, ())

    def test_cases(self, paths: Iterable[str | Path]) -> tuple[TestCase, ...]:
        """Load all test cases of files, folders and addresses; see `load_test_cases`."""
        found: dict[tuple[Path, str | None], TestCase] = {}
        mistakes: dict[Diagnostic, None] = {}  # a set in order: cases of one file share mistakes
        for file, case in self._addresses(paths):
            try:
                for name in (case,) if case else self._case_names(file):
                    key = (absolute(file), name)
                    found[key] = self._load(key[0], shown(file), name, None, ())
            except InputError as error:
                mistakes |= dict.fromkeys(error.diagnostics)
        if mistakes:
            raise InputError(tuple(mistakes))
        return tuple(found.values())

    def definition(self, file: str | Path) -> Definition:
        """Load and check one file as it stands, whatever it holds."""
        path = Path(file)
        if not is_file(path):
            raise missing(path)
        return self._read(absolute(path), shown(path)).document.model

    def catalogue(self, file: str | Path) -> dict[str, VehicleModel]:
        """Load the models of a catalogue's file, by name."""
        model = self.definition(file)
        if isinstance(model, Catalogue):
            return entries(model)
        message = f"this holds {_a(model)}, not models"
        raise InputError((Diagnostic(code=WRONG_KIND, message=message, path=shown(file)),))

    def _addresses(self, paths: Iterable[str | Path]) -> Iterable[tuple[Path, str | None]]:
        for address in map(str, paths):
            path, case = parse_address(address)
            if not is_folder(path):
                yield path, case
                continue
            scenarios = [file for file in scenario_files([path]) if kind_of(file) in ("scenario", "")]
            if not scenarios:
                message = f"no scenario in folder '{shown(path)}'"
                raise InputError((Diagnostic(code=MISSING_FILE, message=message, path=shown(path)),))
            yield from ((file, None) for file in scenarios)

    def _case_names(self, file: Path) -> tuple[str | None, ...]:
        if not is_file(file):
            raise missing(file)
        return cases(self._read(absolute(file), shown(file)).document) or (None,)

    def _read(self, path: Path, shown_as: str) -> _File:
        if path not in self._files:
            from foresee_dsl.language.checks import check_document
            from foresee_dsl.language.parser import load

            document = load(path, shown_as=shown_as)
            found = check_document(document)
            self.warnings.extend(d for d in found if d.severity != "error")
            mistakes = tuple(d for d in found if d.severity == "error")
            if mistakes:
                raise InputError(mistakes)
            self._files[path] = _File(path, document)
        return self._files[path]

    def _read_used(self, use: _Use, root: Path) -> _File:
        self._check_reachable(use, root)
        return self._read(use.path, use.shown)

    def _check_reachable(self, use: _Use, root: Path) -> None:
        if not self._allow_outside and not use.path.is_relative_to(root):
            use.fail(OUTSIDE, f"'{use.written}' lies outside '{root.as_posix()}'", "move the file there")
        if not is_file(use.path):
            use.fail(MISSING_FILE, f"no file '{use.written}'", near_files(use.path))

    def _load(
        self, path: Path, shown_as: str, case: str | None, use: _Use | None, chain: tuple[_File, ...]
    ) -> TestCase:
        if (path, case) not in self._cases:
            file = self._read(path, shown_as)
            self._cases[path, case] = self._build(file, case, use, (*chain, file))
        return self._cases[path, case]

    def _build(self, file: _File, case: str | None, use: _Use | None, chain: tuple[_File, ...]) -> TestCase:
        model = file.document.model
        if isinstance(model, Scenario):
            return self._seed(file, model, case, use, chain)
        if case is not None:
            _fail_case(file, use, UNKNOWN_CASE, f"a {model.kind} has no cases", "leave out the case")
        if isinstance(model, Clip):
            parent = self._parent(_Use(file, model, "parent", model.parent), model.case, model.pin, chain)
            return expand_clip(model, parent, source=file.path, document=file.document)
        if isinstance(model, Mutant):
            above = _Use(file, model, "parent", model.parent)
            parent = self._parent(above, None, model.pin, chain)
            if parent.clip is None:
                above.fail(WRONG_KIND, f"'{model.parent}' holds a scenario, but a mutant changes a clip")
            return expand_mutant(model, parent, source=file.path, document=file.document)
        message = f"this holds a catalogue of {model.kind}" if isinstance(model, Catalogue) else "this holds a network"
        if use is not None:
            use.fail(WRONG_KIND, f"'{use.written}' is no parent: {message}", "name a scenario, clip or mutant")
        help = "name a scenario, clip or mutant"
        raise InputError((file.document.diagnostic(model, "", WRONG_KIND, f"{message}, no test case", help),))

    def _seed(
        self, file: _File, scenario: Scenario, case: str | None, use: _Use | None, chain: tuple[_File, ...]
    ) -> TestCase:
        known = cases(file.document)
        if case is not None and case not in known:
            message = f"no case '{case}' in '{file.document.path}'"
            _fail_case(
                file, use, UNKNOWN_CASE, message, did_you_mean(case, known) or "it has no cases: leave out the case"
            )
        if case is None and known:
            message = f"'{file.document.path}' has {len(known)} cases: say which one"
            written = f"case {known[0]}" if use else f"{file.document.path}::{known[0]}"
            _fail_case(file, use, WHICH_CASE, message, f"write `{written}`, for example; {did_you_mean('', known)}")
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
        _check_cycle(use, chain)
        if len(chain) > DEPTH_LIMIT:
            use.fail(TOO_DEEP, f"more than {DEPTH_LIMIT} parents, one above the other")
        self._check_reachable(use, _root(chain))
        parent = self._load(use.path, use.shown, case, use, chain)
        now = pin_of(parent)
        if self._check_pin and now != pin:
            message = f"the parent '{parent.id}' is {now} now, but {pin} is pinned"
            use.fail(STALE_PIN, message, "the parent changed since; clip it again or check the change", field="pin")
        return parent

    def _network(self, file: _File, scenario: Scenario, chain: tuple[_File, ...]) -> Network | Path:
        inline, used = scenario.one(Network), scenario.one(UseNetwork)
        if inline is not None:
            return inline
        if used is None:
            help = 'write `use network "file"`, or a block `network { ... }`'
            message = f"scenario '{scenario.name}' has no network"
            raise InputError((file.document.diagnostic(file.document.model, "name", NO_NETWORK, message, help),))
        use = _Use(file, used, "path", used.path)
        if used.path.endswith(FOREIGN_NETWORKS):
            self._check_reachable(use, _root(chain))
            if not os.access(use.path, os.R_OK):
                use.fail(MISSING_FILE, f"'{used.path}' cannot be read", "check its permissions")
            return use.path
        model = self._used_model(use, chain)
        if not isinstance(model, Network):
            use.fail(WRONG_KIND, f"'{used.path}' holds {_a(model)}, not a network")
        return model

    def _models(self, file: _File, scenario: Scenario, chain: tuple[_File, ...]) -> dict[str, VehicleModel]:
        models = bundled_models()
        for item in scenario.all(UseModels):
            use = _Use(file, item, "path", item.path)
            model = self._used_model(use, chain)
            if not isinstance(model, Catalogue):
                use.fail(WRONG_KIND, f"'{item.path}' holds {_a(model)}, not models")
            models |= entries(model)
        return models

    def _used_model(self, use: _Use, chain: tuple[_File, ...]) -> Item:
        _check_cycle(use, chain)
        if not use.written.endswith(".foresee"):
            network = isinstance(use.item, UseNetwork)
            known = ".foresee, .net.xml or .xodr" if network else ".foresee"
            use.fail(UNKNOWN_SUFFIX, f"'{use.written}' is of an unknown kind", f"write a file that ends in {known}")
        return self._read_used(use, _root(chain)).document.model


def _check_cycle(use: _Use, chain: tuple[_File, ...]) -> None:
    if any(file.path == use.path for file in chain):
        names = [file.document.path for file in chain]
        use.fail(USES_ITSELF, f"'{names[0]}' uses itself: {' -> '.join([*names, use.shown])}", "name another file")


def _root(chain: tuple[_File, ...]) -> Path:
    """Return the folder that a test case may use files of, where it must not leave it."""
    here = absolute(Path())
    first = chain[0].path
    return here if first.is_relative_to(here) else first.parent


def _fail_case(file: _File, use: _Use | None, code: str, message: str, help: str) -> NoReturn:
    """Blame the child that names the case; where the address named it, the file."""
    if use is not None:
        use.fail(code, message, help, field="case")
    raise InputError((file.document.diagnostic(None, "", code, message, help),))


def _a(model: Item) -> str:
    return "models" if isinstance(model, Catalogue) else f"a {getattr(model, 'kind', 'definition')}"
