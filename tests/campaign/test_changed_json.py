"""People may edit `campaign.json`: what was changed in it is an error in words, never a fault of ours."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foresee_dsl.campaign.findings.named_failure import find_failure
from foresee_dsl.campaign.findings.review import review_of
from foresee_dsl.campaign.regression.compared_sides import side_of_campaign
from foresee_dsl.documents import plain
from foresee_dsl.errors import ForeseeError
from foresee_dsl.report.page.contents import contents_of
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.report.terminal.review import review_text
from tests.support.command import foresee
from tests.support.small_campaign import finished, write_project

Place = tuple[str | int, ...]


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign with one finding."""
    folder = tmp_path_factory.mktemp("changed")
    finished(write_project(folder / "project"), folder / "out")
    return folder / "out"


def places(value: Any, at: Place = ()) -> Iterator[Place]:
    """Yield the place of each value; of lists, only of their first element."""
    if at:
        yield at
    inner = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, part in inner:
        yield from places(part, (*at, key))


def test_no_change_of_one_value_is_a_fault_of_ours(out: Path) -> None:
    """Each value of the file is replaced by one of another type in turn, or is left out."""
    file = out / "campaign.json"
    whole = file.read_text()
    name = json.loads(whole)["findings"][0]["name"]

    def review() -> None:
        found = review_of(find_failure(name, out))
        assert review_text(found) and json.dumps(plain(found))

    readers: tuple[Callable[[], object], ...] = (
        review,
        lambda: side_of_campaign(out),
        lambda: contents_of((out,), Reader(plays=False)),
    )
    try:
        for read in readers:
            read()
        for number, place in enumerate(places(json.loads(whole))):
            data = json.loads(whole)
            holder = data
            for key in place[:-1]:
                holder = holder[key]
            new = (7, "x", None, [], {})[number % 5]
            if number % 6 == 5:
                del holder[place[-1]]
            else:
                holder[place[-1]] = new
            file.write_text(json.dumps(data))
            try:
                readers[number % 3]()
            except ForeseeError as err:
                assert str(file) in str(err) or name in str(err)
    finally:
        file.write_text(whole)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data["findings"][0].pop("verdict"), "lacks 'verdict'"),
        (lambda data: data["clip_runs"][0].update(children=3), "clip_runs.0.children: Input should be a valid list"),
        (lambda data: data["settings"].update(seed="two"), "settings.seed: Input should be a valid integer"),
    ],
)
def test_review_says_what_was_changed(out: Path, change: Callable[[Any], object], said: str) -> None:
    file = out / "campaign.json"
    whole = file.read_text()
    data = json.loads(whole)
    change(data)
    try:
        file.write_text(json.dumps(data))
        done = foresee("review", data["findings"][0]["name"], "--campaign", out, expect=1)
    finally:
        file.write_text(whole)
    assert said in " ".join(done.stderr.split()) and "run the campaign again" in " ".join(done.stderr.split())
