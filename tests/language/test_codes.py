"""Every code is explained, and its examples do what they say: the wrong one earns it, the right one earns nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foresee_dsl.language.codes import NEED_THE_NETWORK, Code, every_code
from tests.support.code_frames import FRAMES
from tests.support.examples_at_work import found_in

CODES = every_code()
NO_EXAMPLE = {"FS001", "FS020", "FS134"}
"""A matter of the disk; our own fault; 33 files. `test_diagnostics` and `test_project` earn the first and the last."""
SOURCES = Path(__file__).parents[2] / "foresee_dsl"
EXAMPLES = [code for code in CODES.values() if code.wrong]


@pytest.mark.parametrize("code", EXAMPLES, ids=lambda code: code.code)
def test_the_wrong_example_earns_its_code_and_no_other(code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    found = found_in(code, code.wrong, tmp_path / "wrong", monkeypatch)
    assert {d.code for d in found} == {code.code}, found
    assert {d.severity for d in found} == {code.severity}
    for diagnostic in found:
        assert diagnostic.help, "say what to write instead"


@pytest.mark.parametrize("code", EXAMPLES, ids=lambda code: code.code)
def test_the_right_example_is_right(code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert found_in(code, code.right, tmp_path / "right", monkeypatch) == ()


def test_every_code_has_examples():
    assert {code.code for code in CODES.values() if not (code.wrong and code.right)} == NO_EXAMPLE


def test_every_code_is_explained():
    assert list(CODES) == sorted(CODES)
    for name, code in CODES.items():
        assert name == code.code
        assert re.fullmatch("FS[0-9]{3}", name)
        assert code.title[0].islower() or code.title.startswith("`"), name
        assert not code.title.endswith("."), name
        assert code.explanation.endswith((".", "?")), name
        assert code.severity in ("error", "warning")
        assert code.frame in FRAMES


def test_every_code_is_produced_somewhere_and_every_produced_code_is_explained():
    texts = {path: path.read_text(encoding="utf-8") for path in SOURCES.rglob("*.py")}
    mentioned = {code for text in texts.values() for code in re.findall(r'"(FS[0-9]{3})"', text)}
    assert mentioned - set(CODES) == set()
    assert set(CODES) - mentioned == set()


def test_the_codes_that_need_the_network_are_those_that_the_compiler_reports():
    texts = (path.read_text(encoding="utf-8") for path in (SOURCES / "compile").rglob("*.py"))
    reported = {code for text in texts for code in re.findall(r'"(FS[0-9]{3})"', text)}
    lints_that_it_replaces = {"FS308", "FS309"}
    also_of_the_text_alone = {"FS270"}
    assert reported - lints_that_it_replaces - also_of_the_text_alone == {
        code for code in CODES if code.startswith(NEED_THE_NETWORK)
    }
