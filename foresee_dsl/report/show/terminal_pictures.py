"""Pictures in a terminal: detects the protocol that it supports, and encodes pictures for kitty, iTerm and sixel.

The packages term-image and textual-image do this, too, but neither supports all three protocols, and one of them
queries the terminal when it is imported; the three encoders here have some thirty lines.
"""

from __future__ import annotations

import base64
import io
import os
import re
import sys
import time
from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.errors import ForeseeError

if TYPE_CHECKING:
    from PIL.Image import Image

ASKS_S = 0.15
"""Time that a terminal has to state its abilities, s; a terminal that does not answer gets characters. Ours: only very
distant ssh connections take longer."""
_KITTY_CHUNK = 4096
"""Maximum size of a chunk in kitty's protocol, bytes (its documentation, "The graphics escape code")."""
_COLOURS = 64
"""Number of colours in a sixel picture; a VT340 has 16, today's terminals have 256. Ours: a strip has a dozen colours
and their mixtures."""


class Pictures(StrEnum):
    """The protocols with which pictures can be shown in a terminal."""

    AUTO = "auto"
    NONE = "none"
    KITTY = "kitty"
    SIXEL = "sixel"
    ITERM = "iterm"


def way_of(environment: Mapping[str, str]) -> Pictures:
    """Return the protocol that the environment variables of the terminal state; `AUTO` if they state none."""
    program, term = environment.get("TERM_PROGRAM", ""), environment.get("TERM", "")
    if term in ("", "dumb") or environment.get("TMUX") or term.startswith(("screen", "tmux")):
        return Pictures.NONE  # a multiplexer does not pass pictures on to the terminal
    if environment.get("KITTY_WINDOW_ID") or term == "xterm-kitty" or program in ("ghostty", "WezTerm"):
        return Pictures.KITTY
    if program in ("iTerm.app", "mintty") or environment.get("LC_TERMINAL") == "iTerm2":
        return Pictures.ITERM
    if term.startswith(("foot", "mlterm", "yaft")) or "sixel" in term:
        return Pictures.SIXEL
    return Pictures.AUTO


def detect() -> Pictures:
    """Return the protocol of the standard output, from the environment or by querying the terminal; `NONE` if it has
    none.
    """
    if not (sys.stdout.isatty() and sys.stdin.isatty()):
        return Pictures.NONE
    way = way_of(os.environ)
    return (Pictures.SIXEL if _says_sixel(_query("\x1b[c")) else Pictures.NONE) if way is Pictures.AUTO else way


def _says_sixel(answer: str) -> bool:
    """Return whether a terminal's answer to the query of its attributes (DA1) contains a 4, which means sixel
    graphics.
    """
    attributes = re.search(r"\x1b\[\?([0-9;]+)c", answer)
    return attributes is not None and "4" in attributes.group(1).split(";")[1:]


def _query(question: str) -> str:
    """Send a query to the terminal and return its answer within `ASKS_S`; keys that the user presses meanwhile are
    lost.
    """
    try:
        import select
        import termios
        import tty
    except ImportError:  # a system without this module has no such terminals
        return ""
    keyboard = sys.stdin.fileno()
    try:
        before = termios.tcgetattr(keyboard)
    except termios.error:
        return ""
    answer = b""
    try:
        tty.setcbreak(keyboard, termios.TCSANOW)
        # Written to the descriptor, because the stream of the command line would escape control codes.
        stream = getattr(sys.stdout, "trusted", sys.stdout)
        stream.write(question)
        stream.flush()
        until = time.monotonic() + ASKS_S
        while not answer.endswith(b"c") and (left := until - time.monotonic()) > 0:
            if select.select([keyboard], [], [], left)[0]:
                answer += os.read(keyboard, 64)
    finally:
        termios.tcsetattr(keyboard, termios.TCSANOW, before)
    return answer.decode("ascii", errors="replace")


def encoded(png: bytes, way: Pictures) -> str:
    """Return the control codes with which a terminal shows a picture.

    Args:
        png: the content of a PNG file. way: the protocol, not `AUTO` or `NONE`.

    Raises:
        ForeseeError: pillow, which sixels need, is not installed.
    """
    if way is Pictures.KITTY:
        return "".join(_kitty(png))
    if way is Pictures.ITERM:
        data = base64.b64encode(png).decode("ascii")
        width = int.from_bytes(png[16:20], "big")  # width and height, from the header of the PNG
        return f"\x1b]1337;File=inline=1;size={len(png)};width={width}px:{data}\x07\n"
    try:
        from PIL import Image as Images
    except ImportError as err:
        raise ForeseeError("sixels need the package pillow: pip install 'foresee-dsl[pictures]'") from err
    return sixel(Images.open(io.BytesIO(png)))


def _kitty(png: bytes) -> Iterator[str]:
    data = base64.b64encode(png).decode("ascii")
    chunks = [data[k : k + _KITTY_CHUNK] for k in range(0, len(data), _KITTY_CHUNK)]
    for k, chunk in enumerate(chunks):
        head = "f=100,a=T,q=2," if k == 0 else ""
        yield f"\x1b_G{head}m={int(k < len(chunks) - 1)};{chunk}\x1b\\"
    yield "\n"


def sixel(picture: Image) -> str:
    """Return a picture as sixels: for each band of six rows, and each colour in it, a sequence of characters."""
    from PIL.Image import Quantize

    # Median cut, the default method, would turn a small red opponent brown.
    paletted = picture.convert("RGB").quantize(_COLOURS, method=Quantize.MAXCOVERAGE)
    colours = np.array(paletted.getpalette()).reshape(-1, 3)
    pixels = np.asarray(paletted)
    parts = [f'\x1bPq"1;1;{picture.width};{picture.height}']
    parts += [f"#{k};2;{r};{g};{b}" for k, (r, g, b) in enumerate((colours[:_COLOURS] * 100 // 255).tolist())]
    for top in range(0, len(pixels), 6):
        band = pixels[top : top + 6]
        weights = (1 << np.arange(len(band)))[:, None]
        rows = [f"#{colour}{_run(((band == colour) * weights).sum(axis=0))}" for colour in np.unique(band).tolist()]
        parts.append("$".join(rows) + "-")
    return "".join(parts) + "\x1b\\\n"


def _run(bits: np.ndarray) -> str:
    """Return a row of sixels in run-length encoding."""
    edges = np.flatnonzero(np.diff(bits)) + 1
    starts = [0, *edges.tolist()]
    lengths = np.diff([*starts, len(bits)]).tolist()
    signs = [chr(63 + int(bits[start])) for start in starts]
    return "".join(f"!{n}{sign}" if n > 3 else sign * n for n, sign in zip(lengths, signs, strict=True))
