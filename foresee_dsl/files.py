"""Where the package's own files, templates and cache are, and files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment

_PACKAGE = Path(__file__).resolve().parent


def data_folder(name: str) -> Path:
    """Return the folder `name` ("grammars", "templates" or "scenarios") of this installation.

    A wheel carries them inside the package (`_data/`); a checkout keeps them at the top level.
    """
    packaged = _PACKAGE / "_data" / name
    return packaged if packaged.is_dir() else _PACKAGE.parent / name


@cache
def templates(folder: str, *, markup: bool = True) -> Environment:
    """Return the templates of `templates/FOLDER`, autoescaped as XML and HTML; a name that is not given is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # only where something is rendered

    return Environment(
        loader=FileSystemLoader(data_folder("templates") / folder),
        undefined=StrictUndefined,
        autoescape=markup,  # noqa: S701 - plain text is no markup
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def rendered(template: str, **values: object) -> str:
    """Return the text that `templates/<template>.j2` (`report/junit.xml`) gives with all the values that it names."""
    folder, _, name = template.rpartition("/")
    return templates(folder).get_template(f"{name}.j2").render(**values)


def cache_folder(name: str) -> Path:
    """Return (and make) the private cache folder `name`: `$FORESEE_CACHE`, or `foresee-dsl` under the user's cache."""
    base = os.environ.get("FORESEE_CACHE")
    if base is None:
        xdg = os.environ.get("XDG_CACHE_HOME")
        base = str((Path(xdg) if xdg else Path.home() / ".cache") / "foresee-dsl")
    folder = Path(base) / name
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return folder


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Give a temporary path beside `file`; what is written there becomes `file` at the end, unless there is an error.

    So no other process ever reads half a file, and an error leaves the old file as it was.
    """
    temporary = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(file: Path, text: str) -> None:
    """Write a text file whole or not at all, making its folder; an existing file keeps its permissions."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        if file.exists():
            temporary.chmod(file.stat().st_mode & 0o777)
