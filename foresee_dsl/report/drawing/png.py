"""Converts SVG pictures to PNG with resvg (the extra `pictures`)."""

from __future__ import annotations

import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from foresee_dsl.errors import ForeseeError

MISSING = "this picture needs the package {}: pip install 'foresee-dsl[pictures]'"
"""Message without a package; `format` puts its name in."""
_FONTS = ("/usr/share/fonts", "/usr/local/share/fonts", "~/.fonts", "~/.local/share/fonts")
"""Folders in which resvg looks for fonts on Linux (resvg-py 0.5.0)."""


def png_of_svg(svg: str, *, zoom: float = 2.0) -> bytes:
    """Return an SVG document as a PNG, enlarged by the factor `zoom`.

    Raises: ForeseeError: resvg-py is not installed, or the system has no font for the names in the picture.
    """
    try:
        import resvg_py
    except ImportError as err:
        raise ForeseeError(MISSING.format("resvg-py")) from err
    return bytes(resvg_py.svg_to_bytes(svg_string=svg, zoom=zoom, font_files=list(_own_fonts())))


@cache
def _own_fonts() -> tuple[str, ...]:
    """Return font files of matplotlib if the system has no fonts, otherwise none.

    Raises:
        ForeseeError: matplotlib is not installed either; without a font resvg-py 0.5.0 leaves out every text without an
            error.
    """
    folders = [Path(folder).expanduser() for folder in _FONTS]
    if not sys.platform.startswith("linux") or any(next(f.rglob("*.[to]tf"), None) for f in folders if f.is_dir()):
        return ()
    if find_spec("matplotlib") is None:
        raise ForeseeError("this picture needs a font for its names, and this system has none: install one, such as "
                           "`apt-get install fonts-dejavu-core`, or matplotlib, which brings one")  # fmt: skip
    import matplotlib as mpl

    fonts = Path(mpl.get_data_path()) / "fonts" / "ttf"
    return tuple(str(fonts / name) for name in ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf"))
