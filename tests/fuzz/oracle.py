"""What must hold for every input, whatever it is: the judge of one input, in this process.

A file ends in a document that can be formatted, or in mistakes with a place inside the file and words for people; in
at most two seconds of CPU and 500 MB, and never in another exception.
"""

from __future__ import annotations

import faulthandler
import json
import resource
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.documents import plain
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.codes import every_code
from foresee_dsl.language.messages import diagnostics as rendering
from foresee_dsl.language.parser import decode, format_text, parse
from foresee_dsl.language.project.loading import Project
from foresee_dsl.report.builds.github import render_github
from foresee_dsl.report.builds.sarif import to_sarif
from tests.fuzz.corpus import CASES, SCENARIOS

MOST_CPU_S = 2.0
"""What one input may take (issue 3)."""
MOST_MEMORY_MB = 500
"""What the process may take at its largest (issue 3)."""
_HANG_S = 120
"""A process that is stuck where Python cannot interrupt it ends after this wall time (ours; the parent reports it)."""
_PYTHON_WORDS = ("Traceback", "object at 0x", "NoneType", "pydantic", "ValidationError", "Token(", "Tree(")
_INPUTS_A_PROJECT = 100
"""A project keeps the networks that it has read: made anew after so many inputs, or it would keep the inputs too."""


@dataclass(frozen=True)
class Finding:
    """What is wrong: a key that inputs with the same cause share, and all that is known."""

    key: str
    details: str


class _TooSlow(BaseException):
    """Raised by the alarm; no `except Exception` of the code under test catches it."""


class Judge:
    """Judges inputs one after the other, as files in a folder that holds the networks that they may name."""

    def __init__(self, folder: Path, *, others_mb: float = 0.0) -> None:
        """Make a judge.

        Args:
            folder: an empty folder to work in.
            others_mb: what the process had taken before for other things, which does not count (a test's worker).
        """
        shutil.copytree(SCENARIOS, folder, dirs_exist_ok=True)
        for file in CASES.glob("*.foresee"):
            shutil.copy(file, folder)
        self._folder = folder
        self._count = 0
        self._others_mb = others_mb
        self._project = Project()
        self.slowest_s = 0.0
        """CPU time of the slowest input so far."""
        self.documents = 0
        """How many inputs the grammar and the model accepted."""

    def judge(self, content: bytes) -> Finding | None:
        """Return what is wrong with what becomes of an input, or None."""
        self._count += 1
        if self._count % _INPUTS_A_PROJECT == 0:
            self._project = Project()
        file = self._folder / f"input_{self._count}.foresee"
        file.write_bytes(content)
        before = time.process_time()
        try:
            with _limited():
                found = self._look(content, file)
        except _TooSlow:
            found = Finding(f"slow: {_place()}", f"over {MOST_CPU_S} s of CPU\n{traceback.format_exc()}")
        except Exception:
            found = Finding(f"{_error()}: {_place()}", traceback.format_exc())
        finally:
            file.unlink()
        self.slowest_s = max(self.slowest_s, time.process_time() - before)
        taken = peak_mb() - self._others_mb
        if found is None and taken > MOST_MEMORY_MB:
            found = Finding("memory", f"the process has taken {taken:.0f} MB")
        return found

    def _look(self, content: bytes, file: Path) -> Finding | None:
        """Read, format and check an input as the commands do; every step may refuse it."""
        try:
            text = decode(content, file.name)
            document = parse(text, file.name)
        except InputError as error:
            return _wrong(error.diagnostics, content, file)
        self.documents += 1
        try:
            _next_command()
            once = format_text(text, file.name)
        except InputError as error:
            return Finding("format", "; ".join(d.message for d in error.diagnostics))
        _next_command()
        if format_text(once, file.name) != once:
            return Finding("format twice", once)
        _next_command()
        if parse(once, file.name).model != document.model:
            return Finding("format meaning", once)
        found: list[Diagnostic] = []
        for load in (self._project.definition, lambda path: self._project.test_cases([path])):
            try:
                _next_command()
                load(file)
            except InputError as error:
                if not error.diagnostics:
                    return Finding("no diagnostics", str(load))
                found += error.diagnostics
        found += self._project.warnings
        self._project.warnings.clear()
        _next_command()
        if self._count % _INPUTS_A_PROJECT == 1:  # the command itself; it reads the networks each time
            found += check_paths([str(file)]).diagnostics
        return _wrong(found, content, file) if found else None


def peak_mb() -> float:
    """Return the largest memory that this process has taken, in MB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3  # bytes there, kilobytes elsewhere


def _next_command() -> None:
    """Each command has the whole time for itself."""
    signal.setitimer(signal.ITIMER_VIRTUAL, MOST_CPU_S)


@contextmanager
def _limited() -> Iterator[None]:
    """Interrupt what takes too much CPU; end the process that cannot be interrupted."""

    def stop(_signal: int, _frame: object) -> None:
        raise _TooSlow

    previous = signal.signal(signal.SIGVTALRM, stop)
    faulthandler.dump_traceback_later(_HANG_S, exit=True, file=sys.__stderr__)
    signal.setitimer(signal.ITIMER_VIRTUAL, MOST_CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGVTALRM, previous)


def _wrong(diagnostics: Sequence[Diagnostic], content: bytes, file: Path) -> Finding | None:
    """Return what is wrong with the mistakes that are reported."""
    if not diagnostics:
        return Finding("no diagnostics", "an InputError without a diagnostic")
    codes = every_code()
    json.dumps(to_sarif(diagnostics, codes))
    render_github(diagnostics, codes)
    for diagnostic in diagnostics:
        shown = "\n".join(_rendered(diagnostic))
        said = f"{diagnostic.message} {diagnostic.help}"
        for word in _PYTHON_WORDS:
            if word in said and word.encode() not in content:
                return Finding(f"words: {diagnostic.code}", shown)
        if not diagnostic.message or diagnostic.code not in codes or diagnostic.severity not in ("error", "warning"):
            return Finding("empty diagnostic", shown)
        if Path(diagnostic.path).name == file.name and not _inside(diagnostic, content):
            return Finding(f"span: {diagnostic.code}", f"{diagnostic.span}\n{shown}")
    return None


def _rendered(diagnostic: Diagnostic) -> list[str]:
    """Return a diagnostic in every format that shows single ones."""
    return [
        rendering.render_full(diagnostic),
        rendering.render_full(diagnostic, colour=True),
        rendering.render_concise(diagnostic),
        json.dumps(plain(diagnostic)),
    ]


def _inside(diagnostic: Diagnostic, content: bytes) -> bool:
    """Whether a place lies in the text; one character past a line's end stands for what is missing there."""
    span = diagnostic.span
    if span is None:
        return True
    text = content.decode("utf-8", errors="replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if not (1 <= span.line <= span.end_line <= len(lines)):
        return False
    ends = len(lines[span.line - 1]) + 1, len(lines[span.end_line - 1]) + 2
    in_order = (span.line, span.column) <= (span.end_line, span.end_column)
    return 1 <= span.column <= ends[0] and 1 <= span.end_column <= ends[1] and in_order


def _error() -> str:
    kind = sys.exc_info()[0]
    return kind.__name__ if kind is not None else ""


def _place() -> str:
    """Return the innermost line of ours in the exception that is being handled."""
    frames = traceback.extract_tb(sys.exc_info()[2])
    ours = [frame for frame in frames if "foresee_dsl" in frame.filename]
    return f"{Path(ours[-1].filename).name}:{ours[-1].name}" if ours else "?"
