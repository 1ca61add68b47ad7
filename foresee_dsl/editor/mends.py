"""Mends a mistake the way its help says: `did you mean 'km/h'?`."""

from __future__ import annotations

import re

_MEANT = re.compile(r"did you mean ['`]([^'`]+)['`]\?")
_QUOTED = re.compile(r"['`]([^'`]+)['`]")


def mend(message: str, written: str) -> tuple[int, int, str] | None:
    """Return what to replace in the underlined text (start, end) and by what; None where nothing can be said.

    Args:
        message: the mistake and its help, as shown.
        written: the text that is underlined.
    """
    meant = _MEANT.search(message)
    if meant is None:
        return None
    wrong = next((w for w in _QUOTED.findall(message[: meant.start()]) if w in written), None)
    if written.startswith('"') and written.endswith('"') and len(written) > 2:
        start = written.rfind("/") + 1 or 1  # of a file, the help names the last part of the path
        return start, len(written) - 1, meant[1]
    if wrong is None or written.count(wrong) != 1:
        return (0, len(written), meant[1]) if re.fullmatch(r"\S+", written) else None
    start = written.index(wrong)
    return start, start + len(wrong), meant[1]
