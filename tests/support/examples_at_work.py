"""Runs the examples of codes as they are printed: writes the folder, runs the command, and returns its messages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foresee_dsl.campaign.campaign_file import mistakes_of
from foresee_dsl.compile import with_placements
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.exchange.sketch import network_of_sketch
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.codes import Code
from foresee_dsl.language.diff.addresses import compare_addresses
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.project.loading import load_catalogue, load_test_case
from tests.support.code_frames import example


def found_in(code: Code, text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Diagnostic, ...]:
    """Return every diagnostic of one of a code's examples."""
    shown = example(code, text)
    folder.mkdir()
    monkeypatch.chdir(folder)
    for name, content in shown.files.items():
        Path(name).write_text(content, encoding="utf-8")
    pin_by_hand(*sorted(shown.files, key=lambda name: (not name.endswith("clip.foresee"), name)))
    try:
        return _do(*shown.command)
    except InputError as error:
        return error.diagnostics


def _do(command: str, *words: str) -> tuple[Diagnostic, ...]:
    options, paths = [w for w in words if w.startswith("-")], [w for w in words if not w.startswith("-")]
    if command == "check":
        result = check_paths(paths, allow_outside="--no-outside" not in options)
        named = tuple(mistake for document in result.campaigns for mistake in mistakes_of(document))
        if named:
            return named
        if "--no-places" in options:
            return result.diagnostics
        return with_placements(result.diagnostics, result.cases)
    if command == "run":
        load_test_case(*paths)
    elif command == "diff":
        compare_addresses(*paths)
    elif command == "models":
        load_catalogue(Path(*paths))
    elif command == "init":
        network_of_sketch(Path(words[-1]).read_text(encoding="utf-8"), "sketch", words[-1])
    else:
        raise AssertionError(command)
    return ()


def pin_by_hand(*names: str) -> None:
    """Write the parent's pin where a file says `PIN`; parents are named first."""
    for file in map(Path, names):
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        parent = re.search(r'of "([^"]+)" pin PIN', text)
        if parent is not None:
            file.write_text(text.replace("PIN", pin_of(load_test_case(parent[1]))), encoding="utf-8")
