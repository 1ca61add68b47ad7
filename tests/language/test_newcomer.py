"""What a newcomer sees for the mistakes that one makes in the first hours: `tests/cases/language/newcomer`."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from foresee_dsl.compile import with_placements
from foresee_dsl.errors import InputError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.messages.diagnostics import render_all
from tests.support.goldens import Golden

FOLDER = Path(__file__).parents[1] / "cases" / "language" / "newcomer"
BASE = (FOLDER / "base.foresee").read_text(encoding="utf-8")


def mistakes() -> dict[str, str]:
    """Return the texts with a mistake each, by its name."""
    texts = {}
    for part in (FOLDER / "mistakes.txt").read_text(encoding="utf-8").split("=== ")[1:]:
        name, *lines = part.rstrip().split("\n")
        text, at = BASE, 0
        for line in lines:
            sign, written = line[:1], line[2:]
            if sign == "-":
                begin = re.search(rf"^ *{re.escape(written)}$", text[at:], re.MULTILINE)
                assert begin is not None, f"{name}: base.foresee has no line `{written}`"
                indent = len(begin[0]) - len(written)
                at, end = at + begin.start() + indent, at + begin.end()
                text = text[:at] + text[end:]
            elif sign == "+":
                text = text[:at] + written + text[at:]
                at += len(written)
        texts[name] = text
    return texts


TEXTS = mistakes()


def shown(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return what `foresee check first.foresee` says."""
    monkeypatch.chdir(folder)
    Path("first.foresee").write_text(text, encoding="utf-8")
    result = check_paths(["first.foresee"])
    return render_all(with_placements(result.diagnostics, result.cases))


def test_without_a_mistake_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not shown(BASE, tmp_path, monkeypatch)


def test_what_is_said_of_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, golden: Golden) -> None:
    said = [f"=== {name}\n{shown(text, tmp_path, monkeypatch)}\n" for name, text in TEXTS.items()]
    golden("\n".join(said), FOLDER / "messages.txt")


def test_a_pipe_is_not_answered_with_its_own_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe.foresee")
    Path("link.foresee").symlink_to("nowhere.foresee")
    for name, reason in (
        ("pipe.foresee", "not an ordinary file"),
        ("link.foresee", "target of this link does not exist"),
    ):
        with pytest.raises(InputError) as caught:
            check_paths([name])
        (found,) = caught.value.diagnostics
        assert reason in found.message and "did you mean" not in found.help


def test_each_is_one_mistake_and_is_said_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(TEXTS) >= 60
    for name, text in TEXTS.items():
        found = re.findall(r"(?:error|warning) (FS\d+)", shown(text, tmp_path, monkeypatch))
        wanted = re.search(r"\((\d) messages\)", name)
        assert len(found) == (int(wanted[1]) if wanted else 1), f"{name}: {found}"
