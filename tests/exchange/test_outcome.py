"""What an import or export writes: all files or none, and none over a file with other content."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.exchange.outcome import ExchangeError, write_together


def _written(out: Path, **texts: str) -> tuple[Path, ...]:
    def write(folder: Path) -> None:
        for name, text in texts.items():
            (folder / name).write_text(text)

    return write_together(out, write)


def test_files_with_other_content_are_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for _ in range(2):  # the same content is no error
        assert _written(out, town="one", roads="two") == (out / "roads", out / "town")
    (out / "town").write_text("edited")
    with pytest.raises(ExchangeError, match=r"nothing was written: .*out/town is there already .* give another --out"):
        _written(out, town="one", roads="two", lanes="four")
    assert {file.name: file.read_text() for file in out.iterdir()} == {"town": "edited", "roads": "two"}


def test_a_folder_of_the_files_name_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "town").mkdir()
    with pytest.raises(ExchangeError, match="town is there already"):
        _written(tmp_path, town="one")
    assert [file.name for file in tmp_path.iterdir()] == ["town"]
