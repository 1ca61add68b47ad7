"""Which `.foresee` files there are under what the user named, and what kind each is, without parsing it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from itertools import islice
from pathlib import Path, PurePath

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.files import open_outside
from foresee_dsl.helps import HelpText, meant_word, write
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.model.values import NAME_PATTERN

SUFFIX = ".foresee"
FOREIGN_NETWORKS = (".net.xml", ".xodr")

_MARKERS = (".git", ".hg", "pyproject.toml")
"""What lies in the topmost folder of a project."""
_WITHOUT_GIT = ".gitattributes"
"""What `foresee init` writes there, before there is a repository; in one it may lie in any folder."""
_FIRST_WORD = re.compile(r"(scenario|clip|mutant|network|models|campaign)\b")
_HEADER = re.compile(r"foresee\s+\d+$")
_SNIFFED_BYTES = 65_536
"""The keyword stands in the first lines; this much allows for a long licence comment (ours)."""


def parse_address(address: str) -> tuple[Path, str | None]:
    """Split `file.foresee::case` into the file and the case (None where none is named)."""
    file, mark, case = address.rpartition("::")
    if not mark:
        file, case = address, ""
    if not file:
        raise mistake(
            c.BAD_ADDRESS,
            f"'{address}' names no file",
            "write " + write("file.foresee") + " or " + write("file.foresee::case"),
            address,
        )
    if mark and not re.fullmatch(NAME_PATTERN, case):
        raise mistake(c.BAD_ADDRESS, f"'{case}' is no name of a case", "write " + write("file.foresee::case"), file)
    return Path(file), case or None


def shown(path: str | PurePath) -> str:
    """Return a path as messages and ids show it: as the user gave it, normalised, with forward slashes."""
    return Path(os.path.normpath(path)).as_posix()


def kind_of(path: Path) -> str:
    """Return what a file holds by its first keyword, such as `scenario` or `campaign`; "" when unclear."""
    try:
        with open_outside(path) as file:
            text = file.read(_SNIFFED_BYTES).decode("utf-8", errors="replace")
    except OSError:  # reading the file later reports the reason
        return ""
    return kind_of_text(text)


def kind_of_text(text: str) -> str:
    """Return what a text defines by its first keyword; "" when unclear."""
    for line in text.lstrip("\ufeff").splitlines():
        statement = line.partition("#")[0].strip()
        if statement and not _HEADER.match(statement):
            found = _FIRST_WORD.match(statement)
            return found.group(1) if found else ""
    return ""


def is_file(path: Path) -> bool:
    """Return whether there is such a file; False for a path that the system refuses (`Path.is_file` raises there)."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: Path) -> bool:
    """Return whether there is such a folder; False for a path that the system refuses."""
    return os.path.isdir(path)  # noqa: PTH112


def scenario_files(paths: Iterable[str | Path]) -> tuple[Path, ...]:
    """Return every `.foresee` file that is named or lies under a named folder, whatever it holds.

    In the order named, the files of a folder sorted by path; no file twice; folders whose name begins with a dot are
    left out. A file that is named itself may have any suffix.

    Raises:
        InputError: a path does not exist.
    """
    found: dict[str, Path] = {}
    for path in map(Path, paths):
        for file in _under(path) if is_folder(path) else (path,):
            if not is_file(file):
                raise missing(file)
            found.setdefault(os.path.abspath(file), file)  # noqa: PTH100  (a key: no links followed)
    return tuple(found.values())


def missing(path: Path) -> InputError:
    """Return the error for a file or folder that does not exist, with the nearest name beside it."""
    if is_folder(path):
        example = f"write `{shown(path)}/NAME{SUFFIX}`"
        return mistake(c.BAD_ADDRESS, f"'{shown(path)}' is a folder, but one file is needed", example, shown(path))
    if os.path.lexists(path):
        what = "this link leads nowhere" if not path.exists() else "this is not an ordinary file"
        return mistake(c.MISSING_FILE, f"'{shown(path)}': {what}", "name a text file", shown(path))
    return mistake(c.MISSING_FILE, f"no file or folder '{shown(path)}'", near_files(path), shown(path))


def near_files(path: Path) -> HelpText:
    """Return a hint at files in the same folder whose names are close to a missing one."""
    folder = shown(path.parent.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path.parent)
    if not is_folder(path.parent):
        return f"there is no folder '{folder}'" + _elsewhere(path)
    try:
        names = sorted(e.name for e in path.parent.iterdir() if e.name.endswith((SUFFIX, *FOREIGN_NETWORKS)))
    except OSError:
        return ""
    stems = {name.partition(".")[0]: name for name in names}
    near = stems.get(closest(path.name.partition(".")[0], stems) or "")
    return meant_word(near, path.name) if near else f"there is none of that name in '{folder}'"


_MOST_FILES = 200
"""So many files are looked at for one that was meant (ours: some milliseconds)."""


def _elsewhere(path: Path) -> HelpText:
    """Return where a file of nearly this name lies, when the folder that was named does not exist."""
    above = next((folder for folder in path.parents if is_folder(folder)), None)
    if above is None:
        return ""
    try:
        files = [file for file in islice(above.rglob(f"*{SUFFIX}"), _MOST_FILES) if file.is_file()]
    except OSError:
        return ""
    names = {file.name: file for file in sorted(files, key=lambda file: -len(file.parts))}
    near = names.get(closest(path.name, names) or "")
    return ": there is " + write(f'"{near.relative_to(above).as_posix()}"') if near is not None else ""


def files_with(folder: Path, word: str) -> tuple[str, ...]:
    """Return the names of the files in a folder whose definition begins with a word; three at most."""
    try:
        files = sorted(file for file in islice(folder.glob(f"*{SUFFIX}"), _MOST_FILES) if file.is_file())
        return tuple(file.name for file in files if kind_of(file) == word)[:3]
    except OSError:
        return ()


def project_folder(folder: Path) -> Path:
    """Return the project that a folder belongs to: the nearest folder above with a marker, or else the folder itself.

    `folder` is absolute.
    """
    for names in (_MARKERS, (_WITHOUT_GIT,)):
        for above in (folder, *folder.parents):
            if any((above / name).exists() for name in names):
                return above
    return folder


def is_inside(path: Path, folders: Iterable[Path]) -> bool:
    """Return whether a path lies in one of some folders, also once links are followed."""
    real = path.resolve()
    return any(real.is_relative_to(folder.resolve()) for folder in folders)


def absolute(path: Path) -> Path:
    """Return an absolute, normalised path; symbolic links stay as they are."""
    return Path(os.path.abspath(path))  # noqa: PTH100  (Path.absolute keeps `..`, Path.resolve follows links)


def relative_to(folder: Path, path: Path) -> str:
    """Return `path` as a file in `folder` would write it: relative, with forward slashes."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive, on Windows
        return path.as_posix()


def _under(folder: Path) -> list[Path]:
    files: list[Path] = []
    for parent, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        files.extend(Path(parent) / name for name in names if name.endswith(SUFFIX))
    return sorted(files, key=lambda file: file.as_posix())


def mistake(code: str, message: str, help: HelpText, path: str) -> InputError:
    """Return the error for one mistake that is about a file as a whole."""
    return InputError((Diagnostic.of(code, message, help, path),))
