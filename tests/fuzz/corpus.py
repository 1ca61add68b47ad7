"""The real files that inputs are made of."""

from __future__ import annotations

import functools
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
CASES = ROOT / "tests" / "cases" / "language"

_SNIPPET = re.compile(r"^```foresee\n(.*?)^```", re.MULTILINE | re.DOTALL)


@functools.cache
def corpus() -> tuple[bytes, ...]:
    """Return every `.foresee` file of the repository's scenarios and test cases, and the snippets of its pages."""
    files = [*sorted(SCENARIOS.rglob("*.foresee")), *sorted(CASES.rglob("*.foresee"))]
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    snippets = [found for page in pages for found in _SNIPPET.findall(page.read_text(encoding="utf-8"))]
    return tuple(file.read_bytes() for file in files) + tuple(snippet.encode() for snippet in snippets)


@functools.cache
def texts() -> tuple[str, ...]:
    """Return the corpus as text."""
    return tuple(content.decode("utf-8", errors="replace") for content in corpus())
