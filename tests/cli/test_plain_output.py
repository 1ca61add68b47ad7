"""Names and texts from files cannot steer the terminal that they are printed on."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from foresee_dsl.cli.options.plain_output import PlainStream, harmless_console, plain
from foresee_dsl.language.lints.lint import hidden_characters

FORESEE = Path(sys.executable).parent / "foresee"
EVIL = "\x1b]0;owned\x07\x1b[2J\u202egnp\u2066"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_control_codes_and_signs_of_direction_are_written_out() -> None:
    assert plain("a\x1b[31mb\u202ec\x9bd\u200be\tf\n") == "a\\x1b[31mb\\u202ec\\x9bd\\u200be\tf\n"
    assert plain("Größe 車 é") == "Größe 車 é"


def test_only_colours_pass_to_a_terminal_and_nothing_elsewhere() -> None:
    text = "\x1b[31mred\x1b[0m \x1b[2J\x1b]0;title\x07 \u202e"
    terminal, file = Terminal(), io.StringIO()
    PlainStream(terminal).write(text)
    PlainStream(file).write(text)
    assert terminal.getvalue() == "\x1b[31mred\x1b[0m \\x1b[2J\\x1b]0;title\\x07 \\u202e"
    assert "\x1b" not in file.getvalue()


def test_a_console_keeps_its_own_colours_and_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", PlainStream(terminal))
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    harmless_console(force_terminal=True).print(f"[red]{EVIL}", highlight=False)
    shown = terminal.getvalue()
    assert "\x1b[31m" in shown and "\\x1b]0;owned\\x1b[2J\\u202egnp\\u2066" in shown  # rich itself drops the bell


def test_a_file_with_an_evil_name_and_text_is_shown_harmless(tmp_path: Path) -> None:
    name = EVIL.replace("/", "") + ".foresee"
    (tmp_path / name).write_text(f'foresee 1\n\nscenario x {{ doc "{EVIL}" }}\n', encoding="utf-8")
    for command in (["check", "--format", "concise", "."], ["run", name]):
        done = subprocess.run(
            [FORESEE, *command], cwd=tmp_path, capture_output=True, check=False, env={**os.environ, "NO_COLOR": "1"}
        )
        shown = (done.stdout + done.stderr).decode()
        assert done.returncode == 1 and shown
        assert not set(shown) & set("\x1b\x07\u202e\u2066"), command


def test_hidden_characters_in_a_text_are_warned_of() -> None:
    (found,) = hidden_characters("foresee 1\n# a\u202eb\u202c\n", "x.foresee")
    assert (found.code, found.span.line if found.span else 0, found.severity) == ("FS313", 2, "warning")
    assert "U+202E (right-to-left override)" in found.message
    assert not list(hidden_characters("\ufefforesee 1\n# größer\r\n\t", "x.foresee"))


def test_a_reader_that_has_gone_is_no_finding(tmp_path: Path) -> None:
    """`foresee show X | head -1`: 141, as of a program that SIGPIPE ends, for short, long and coloured output."""
    (tmp_path / "wrong.foresee").write_text("foresee 1\n\nscenario s {\n  end after 5 kmh\n}\n")
    long = {"PYTHONUNBUFFERED": "1"}
    for command, more in (
        (("drivers",), {}),
        (("explain", "FS012"), {"FORCE_COLOR": "1"}),
        (("--help",), {}),
        (("doctor",), long),
        (("check", "wrong.foresee"), {}),
        (("check", "--format", "json", "wrong.foresee"), long),
        (("nonsense",), {}),
    ):
        read, write = os.pipe()
        os.close(read)
        done = subprocess.Popen(
            [FORESEE, *command], stdout=write, stderr=write, cwd=tmp_path, env={**os.environ, **more}
        )
        os.close(write)
        assert done.wait() == 141, command


def test_a_reader_that_takes_all_leaves_the_exit_code(tmp_path: Path) -> None:
    (tmp_path / "wrong.foresee").write_text("foresee 1\n\nscenario s {\n  end after 5 kmh\n}\n")
    line = f"set -o pipefail; {FORESEE} check wrong.foresee 2>&1 | cat > all"
    assert subprocess.run(["bash", "-c", line], cwd=tmp_path, check=False).returncode == 1
    assert "1 error" in (tmp_path / "all").read_text()
