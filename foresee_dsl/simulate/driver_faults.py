"""Describes an exception that a driver raised: its text, the place in the driver's own code, and the traceback of that
code.
"""

from __future__ import annotations

import re
import sysconfig
import traceback
from itertools import dropwhile, takewhile
from pathlib import Path
from types import FrameType, TracebackType
from typing import NamedTuple

from foresee_dsl.errors import DriverError
from foresee_dsl.files import PACKAGE
from foresee_dsl.language.printer import quotable
from foresee_dsl.simulate.results.verdict import Hang

_DRIVERS = PACKAGE / "drivers"
_NO_DRIVERS = {_DRIVERS / f"{name}.py" for name in ("registry", "python_file", "following", "stepped", "bundled")}
"""Modules that load drivers, follow their trajectories, or call the driver that is derived from a class there."""
_BRIDGES = "foresee_bridges"
"""The package of ours whose drivers call the code of another person: its lines are not the driver's own."""
_LIBRARIES = {Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib", "purelib", "platlib")}
LONGEST_REASON = 1000
"""Maximum number of characters of an exception's text in the reason. Ours: half of the limit of a text in a file."""
LONGEST_TRACEBACK = 8000
"""Maximum number of characters of a traceback. Ours: a hundred lines."""
_Entry = tuple[FrameType, int]
"""An entry of a traceback: its frame, and the line."""
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
"""An object's place in memory in its text, which is another in each run."""
_DUMPED = re.compile(r'^  File "(?P<file>.*)", line (?P<line>\d+) in (?P<name>.*)$', re.M)


class DriverHangs(BaseException):
    """Raised when a driver exceeds a deadline.

    Attributes:
        what: the call and its deadline, in words.
        allows: the option that allows more time.
        hang: the call and its deadline as data.
    """

    def __init__(self, what: str, allows: str, hang: Hang) -> None:
        super().__init__(f"{what}; {allows} allows more")
        self.what, self.allows, self.hang = what, allows, hang


class DriverFault(NamedTuple):
    """The description of a driver's exception.

    Attributes:
        text: one line, such as `the driver raised ValueError: no idea, at mine.py:12 (step)`.
        traceback: the frames of the driver's code, as Python prints them; "" where there are none.
    """

    text: str
    traceback: str


def fault_of(err: BaseException) -> DriverFault:
    """Return a description of the exception that a driver raised."""
    if isinstance(err, DriverError):
        return DriverFault(f"the driver broke: {one_line(err)}", "")
    at = f", at {place}" if (place := place_of(err)) else ""
    if isinstance(err, SystemExit):
        return DriverFault(f"the driver called sys.exit({err.code!r:.80}){at}", traceback_of(err))
    text = one_line(err)
    return DriverFault(f"the driver raised {type(err).__name__}{f': {text}' if text else ''}{at}", traceback_of(err))


def one_line(err: BaseException) -> str:
    """Return an exception's text as one line without double quotes, which can be quoted in a file of the language; and
    without places in memory, so that the same run has the same reason.
    """
    try:
        text = str(err)
    except Exception:  # its own __str__ may raise as well
        text = "(its text cannot be read)"
    return quotable(_ADDRESS.sub("", text), LONGEST_REASON)


def place_of(err: BaseException) -> str:
    """Return the innermost place in the driver's own code, such as `mine.py:12 (Mine.step)`; "" if the traceback has
    none.
    """
    frames = [entry for entry in _own(err.__traceback__) if not _in_ours(entry) and not _is_generated(entry)]
    if not frames:
        return ""
    # The driver's own code is its file and those beside it. If the driver is installed, it is the package that the
    # simulator called: a library that the package calls, such as numpy, is not.
    top = _package(frames[0])
    own = [entry for entry in frames if _is_theirs(_file(entry))]
    frame, line = (own or [entry for entry in frames if _package(entry) == top])[-1]
    code = frame.f_code
    return f"{Path(code.co_filename).name}:{line} ({code.co_qualname.replace('<locals>.', '')})"


def traceback_of(err: BaseException) -> str:
    """Return the traceback from the first frame of the driver's code on, with the exceptions that caused it."""
    frames = _own(err.__traceback__)
    if not frames:
        return ""
    report = traceback.TracebackException(type(err), err, err.__traceback__)
    stack = report.stack[-len(frames) - _watching(err.__traceback__) :][: len(frames)]
    report.stack = traceback.StackSummary.from_list(stack)
    lines = list(report.format())
    text = "".join(lines[:-1] if isinstance(err, DriverHangs) else lines).rstrip()
    half = LONGEST_TRACEBACK // 2
    return text if len(text) <= LONGEST_TRACEBACK else f"{text[:half]}\n  ...\n{text[-half:]}"


def place_in_dump(dump: str) -> str:
    """Return the place in the driver's code from a dump of `faulthandler` (innermost frame first); "" without one."""
    # The thread that runs the drivers comes last in the dump.
    main = re.split(r"^(?:Thread|Current thread) 0x", dump, flags=re.M)[-1]
    frames = [(Path(match["file"]), match["line"], match["name"]) for match in _DUMPED.finditer(main)]
    theirs = []
    for file, line, name in frames:
        if _is_ours(file):
            break
        theirs.append((file, line, name))
    if not theirs or len(theirs) == len(frames):
        return ""
    outermost = theirs[-1][0]
    own = [frame for frame in theirs if _is_theirs(frame[0])]
    file, line, name = (own or [frame for frame in theirs if frame[0] == outermost])[0]
    return f"{file.name}:{line} ({name})"


def _own(trace: TracebackType | None) -> list[_Entry]:
    """Return the entries of a traceback from the first one in a driver's code on, without those that this module's
    watch added.
    """
    entries = list(dropwhile(_in_ours, traceback.walk_tb(trace)))
    return entries[: len(entries) - _watching(trace)]


def _watching(trace: TracebackType | None) -> int:
    """Return how many entries at the end of a traceback belong to the simulator, which interrupted the driver there."""
    return len(list(takewhile(_in_ours, reversed(list(traceback.walk_tb(trace))))))


def _in_ours(entry: _Entry) -> bool:
    file = _file(entry)
    return _is_ours(file) or str(file).startswith("<frozen ")  # Python's import system


def _is_generated(entry: _Entry) -> bool:
    """Return whether an entry has no line in a file: text that its module executes, or a method of a dataclass."""
    return str(_file(entry)) == "<string>" and "__file__" in entry[0].f_globals


def _file(entry: _Entry) -> Path:
    return Path(entry[0].f_code.co_filename)


def _package(entry: _Entry) -> str:
    return str(entry[0].f_globals.get("__name__", "")).partition(".")[0]


def _is_ours(file: Path) -> bool:
    """Return whether a file belongs to the simulator; the bundled drivers count as drivers."""
    if _BRIDGES in file.parts:
        return True
    return file.is_relative_to(PACKAGE) and (not file.is_relative_to(_DRIVERS) or file in _NO_DRIVERS)


def _is_theirs(file: Path) -> bool:
    """Return whether a file is neither the simulator's nor installed, so that it can only be the driver's."""
    outside = file.is_relative_to(PACKAGE) or _BRIDGES in file.parts or any(map(file.is_relative_to, _LIBRARIES))
    return not outside and not str(file).startswith("<frozen ")
