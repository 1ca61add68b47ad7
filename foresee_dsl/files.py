"""Access to files: the package's own files and cache, whole-or-nothing writing, and safe reading of other people's
files."""

from __future__ import annotations

import errno
import hashlib
import io
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from foresee_dsl.limits import most, raised_by

if TYPE_CHECKING:
    from jinja2 import Environment

_SHORT = 12
"""Number of digits of a short hash. Ours: as in the pins of mutants."""
PACKAGE = Path(__file__).resolve().parent
"""Folder of this package."""


def absolute(path: Path) -> Path:
    """Return an absolute, normalised path; symbolic links stay as they are."""
    return Path(os.path.abspath(path))  # noqa: PTH100  (Path.absolute keeps `..`, Path.resolve follows links)


def data_folder(name: str) -> Path:
    """Return the folder `name` ("grammars", "templates" or "scenarios") of this installation.

    A wheel has these folders inside the package (`_data/`); a checkout keeps them at the top level.
    """
    packaged = PACKAGE / "_data" / name
    return packaged if packaged.is_dir() else PACKAGE.parent / name


@cache
def templates(folder: str, *, markup: bool = True) -> Environment:
    """Return the templates of `templates/FOLDER`, autoescaped for XML and HTML; an undefined name is an error.

    A plug-in passes the absolute path of a folder of its own.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # slow import, needed only for rendering

    return Environment(
        loader=FileSystemLoader(data_folder("templates") / folder),
        undefined=StrictUndefined,
        autoescape=markup,  # noqa: S701 - plain text needs no escaping
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def rendered(template: str, **values: object) -> str:
    """Return the text of the template `templates/<template>.j2` (such as `report/junit.xml`), filled with the
    values."""
    folder, _, name = template.rpartition("/")
    return templates(folder).get_template(f"{name}.j2").render(**values)


def cache_folder(name: str) -> Path:
    """Return the private cache folder `name`, which is created: in `$FORESEE_CACHE`, or under the user's cache
    folder."""
    base = os.environ.get("FORESEE_CACHE")
    if base is None:
        xdg = os.environ.get("XDG_CACHE_HOME")
        base = str((Path(xdg) if xdg else Path.home() / ".cache") / "foresee-dsl")
    folder = Path(base) / name
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as err:
        reason = err.strerror or str(err)
    else:
        if os.access(folder, os.W_OK):
            return folder
        reason = "it may not be written"
    folder = _temporary_cache(base, reason) / name
    folder.mkdir(exist_ok=True, mode=0o700)
    return folder


@cache
def _temporary_cache(base: str, reason: str) -> Path:
    """Return a temporary cache folder for this process and its children, in place of one that cannot be used."""
    import atexit
    import shutil
    import tempfile
    import warnings

    folder = tempfile.mkdtemp(prefix="foresee-cache-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    warnings.warn(
        f"the cache folder {base} cannot be used ({reason}): a temporary one is used and is deleted at the "
        "end; FORESEE_CACHE can name another folder",
        stacklevel=2,
    )
    os.environ["FORESEE_CACHE"] = folder
    return Path(folder)


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Yield a temporary path beside `file`, which replaces `file` at the end unless there is an error.

    So no other process ever reads half a file, and an error leaves the old file unchanged.
    """
    temporary = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(file: Path, content: str | bytes) -> None:
    """Write a file whole or not at all, a text as UTF-8, creating its folder; an existing file keeps its
    permissions."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        if file.exists():
            temporary.chmod(file.stat().st_mode & 0o777)


class NotOrdinaryError(OSError):
    """A path leads to a pipe, a device or a socket, so reading it may never end."""


def open_outside(file: Path, limit: str | None = "file") -> BinaryIO:
    """Open a file that may come from another person, for reading bytes; every such file is opened here.

    A pipe or a device may have no end or block for ever, so only ordinary files are opened. A file of the system, such
    as `/proc/kmsg`, may block as well; such files claim a size of 0, so nothing is read from a file of size 0.

    Args:
        limit: a name of `limits.LIMITS`, in MB; None for a file that is read piece by piece in bounded memory.

    Raises:
        NotOrdinaryError: it is a pipe, a device or a socket, or a link to one.
        OSError: the file cannot be read, is a folder, or is larger than `limit` allows; `strerror` has the reason.
    """
    _check_ordinary(file.stat(), file, limit)  # opening a device may already have an effect
    wanted = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    opened = os.fdopen(os.open(file, wanted), "rb")
    try:
        size = _check_ordinary(
            os.fstat(opened.fileno()), file, limit
        )  # checked again, in case the path changed in between
    except OSError:
        opened.close()
        raise
    if size > 0:
        return opened
    opened.close()
    return io.BytesIO()


def read_outside(file: Path, limit: str = "file") -> bytes:
    """Return the bytes of a file that may come from another person.

    Raises:
        OSError: as `open_outside`.
    """
    with open_outside(file, limit) as opened:
        return opened.read(round(most(limit) * 1e6))


def read_outside_text(file: Path, limit: str = "file") -> str:
    """Return the text (UTF-8) of a file that may come from another person, its newlines as `\\n`.

    Raises:
        OSError: as `open_outside`. UnicodeDecodeError: it is not UTF-8.
    """
    with io.TextIOWrapper(open_outside(file, limit), encoding="utf-8") as opened:
        return opened.read(round(most(limit) * 1e6))


def short_hash(*contents: bytes) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of contents: the version of a driver that is a file."""
    return hashlib.sha256(b"".join(contents)).hexdigest()[:_SHORT]


def stamp_of(file: Path) -> tuple[int, int] | None:
    """Return the time of a file's last change (ns) and its size; None if it cannot be read."""
    try:
        status = file.stat()
    except (OSError, ValueError):  # ValueError: the path has a null character
        return None
    return status.st_mtime_ns, status.st_size


def unpacked_within(limit: str, packed: bytes) -> bytes:
    """Return the uncompressed data of zlib-compressed bytes; 4 MB may expand to 4 GB.

    Args:
        limit: name of the limit of the uncompressed size, in MB.

    Raises:
        ValueError: it is cut off, or larger than the limit.
        zlib.error: it is damaged.
    """
    allowed = round(most(limit) * 1e6)
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(packed, allowed + 1)
    if len(data) > allowed:
        raise ValueError(f"it has more than {most(limit):g} MB when it is unpacked; {raised_by(limit)}")
    if not unpacker.eof:
        raise ValueError("it is cut off")
    return data


def _check_ordinary(facts: os.stat_result, file: Path, limit: str | None) -> int:
    """Return the size of an ordinary file in bytes; raise for other files and for files beyond the limit."""
    if stat.S_ISDIR(facts.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(file))
    if not stat.S_ISREG(facts.st_mode):
        raise NotOrdinaryError(errno.EINVAL, "it is not an ordinary file", str(file))
    size_mb = facts.st_size / 1e6
    if limit is not None and size_mb > most(limit):
        allowed = f"it has {size_mb:,.{0 if size_mb >= 10 else 1}f} MB, more than the {most(limit):g} MB that are read"
        raise OSError(errno.EFBIG, f"{allowed}; {raised_by(limit, size_mb)}", str(file))
    return facts.st_size
