"""Pictures in a terminal: which way it can show them, and the three ways (kitty, iTerm, sixel).

term-image and textual-image do this too; neither knows all three, one asks the terminal when it is imported, and the
three encoders are some thirty lines here.
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
"""How long a terminal may take to say what it is. Ours: over ssh round the world it takes longer; then it gets
characters."""
_KITTY_CHUNK = 4096
"""The protocol's largest piece."""
_COLOURS = 64
"""Of a sixel picture; a VT340 had 16, today's terminals have 256. Ours: the strip has a dozen and their mixtures."""


class Pictures(StrEnum):
    """How pictures are sent."""

    AUTO = "auto"
    NONE = "none"
    KITTY = "kitty"
    SIXEL = "sixel"
    ITERM = "iterm"


def way_of(environment: Mapping[str, str]) -> Pictures:
    """Return how the terminal of an environment shows pictures, as far as its variables say; `AUTO`: they do not."""
    program, term = environment.get("TERM_PROGRAM", ""), environment.get("TERM", "")
    if term in ("", "dumb") or environment.get("TMUX") or term.startswith(("screen", "tmux")):
        return Pictures.NONE  # a multiplexer passes no pictures on by itself
    if environment.get("KITTY_WINDOW_ID") or term == "xterm-kitty" or program in ("ghostty", "WezTerm"):
        return Pictures.KITTY
    if program in ("iTerm.app", "mintty") or environment.get("LC_TERMINAL") == "iTerm2":
        return Pictures.ITERM
    if term.startswith(("foot", "mlterm", "yaft")) or "sixel" in term:
        return Pictures.SIXEL
    return Pictures.AUTO


def detect(environment: Mapping[str, str] | None = None) -> Pictures:
    """Return how standard output shows pictures: from the environment, else by asking the terminal; `NONE` if not."""
    if not (sys.stdout.isatty() and sys.stdin.isatty()):
        return Pictures.NONE
    way = way_of(os.environ if environment is None else environment)
    return (Pictures.SIXEL if _says_sixel(_asked("\x1b[c")) else Pictures.NONE) if way is Pictures.AUTO else way


def _says_sixel(answer: str) -> bool:
    """Say whether a terminal's answer to the question for its attributes (DA1) has a 4: sixel graphics."""
    found = re.search(r"\x1b\[\?([0-9;]+)c", answer)
    return found is not None and "4" in found.group(1).split(";")[1:]


def _asked(question: str) -> str:
    """Ask the terminal, and return what it answers within `ASKS_S`; what is typed meanwhile is lost."""
    try:
        import select
        import termios
        import tty
    except ImportError:  # no such terminal on this system
        return ""
    keyboard = sys.stdin.fileno()
    try:
        before = termios.tcgetattr(keyboard)
    except termios.error:
        return ""
    answer = b""
    try:
        tty.setcbreak(keyboard, termios.TCSANOW)
        stream = getattr(sys.stdout, "trusted", sys.stdout)  # the command line's writes out control codes
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
    """Return what to write to a terminal so that it shows a picture.

    Args:
        png: the picture as a file. way: not `AUTO` or `NONE`.

    Raises:
        ForeseeError: pillow, which sixels are made with, is not installed.
    """
    if way is Pictures.KITTY:
        return "".join(_kitty(png))
    if way is Pictures.ITERM:
        data = base64.b64encode(png).decode("ascii")
        width = int.from_bytes(png[16:20], "big")  # of the header, which begins each PNG
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
    """Return a picture as sixels: for each band of six rows, and each colour in it, a run of signs."""
    from PIL.Image import Quantize

    # Median cut, the default, would make a small red opponent brown.
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
    """Return a row of sixels with repeats counted."""
    edges = np.flatnonzero(np.diff(bits)) + 1
    starts = [0, *edges.tolist()]
    lengths = np.diff([*starts, len(bits)]).tolist()
    signs = [chr(63 + int(bits[start])) for start in starts]
    return "".join(f"!{n}{sign}" if n > 3 else sign * n for n, sign in zip(lengths, signs, strict=True))
