"""Finds the `.foresee` files under the paths that a user names, and the kind of each, without parsing it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from itertools import islice
from pathlib import Path, PurePath

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.files import open_outside
from foresee_dsl.helps import HelpText, meant_word, write
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.model.values import NAME_PATTERN

SUFFIX = ".foresee"
FOREIGN_NETWORKS = (".net.xml", ".xodr")
TRACKS = ".tracks.csv"
"""How the name of a file with recorded tracks ends."""

_MARKERS = (".git", ".hg", "pyproject.toml")
"""Names of files and folders that mark the topmost folder of a project."""
_WITHOUT_GIT = ".gitattributes"
"""Marker that `foresee init` writes before there is a repository. In a repository any folder may have it, so it marks
no project there."""
_FIRST_WORD = re.compile(r"(scenario|clip|mutant|network|models|campaign)\b")
_HEADER = re.compile(r"foresee\s+\d+$")
_SNIFFED_BYTES = 65_536
"""Number of bytes at the beginning of a file in which the keyword is searched; enough for a long licence comment before
it (ours)."""


def parse_address(address: str) -> tuple[Path, str | None]:
    """Split `file.foresee::case` into the file and the case (None if no case is named)."""
    file, mark, case = address.rpartition("::")
    if not mark:
        file, case = address, ""
    if not file:
        help = "write " + write("file.foresee") + " or " + write("file.foresee::case")
        raise mistake("FS131", f"'{address}' does not name a file", help, address)
    if mark and not re.fullmatch(NAME_PATTERN, case):
        message = f"'{case}' is not the name of a case"
        raise mistake("FS131", message, "write " + write("file.foresee::case"), file)
    return Path(file), case or None


def display_path(path: str | PurePath) -> str:
    """Return a path for messages and ids: as the user wrote it, normalised, with forward slashes."""
    return Path(os.path.normpath(path)).as_posix()


def kind_of(path: Path) -> str:
    """Return the kind of a file by its first keyword, such as `scenario` or `campaign`; "" if unclear."""
    try:
        with open_outside(path) as file:
            text = file.read(_SNIFFED_BYTES).decode("utf-8", errors="replace")
    except OSError:  # reading the file later reports the reason
        return ""
    return kind_of_text(text)


def kind_of_text(text: str) -> str:
    """Return the kind of definition in a text by its first keyword; "" if the text has none."""
    for line in text.lstrip("\ufeff").splitlines():
        statement = line.partition("#")[0].strip()
        if statement and not _HEADER.match(statement):
            word = _FIRST_WORD.match(statement)
            return word.group(1) if word else ""
    return ""


def is_file(path: Path) -> bool:
    """Return whether a file exists; False for a path that the system refuses (for which `Path.is_file` raises)."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: Path) -> bool:
    """Return whether a folder exists; False for a path that the system refuses."""
    return os.path.isdir(path)  # noqa: PTH112


def scenario_files(paths: Iterable[str | Path]) -> tuple[Path, ...]:
    """Return every `.foresee` file that is named or lies under a named folder, of any kind.

    The files are in the order in which `paths` names them; those of a folder are in the order of their own paths. No
    file comes twice, and folders whose name begins with a dot are skipped. A file that is named itself may have any
    suffix.

    Raises:
        InputError: a path does not exist.
    """
    files: dict[str, Path] = {}
    for path in map(Path, paths):
        for file in _under(path) if is_folder(path) else (path,):
            if not is_file(file):
                raise missing(file)
            files.setdefault(os.path.abspath(file), file)  # noqa: PTH100  (a key: no links followed)
    return tuple(files.values())


def missing(path: Path) -> InputError:
    """Return the error for a file or folder that does not exist, with the nearest name beside it."""
    name = display_path(path)
    if is_folder(path):
        example = f"write `{name}/NAME{SUFFIX}`"
        return mistake("FS131", f"'{name}' is a folder, but one file is needed", example, name)
    if os.path.lexists(path):
        what = "the target of this link does not exist" if not path.exists() else "this is not an ordinary file"
        return mistake("FS130", f"'{name}': {what}", "name a text file", name)
    return mistake("FS130", f"there is no file or folder '{name}'", near_files(path), name)


def near_files(path: Path) -> HelpText:
    """Return a help that names a file in the same folder with a name close to the missing one."""
    folder = display_path(path.parent.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path.parent)
    if not is_folder(path.parent):
        return f"there is no folder '{folder}'" + _elsewhere(path)
    try:
        names = sorted(e.name for e in path.parent.iterdir() if e.name.endswith((SUFFIX, TRACKS, *FOREIGN_NETWORKS)))
    except OSError:
        return ""
    stems = {name.partition(".")[0]: name for name in names}
    near = stems.get(closest(path.name.partition(".")[0], stems) or "")
    return meant_word(near, path.name) if near else f"there is no file of a similar name in '{folder}'"


_MOST_FILES = 200
"""Maximum number of files whose names are compared with a missing one (ours: some milliseconds)."""


def _elsewhere(path: Path) -> HelpText:
    """Return a help that names a file of nearly this name elsewhere, if the named folder does not exist."""
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
    """Return the names of at most three files in a folder whose definition begins with a word."""
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


def marked(folder: Path) -> bool:
    """Return whether a folder has a marker of a project."""
    return any((folder / name).exists() for name in (*_MARKERS, _WITHOUT_GIT))


def is_inside(path: Path, folders: Iterable[Path]) -> bool:
    """Return whether a path, with links followed, lies in one of some folders."""
    real = path.resolve()
    return any(real.is_relative_to(folder.resolve()) for folder in folders)


def relative_to(folder: Path, path: Path) -> str:
    """Return `path` relative to `folder`, with forward slashes, as a file in that folder writes it."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on Windows, a path on another drive cannot be relative
        return path.as_posix()


def _under(folder: Path) -> list[Path]:
    files: list[Path] = []
    for parent, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        files.extend(Path(parent) / name for name in names if name.endswith(SUFFIX))
    return sorted(files, key=lambda file: file.as_posix())


def mistake(code: str, message: str, help: HelpText, path: str) -> InputError:
    """Return an error with one diagnostic about a file as a whole."""
    return InputError((Diagnostic.of(code, message, help, path),))
