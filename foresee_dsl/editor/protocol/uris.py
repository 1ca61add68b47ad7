"""Converts between paths and the addresses of editors: `file:` addresses, and those of texts that were never saved."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit
from urllib.request import url2pathname


def absolute(path: Path) -> Path:
    """Return an absolute, normalised path, like the language's `addresses.absolute`, without importing that."""
    return Path(os.path.abspath(path))  # noqa: PTH100 - symbolic links stay as they are


def is_file(uri: str) -> bool:
    """Return whether an address is that of a file."""
    return uri.startswith("file:")


def path_of(uri: str) -> Path:
    """Return the path of a document; for one that was never saved, a path that does not exist."""
    if not is_file(uri):
        return Path("/") / uri.replace("/", "_").replace(":", "_")
    parts = urlsplit(uri)
    host = f"//{parts.netloc}" if parts.netloc and parts.netloc != "localhost" else ""
    path = unquote(parts.path) if os.name != "nt" else url2pathname(parts.path)
    return absolute(Path(host + path))


def uri_of(path: Path) -> str:
    """Return a file's address."""
    return "file://" + quote(path.as_posix(), safe="/:@-._~!$&'()*+,;=") if os.name != "nt" else path.as_uri()
