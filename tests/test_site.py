"""The documentation as a site: built strictly, so that no link leads nowhere and no page is left out."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest


@pytest.mark.skipif(find_spec("material") is None, reason="mkdocs-material is not installed: pip install -e '.[docs]'")
def test_the_site_is_built_and_loads_nothing_from_elsewhere(root: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", tmp_path / "site"]
    settings = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False, env=settings)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {
        page.relative_to(tmp_path / "site").with_suffix("").as_posix() for page in (tmp_path / "site").rglob("*.html")
    }
    written = {page.relative_to(root / "docs").with_suffix("").as_posix() for page in (root / "docs").rglob("*.md")}
    assert {page.replace("README", "index") for page in written} <= pages
    first = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    loaded = re.findall(r'<(?:script|img|link rel="stylesheet")[^>]* (?:src|href)="([^"]+)"', first)
    assert loaded and not [address for address in loaded if address.startswith(("http", "//"))]
