"""Golden layouts: `tests/cases/language/fmt/NAME.foresee` has an input, a line `# output`, and what `fmt` makes of it.

`pytest --rewrite-goldens` writes the outputs again. Also: the command `fmt` on real files.
"""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from foresee_dsl.language.parser import format_text, parse
from tests.support.command import program
from tests.support.goldens import Golden
from tests.support.layouts import moved

ROOT = Path(__file__).parents[2]
GOLDENS = sorted((ROOT / "tests" / "cases" / "language" / "fmt").glob("*.foresee"))
MARK = "# output\n"
UGLY = "foresee 1\nnetwork n{junction a at(0 m,0 m)\n  junction b at (9 m, 0 m) # end\n}\n"
GOOD = "foresee 1\n\nnetwork n {\n  junction a at (0 m, 0 m)\n  junction b at (9 m, 0 m)  # end\n}\n"
BROKEN = "foresee 1\nnetwork n {\n  junction a at (0 kmh, 0 m)\n  rode b\n}\n"


def test_there_are_enough_goldens():
    assert len(GOLDENS) >= 20


@pytest.mark.parametrize("file", GOLDENS, ids=lambda file: file.stem)
def test_golden(file: Path, golden: Golden):
    given, _, _ = file.read_text(encoding="utf-8").partition(MARK)
    result = format_text(given, file.name)
    golden(f"{given}{MARK}{result}", file)
    assert format_text(result, file.name) == result
    assert parse(result, file.name).model == parse(given, file.name).model


@pytest.mark.parametrize("newline", ["\r\n", "\r"])
def test_kinds_of_newlines_and_a_byte_order_mark(newline: str):
    assert format_text(UGLY.replace("\n", newline), "x") == GOOD
    assert format_text("\ufeff" + UGLY, "x") == GOOD


def test_a_comment_is_never_lost_from_a_brace_of_an_empty_block():
    text = 'foresee 1\n\nmutant h of "e" pin sha256:c347e6a70b92 {\n}  # c\n'
    assert format_text(text, "x") == text


def test_the_reading_of_layouts_sees_what_moves():
    """The oracle of the property tests is no rubber stamp."""
    before = "foresee 1\n\nnetwork n {\n  # a\n  junction a at (0 m, 0 m)\n\n  junction b at (9 m, 0 m)  # b\n}\n"
    assert not moved(before, before)
    assert moved(before, before.replace("  # a\n", ""))
    assert moved(before, before.replace("  # b", "").replace("(0 m, 0 m)", "(0 m, 0 m)  # b"))
    assert moved(before, before.replace("(0 m, 0 m)\n\n", "(0 m, 0 m)\n"))
    assert moved(before, before.replace("  # a\n", "").replace("m)\n\n", "m)\n\n  # a\n"))


# ---- the command -----------------------------------------------------------------------------------------------------


def fmt(*arguments: str | Path, given: bytes | None = None, expect: int = 0) -> subprocess.CompletedProcess[bytes]:
    done = subprocess.run(
        [program(), "fmt", *map(str, arguments)],
        input=given,
        capture_output=True,
        check=False,
    )
    assert done.returncode == expect, done
    assert b"Traceback" not in done.stderr
    return done


def test_good_files_are_formatted_although_others_have_mistakes(tmp_path: Path):
    for name, text in (("a", BROKEN), ("b", UGLY), ("c", BROKEN), ("d", GOOD)):
        (tmp_path / f"{name}.foresee").write_text(text, encoding="utf-8")
    done = fmt(tmp_path, tmp_path / "missing.foresee", expect=1)
    assert done.stdout.decode() == f"formatted {tmp_path / 'b.foresee'}\n"
    said = done.stderr.decode()
    assert said.count("FS005") == 2 and said.count("FS004") == 2 and "missing.foresee" in said
    texts = [(tmp_path / f"{name}.foresee").read_text(encoding="utf-8") for name in "abcd"]
    assert texts == [BROKEN, GOOD, BROKEN, GOOD]


def test_check_and_diff_write_nothing(tmp_path: Path):
    file = tmp_path / "a.foresee"
    file.write_text(UGLY, encoding="utf-8")
    before = file.stat()
    assert fmt("--check", file, expect=1).stdout.decode() == f"would change {file}\n"
    shown = fmt("--diff", file, expect=1).stdout.decode()
    assert "-network n{junction a at(0 m,0 m)\n" in shown
    assert "+  junction a at (0 m, 0 m)\n" in shown
    assert "\x1b" not in shown
    assert file.read_text(encoding="utf-8") == UGLY
    assert file.stat().st_mtime_ns == before.st_mtime_ns
    assert sorted(tmp_path.iterdir()) == [file]


def test_a_formatted_file_is_as_it_should_be(tmp_path: Path):
    file = tmp_path / "a.foresee"
    file.write_text(UGLY, encoding="utf-8")
    fmt(file)
    for options in ([], ["--check"], ["--diff"]):
        assert fmt(*options, file).stdout == b"1 file is formatted already\n"


def test_newlines_of_a_file_are_kept_and_a_byte_order_mark_goes(tmp_path: Path):
    file = tmp_path / "a.foresee"
    file.write_bytes(b"\xef\xbb\xbf" + UGLY.replace("\n", "\r\n").encode())
    fmt(file)
    assert file.read_bytes() == GOOD.replace("\n", "\r\n").encode()
    fmt("--check", file)


def test_a_file_keeps_its_mode_and_a_link_stays_one(tmp_path: Path):
    target, link = tmp_path / "shared" / "a.foresee", tmp_path / "b.foresee"
    target.parent.mkdir()
    target.write_text(UGLY, encoding="utf-8")
    target.chmod(0o640)
    link.symlink_to(target)
    fmt(link)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == GOOD
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert sorted(path.name for path in target.parent.iterdir()) == ["a.foresee"]


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everything")
def test_a_file_that_may_not_be_written_is_left_alone(tmp_path: Path):
    files = [tmp_path / "a.foresee", tmp_path / "b.foresee"]
    for file in files:
        file.write_text(UGLY, encoding="utf-8")
    files[0].chmod(0o444)
    assert b"cannot be written: permission denied" in fmt(tmp_path, expect=1).stderr
    assert [file.read_text(encoding="utf-8") for file in files] == [UGLY, GOOD]


def test_standard_input(tmp_path: Path):
    assert fmt("-", given=UGLY.encode()).stdout.decode() == GOOD
    assert fmt("-", given=UGLY.replace("\n", "\r\n").encode()).stdout.decode() == GOOD.replace("\n", "\r\n")
    assert fmt("--check", "-", given=UGLY.encode(), expect=1).stdout == b"would change <stdin>\n"
    assert b"+  junction a at (0 m, 0 m)\n" in fmt("--diff", "-", given=UGLY.encode(), expect=1).stdout
    assert fmt("-", given=BROKEN.encode(), expect=1).stdout == b""
    assert b"not UTF-8" in fmt("-", given=b"\xff\xfe", expect=1).stderr
    assert b"cannot be combined with other paths" in fmt("-", tmp_path, given=b"", expect=2).stderr


def test_a_file_without_a_last_newline_can_be_shown(tmp_path: Path):
    file = tmp_path / "a.foresee"
    file.write_text(GOOD.rstrip("\n"), encoding="utf-8")
    assert b"-}\n\\ No newline at end of file\n+}\n" in fmt("--diff", file, expect=1).stdout


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_a_diff_is_coloured_on_a_terminal(tmp_path: Path):
    import pty

    file = tmp_path / "a.foresee"
    file.write_text(UGLY, encoding="utf-8")
    for given, coloured in (({}, True), ({"NO_COLOR": "1"}, False)):
        ours, theirs = pty.openpty()
        environment = {key: value for key, value in os.environ.items() if key != "NO_COLOR"} | given
        command = [Path(sys.executable).parent / "foresee", "fmt", "--diff", file]
        subprocess.run(command, stdout=theirs, env=environment, check=False)
        os.close(theirs)
        shown = os.read(ours, 10_000).decode()
        os.close(ours)
        assert ("\x1b[32m+  junction a" in shown) == coloured
