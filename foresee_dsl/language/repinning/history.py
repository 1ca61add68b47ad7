"""Finds earlier versions of a file in git, with the files that it used then."""

from __future__ import annotations

import os
import posixpath
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.errors import InputError
from foresee_dsl.files import absolute, read_outside
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.project.loading import Project

COMMITS = 200
"""Maximum number of commits of the parent's files that are searched, newest first (ours: 60 ms each, measured)."""

_TIMEOUT_S = 30.0
"""Time limit of one call of git, s (ours: a log of a large repository takes some seconds)."""
_SETTINGS = (
    "log.showSignature=false", "gpg.program=false", "gpg.ssh.program=false", "gpg.x509.program=false",
    "core.fsmonitor=false", f"core.hooksPath={os.devnull}", "core.pager=cat", "core.editor=false", "core.askPass=false",
    "core.sshCommand=false", "core.gitProxy=false", "core.alternateRefsCommand=false", "credential.helper=",
    f"core.attributesFile={os.devnull}", "diff.external=", "gc.auto=0", "maintenance.auto=false",
    "submodule.recurse=false", "protocol.allow=never",
)  # fmt: skip
"""Options of git, given with `-c`, that override those settings of a repository that name programs (see git(1))."""
_ENVIRONMENT = {
    "GIT_ALLOW_PROTOCOL": "none",  # nothing is fetched, because the remote of a partial clone may be a command
    "GIT_NO_LAZY_FETCH": "1",  # this variable does the same from git 2.45 on
    "GIT_TERMINAL_PROMPT": "0",
    "GIT_OPTIONAL_LOCKS": "0",
}
_PLAIN = ("--no-show-signature", "--no-ext-diff", "--no-textconv", "--no-notes")
"""Options of `git log` that switch off signatures and programs that show differences."""
_USED = re.compile(r'"([^"\n]+\.(?:foresee|net\.xml|xodr))"')
"""Matches the files that a `.foresee` file may use: every string that looks like one."""


@dataclass(frozen=True)
class OldParent:
    """A parent as it was when a derived file pinned it, and the (abbreviated) commit that contains it."""

    case: TestCase
    commit: str


class History:
    """Old versions of files, extracted from git into a temporary folder on demand.

    It is a context manager, which deletes the folder at the end. Results are cached, so that many derived files of one
    parent need one search.
    """

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="foresee-")
        self._versions: dict[Path, tuple[_Version, ...]] = {}
        self._parents: dict[tuple[Path, str | None, str], OldParent | None] = {}

    def __enter__(self) -> History:
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def parent(self, file: Path, case: str | None, pin: str) -> OldParent | None:
        """Return the newest version of a parent's file, or of a case in it, whose meaning is `pin`; None if git has no
        such version."""
        key = (absolute(file), case, pin)
        if key not in self._parents:
            loaded = ((version.case(case), version.commit[:10]) for version in self._all(key[0]))
            matching = (OldParent(then, commit) for then, commit in loaded if then is not None and pin_of(then) == pin)
            self._parents[key] = next(matching, None)
        return self._parents[key]

    def _all(self, file: Path) -> tuple[_Version, ...]:
        if file not in self._versions:
            answer = _git(file.parent, "rev-parse", "--show-toplevel")
            root = Path(answer.decode().strip()) if answer else None
            name = _within(root, file) if root is not None else None
            commits = _commits(root, name, _files_used(root, file)) if root is not None and name is not None else ()
            base = Path(self._folder.name) / str(len(self._versions))
            self._versions[file] = tuple(_Version(root or file.parent, c, n, base / c) for c, n in commits)
        return self._versions[file]


class _Version:
    """A file and the files that it used, in one commit."""

    def __init__(self, root: Path, commit: str, name: str, folder: Path) -> None:
        self._root, self.commit, self._name, self._folder = root, commit, name, folder
        self._project: Project | None = None

    def case(self, case: str | None) -> TestCase | None:
        """Return the test case; None if it did not exist or had errors, so that no derived file can have pinned it."""
        if self._project is None:
            for file, content in _files_then(self._root, self.commit, self._name).items():
                (self._folder / file).parent.mkdir(parents=True, exist_ok=True)
                (self._folder / file).write_bytes(content)
            self._project = Project(check_pin=False)
        there = self._folder / self._name
        try:
            return self._project.test_case(f"{there}::{case}" if case else there)
        except InputError:
            return None


def _commits(root: Path, name: str, used: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return the commits that touch a file or the files that it uses, newest first, each with the file's name in it.

    Moved files are followed one by one, because `git log` follows one file at a time.
    """
    own = _followed(root, name)
    touching = {commit: time for each in used for time, commit, _ in (own if each == name else _followed(root, each))}
    names = {commit: there for _, commit, there in own}
    commits: list[tuple[str, str]] = []
    for commit, time in sorted(touching.items(), key=lambda entry: -entry[1])[:COMMITS]:
        there = names.get(commit) or next((before for at, _, before in own if at <= time), None)
        if there is not None:
            commits.append((commit, there))
    return tuple(commits)


def _followed(root: Path, name: str) -> list[tuple[int, str, str]]:
    """Return the commits that touch a file, newest first: time in s, hash, and the file's name in the commit."""
    log = ("log", *_PLAIN, "--follow", f"--max-count={COMMITS}", "--name-only", "--format=%x01%ct %H", "-z", "--", name)
    entries = (_git(root, *log) or b"").decode(errors="replace").split("\x01")[1:]
    commits = []
    for entry in entries:
        head, *names = (part.strip("\n") for part in entry.split("\0"))
        time, _, commit = head.partition(" ")
        there = next((part for part in names if part), name)
        commits.append((int(time), commit, there))
    return commits


def _within(root: Path, file: Path) -> str | None:
    """Return a file's name in the repository; links on the way to it are followed, as git does."""
    try:
        return file.resolve().relative_to(root.resolve()).as_posix()
    except ValueError:
        return None


def _files_used(root: Path, parent: Path) -> tuple[str, ...]:
    """Return a file and the files that it uses now, by their names in git."""
    files: dict[Path, None] = {}
    todo = [parent]
    while todo:
        file = todo.pop()
        if file not in files and file.suffix == ".foresee" and file.is_file():
            text = read_outside(file).decode("utf-8", errors="replace")
            todo += [absolute(file.parent / used) for used in _USED.findall(text)]
        files[file] = None
    return tuple(name for file in files if (name := _within(root, file)) is not None)


def _files_then(root: Path, commit: str, name: str) -> dict[str, bytes]:
    """Return the contents of a file and the files that it used in a commit; empty if the file did not exist."""
    contents: dict[str, bytes] = {}
    todo = [name]
    while todo:
        file = todo.pop()
        if file in contents or file.startswith(("..", "/")):
            continue
        content = _git(root, "cat-file", "blob", f"{commit}:{file}")
        if content is None:
            continue
        contents[file] = content
        if file.endswith(".foresee"):
            text = content.decode("utf-8", errors="replace")
            todo += [posixpath.normpath(posixpath.join(posixpath.dirname(file), used)) for used in _USED.findall(text)]
    return contents if name in contents else {}


def _git(folder: Path, *arguments: str) -> bytes | None:
    """Return the output of git; None if it fails or is not installed.

    The repository may come from a stranger, so no program that its configuration names may be started.
    """
    program = shutil.which("git")
    if program is None:
        return None
    settings = (word for setting in _SETTINGS for word in ("-c", setting))
    try:
        done = subprocess.run(  # noqa: S603  (a fixed program, no shell; file names stand behind `--` or `COMMIT:`)
            [program, "--no-pager", "--literal-pathspecs", *settings, "-C", str(folder), *arguments],
            env={**os.environ, **_ENVIRONMENT},
            stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=_TIMEOUT_S,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None
