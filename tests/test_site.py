"""The documentation as a site: built strictly, so that no link leads nowhere and no page is left out."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import CHROMIUM, browser


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
    assert "report-page.png" in first and "strip.svg" in first
    if CHROMIUM is not None:
        with browser() as opened:
            _search_from_a_folder(opened.new_page(viewport={"width": 1440, "height": 900}), tmp_path / "site")


def _search_from_a_folder(page: Any, site: Path) -> None:
    """As `make docs` says: the file is opened, no server."""
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("requestfailed", lambda request: problems.append(request.url))
    for name in ("index.html", "decisions/0001-one-scene-for-seeds-clips-and-mutants.html"):
        page.goto((site / name).as_uri())
        code = page.locator("article pre code")
        if code.count():  # nothing of the first block is cut
            assert code.first.evaluate("(block) => block.scrollWidth <= block.clientWidth")
        page.locator("input[name=query]").click()
        page.locator("input[name=query]").press_sequentially("roundabout")
        page.locator(".md-search-result__item a").first.wait_for()
        assert page.locator(".md-search-result__item").count() > 2
    assert not problems
