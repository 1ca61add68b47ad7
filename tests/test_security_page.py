"""Limits of XML from outside, texts that pass unchanged, and every test that docs/guide/security.md names."""

from __future__ import annotations

import gzip
import re
import subprocess
from pathlib import Path

import pytest

from foresee_dsl.compile.nets import safe_xml
from foresee_dsl.errors import CompileError
from tests.support.command import program

ROOT = Path(__file__).parent.parent


def test_xml_has_at_most_so_many_bytes_elements_and_levels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(text: str, name: str = "x.xml") -> str:
        data = text.encode()
        (tmp_path / name).write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
        with pytest.raises(CompileError) as caught:
            safe_xml.parse_net(tmp_path / name)
        return str(caught.value)

    depth = safe_xml.DEEPEST + 1
    assert "more than 100 elements in each other" in refused("<net>" + "<a>" * depth + "</a>" * depth + "</net>")
    monkeypatch.setattr(safe_xml, "MOST_ELEMENTS", 1000)
    assert "1,000" in refused("<net>" + "<a/>" * 1001 + "</net>")
    monkeypatch.setenv("FORESEE_LIMITS", "file=0.1")
    long = "<net>" + " " * 150_000 + "</net>"
    assert "more than the 0.1 MB that are read" in refused(long)
    assert "when it is unpacked" in refused(long, "x.net.xml.gz")


def test_what_programs_read_from_standard_output_is_the_files_text(tmp_path: Path) -> None:
    ego = 'ego: car.sedan {\n    route ["\u2066"]\n  }'
    text = f"foresee 1\n\n# a\u202eb\u202c \x7f Größe\nscenario x {{\n  {ego}\n}}\n".encode()
    (tmp_path / "x.foresee").write_bytes(text)
    for command in (["fmt", "-"], ["textconv", "x.foresee"]):
        done = subprocess.run([program(), *command], cwd=tmp_path, input=text, capture_output=True, check=False)
        assert "\u2066".encode() in done.stdout and b"\\u2066" not in done.stdout, command
    assert subprocess.run([program(), "fmt", "-"], input=text, capture_output=True, check=True).stdout == text


def test_the_tests_that_the_page_names_are_there() -> None:
    page = (ROOT / "docs" / "guide" / "security.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", page)
    assert len(named) >= 20
    for file, name in named:
        assert re.search(rf"^def {name}\(", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE), (file, name)
    sections = re.findall(r"^## (.+)$", page, re.MULTILINE)
    rows = {row.split("|")[1].strip() for row in page.splitlines() if "`tests/" in row}
    assert set(sections) - {"Where each is tested"} <= rows
