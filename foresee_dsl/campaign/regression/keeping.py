"""The command `foresee keep`: finds the test cases that its arguments name, copies them with their files into a self-
contained folder, and prunes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.campaign.findings.named_failure import NamedFailure, find_failure
from foresee_dsl.campaign.regression.edits import as_text, paths_in, with_doc, with_expected, with_name, with_paths
from foresee_dsl.campaign.regression.expectations import expected_of, name_to_record, recorded_end, recorded_in
from foresee_dsl.campaign.regression.suite import PARENTS, stated_in, tests_in, write_index
from foresee_dsl.compile import placement_mistakes
from foresee_dsl.errors import ForeseeError, InputError
from foresee_dsl.files import absolute, read_outside, replacing
from foresee_dsl.language import model as m
from foresee_dsl.language.diff.plain import plain_text
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.parser import load, parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.expand import expanded_model
from foresee_dsl.language.project.loading import load_test_case


@dataclass(frozen=True)
class KeptTest:
    """One test case of a suite.

    Attributes:
        file: its file in the suite. new: whether it was not there before. minimised: whether it is the minimised form
            of a finding.
        sentence: what happens in it; empty without a campaign.
    """

    file: Path
    new: bool
    minimised: bool
    sentence: str


@dataclass(frozen=True)
class Report:
    """Result of `keep`: the tests, the files copied for them, and notes.

    `removed`: files removed by `--prune`.
    """

    tests: tuple[KeptTest, ...] = ()
    parents: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    removed: tuple[Path, ...] = ()

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"tests": self.tests, "copied": self.parents, "notes": self.notes, "removed": self.removed}


def keep(sources: Sequence[Source], folder: Path, *, name: str = "") -> Report:
    """Copy test cases with their files into a suite; no file is written if one of them cannot be kept.

    A test that exists with the same meaning is not changed, nor are its expected results.

    Args:
        name: name of the single source in the suite; by default its present name.

    Raises:
        ForeseeError: there is another test case of that name. InputError: a test case is impossible on its network.
    """
    if mistakes := placement_mistakes([source.case for source in sources]):
        raise InputError(mistakes)
    files = _SuiteFiles(folder)
    tests = tuple(files.test(source, name or source.name) for source in sources)
    files.write(sources, tests)
    write_index(folder, tests_in(folder))
    return Report(tests, tuple(files.parents), tuple(files.notes))


def prune(folder: Path) -> tuple[Path, ...]:
    """Remove files that no test of a suite needs, and update the index.

    Returns:
        The files that were removed.

    Raises:
        InputError: there is no such folder, or a file with errors, whose needs are unknown.
    """
    tests = tests_in(folder)
    needed: set[Path] = set()
    todo = [absolute(file) for file in tests]
    while todo:
        file = todo.pop()
        if file not in needed:
            needed.add(file)
            if file.suffix == a.SUFFIX and a.is_file(file):
                todo += [absolute(file.parent / path) for path in paths_in(load(file))]
    inside = folder / PARENTS
    there = sorted(inside.rglob("*")) if inside.is_dir() else []
    files = [file for file in there if file.name.endswith((a.SUFFIX, a.TRACKS, *a.FOREIGN_NETWORKS))]
    removed = tuple(file for file in files if absolute(file) not in needed)
    for file in removed:
        file.unlink()
    for left in sorted((inside, *filter(Path.is_dir, there)), reverse=True):
        if left.is_dir() and not any(left.iterdir()):
            left.rmdir()
    write_index(folder, tests)
    return removed


class _SuiteFiles:
    """The files of a suite, collected before any is written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._new: dict[Path, bytes] = {}
        self._names: dict[Path, str] = {}
        self.parents: list[Path] = []
        self.notes: list[str] = []

    def test(self, source: Source, name: str) -> KeptTest:
        """Plan the file of a test and return its entry.

        Raises:
            ForeseeError: there is another test case of that name.
        """
        file = self._folder / f"{name}{a.SUFFIX}"
        kept = KeptTest(file, not (file.exists() or file in self._new), source.minimised, source.sentence)
        if file in self._new:
            raise ForeseeError(f"two of them have the name {name!r}: keep them one by one, with `--as NAME`")
        if file.exists():
            if not _means(file, source.case.meaning):
                message = "exists already and is another test case: `--as NAME` keeps this one under another name"
                raise ForeseeError(f"{file} {message}, or remove the file first")
            return kept
        text = source.text
        if name != source.name:
            text = with_name(text, name)
        text = self._here(source.file, text, f"{PARENTS}/")
        document = parse(text, str(file))
        if source.sentence:
            text = with_doc(text, source.sentence)
        if source.expected is not None and not stated_in(document):
            text = with_expected(text, source.expected)
        self._new[file] = text.encode()
        return kept

    def write(self, sources: Sequence[Source], tests: Sequence[KeptTest]) -> None:
        """Write all files, required ones first; remove them again if a test's meaning has changed."""
        written: list[Path] = []
        try:
            for file, content in self._new.items():
                file.parent.mkdir(parents=True, exist_ok=True)
                written.append(file)
                with replacing(file) as temporary:
                    temporary.write_bytes(content)
            for source, kept in zip(sources, tests, strict=True):
                if load_test_case(kept.file, allow_outside=False).meaning != source.case.meaning:
                    raise ForeseeError(f"{kept.file} would not mean what {source.file} means")
        except BaseException:
            for file in written:
                file.unlink(missing_ok=True)
            raise

    def _here(self, source: Path, text: str, prefix: str) -> str:
        """Return a file's text with the suite's paths of the files that it needs."""
        document = parse(text, str(source))
        paths = {path: prefix + self._place(absolute(source.parent / path)) for path in paths_in(document)}
        return with_paths(text, paths)

    def _place(self, source: Path) -> str:
        """Return the name in `parents/` of a required file; plan a copy if it is not there."""
        if source not in self._names:
            inside = absolute(self._folder / PARENTS)
            if source.is_relative_to(inside):
                self._names[source] = source.relative_to(inside).as_posix()
            else:
                content = read_outside(source)
                if source.name.endswith(a.SUFFIX):
                    content = self._here(source, content.decode("utf-8"), "").encode()
                self._names[source] = self._free(source.name, content)
        return self._names[source]

    def _free(self, name: str, content: bytes) -> str:
        """Return the first name that is free or whose file has this content: `town`, `town_2`."""
        stem, dot, suffix = name.partition(".")
        number = 1
        while True:
            called = name if number == 1 else f"{stem}_{number}{dot}{suffix}"
            file = self._folder / PARENTS / called
            there = self._new.get(file) if file in self._new else read_outside(file) if file.is_file() else None
            if there is None:
                self._new[file] = content
                self.parents.append(file)
                if number > 1:
                    self.notes.append(f"{file}: the suite already has another {name} with a different meaning")
                return called
            if there == content or (name.endswith(a.SUFFIX) and _same(there, content)):
                return called
            number += 1


def _same(first: bytes, other: bytes) -> bool:
    """Return whether two files have the same meaning and name the same other files."""
    try:
        a_text, b_text = (plain_text(parse(text.decode("utf-8"), "a file").model) for text in (first, other))
    except (InputError, UnicodeDecodeError):
        return False
    return a_text == b_text


def _means(file: Path, meaning: str) -> bool:
    try:
        return load_test_case(file, check_pin=False).meaning == meaning
    except InputError:
        return False


@dataclass(frozen=True)
class Source:
    """A test case to keep.

    Attributes:
        name: name of its file without suffix. file: the present file, whose folder its paths refer to. text: its new
            file. case: the loaded test case. minimised: it is the minimised form of a finding.
        sentence: what happens; "" without a campaign. expected: the recorded result.
    """

    name: str
    file: Path
    text: str
    case: TestCase
    minimised: bool = False
    sentence: str = ""
    expected: m.Expected | None = None


def source_of(wanted: str, campaign: Path, *, full: bool = False) -> Source:
    """Return the test case to keep.

    Args:
        wanted: a finding's or child's name in the campaign, or the address of a mutant, clip or test case.
        campaign: the campaign's folder. full: the mutant in its original form, not the minimised one.

    Raises:
        ForeseeError: there is no finding of this name. InputError: its files have errors, or it is stale.
    """
    path, case = a.parse_address(wanted)
    kind = a.kind_of(path) if a.is_file(path) and case is None else None
    if kind == "clip":
        return _child(NamedFailure(path.stem, path), full=full)
    if a.is_file(path) and kind != "mutant":
        return _test_case(wanted)
    failure = find_failure(wanted, campaign, tests=True)
    return _child(failure, full=full) if failure.child else _test_case(str(failure.file), failure)


def _child(failure: NamedFailure, *, full: bool) -> Source:
    small = None if full else failure.minimised
    file = small or failure.file
    case = load_test_case(file)
    origin = case.mutant.origin if case.mutant is not None else None
    text = read_outside(file).decode("utf-8")
    sentence = failure.sentence if small is None else failure.sentence_minimised or failure.sentence
    return Source(file.stem, absolute(file), text, case, small is not None, sentence, recorded_in(origin))


def _test_case(address: str, failure: NamedFailure | None = None) -> Source:
    """Return a test case that fails without mutation, as one concrete scenario without parameters and other cases."""
    case = load_test_case(address)
    model = expanded_model(case)
    doc = load(case.source).model
    docs = [item for item in getattr(doc, "body", ()) if isinstance(item, m.Doc)]
    sentence = as_text(failure.sentence) if failure else ""
    docs = [m.Doc(text=sentence), *docs] if sentence else docs
    body = tuple(item for item in model.body if not isinstance(item, m.Doc | m.Expected | m.Param | m.Case | m.Cases))
    name = case_name(case)
    text = print_model(m.Scenario(name=name, body=(*docs, *body)))
    run, campaign = (recorded_end(failure.reason), failure.campaign) if failure else (None, None)
    expected = expected_of(run, name_to_record(campaign.driver, "")) if campaign and run else None
    return Source(name, case.source, text, case, False, sentence, expected)
