"""Decisions about findings, and what changed since the campaign before: in the file, and where findings are shown."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lxml import html

from foresee_dsl.campaign.folder import as_text, campaign_document
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.triage.decisions import (
    FILE,
    Decision,
    Triage,
    decide,
    read_decisions,
    triage_file,
)
from foresee_dsl.campaign.triage.history import FILE as HISTORY
from foresee_dsl.campaign.triage.history import CampaignChange, PastCampaign, PastFinding
from foresee_dsl.errors import ForeseeError
from foresee_dsl.report.history import history_table
from tests.support import command
from tests.support.first_project import checked
from tests.support.first_project import foresee as run_here
from tests.support.small_campaign import SMALL, TEXT, copy_runs

WINDOW = (*SMALL, "--driver", "idm", "--before", "3", "--after", "3", "--risky-points", "1", "--jobs", "1")
SHORT = (*WINDOW, "--children", "3")
PAST = PastCampaign("2026-01-01", "0", "pdm", "foresee", "focused", 0, (), ())


def decision(story: str, note: str = "issue 12", kind: Triage = Triage.KNOWN) -> Decision:
    return Decision(story, kind, note)


def test_one_line_a_story_sorted_and_all_other_lines_stay(tmp_path: Path) -> None:
    file = tmp_path / FILE
    for story in ("b", "c", "a"):
        decide(file, story, decision(story))
    text = file.read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines == [f'"{story}" = {{ triage = "known", note = "issue 12" }}' for story in "abc"]
    file.write_text(text.replace('"b"', '# buses\n"b"'))
    decide(file, "b", decision("b", 'a "quoted" ä', Triage.NOT_OURS))
    after = file.read_text()
    assert set(after.splitlines()) - set(text.splitlines()) == {
        "# buses", '"b" = { triage = "not-ours", note = "a \\"quoted\\" ä" }'
    }  # fmt: skip
    assert read_decisions(file)["b"].note == 'a "quoted" ä'
    decide(file, "a", None)
    assert list(read_decisions(file)) == ["b", "c"] and "# buses" in file.read_text()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('"s" = { triage = "know", note = "x" }', "'know' is not a kind of triage: did you mean 'known'?"),
        ('"s" = { triage = "known" }', "lacks its 'note'"),
        ('"s" = { triage = "known", note = " " }', "lacks its 'note'"),
        ('"s" = { triage = "known", note = "x", notes = "y" }', "an entry has no 'notes'"),
        ('"s" = "known"', "this is not an entry"),
        ('"s" = {', "this is not an entry"),
        ("[s]", "lacks its 'triage'"),
        ('"first" = { triage = "known", note = "x" }', "has another entry in line 1: remove one"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, line: str, words: str) -> None:
    file = tmp_path / FILE
    file.write_text(f"{decision('first').entry}\n\n{line}\n")
    with pytest.raises(ForeseeError) as raised:
        read_decisions(file)
    assert f"{file}:3: " in str(raised.value) and words in str(raised.value)


def test_git_joins_two_versions(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        subprocess.run(("git", "-c", "user.name=a", "-c", "user.email=a@b", *words), cwd=tmp_path, check=True,
                       capture_output=True)  # fmt: skip

    file = tmp_path / FILE
    git("init", "-q", "-b", "main")
    (tmp_path / ".gitattributes").write_text("triage.toml merge=union\n")
    decide(file, "m", decision("m"))
    git("add", ".")
    git("commit", "-qm", "first")
    for branch, story in (("one", "x"), ("two", "y")):
        git("checkout", "-qb", branch, "main")
        decide(file, story, decision(story))
        git("commit", "-qam", story)
    git("merge", "-q", "one")
    assert set(read_decisions(file)) == {"m", "x", "y"}


def foresee(project: Path, *words: object, expect: int | None = 0) -> str:
    done = command.foresee(*words, cwd=project, env={"COLUMNS": "160"}, expect=expect)
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with a campaign; in the next one the other car comes from the other side."""
    project = tmp_path_factory.mktemp("project")
    (project / ".gitattributes").write_text("")
    (project / "crosser.foresee").write_text(TEXT)
    copy_runs(project / "out")
    first = foresee(project, "campaign", "crosser.foresee", *SHORT, expect=1)
    assert "Since the last campaign" not in first
    return project


def changed(project: Path) -> tuple[dict[str, Any], str]:
    """Edit the scenario, and return the second campaign's JSON and what the terminal shows."""
    edited = TEXT.replace("from south to middle", "from north to middle").replace("middle to north", "middle to south")
    (project / "crosser.foresee").write_text(edited)
    screen = foresee(project, "campaign", "crosser.foresee", *SHORT, expect=None)
    return json.loads((project / "out" / "campaign.json").read_text()), screen


def test_what_is_new_still_there_triaged_and_gone_is_told_everywhere(project: Path) -> None:
    before = json.loads((project / "out" / "campaign.json").read_text())
    old = {finding["story"]: finding for finding in before["findings"]}
    assert old, "the project has findings"
    name = next(iter(old.values()))["name"]
    said = foresee(project, "triage", name, "accepted", "--note", "crossing without sight")
    assert "triaged as accepted: crossing without sight" in said and (project / FILE).is_file()
    assert "triaged" not in (project / "out" / "campaign.json").read_text()
    assert "1 triaged (1 accepted)" in foresee(project, "campaign", "crosser.foresee", *SHORT, expect=1)
    again = (project / "out" / HISTORY).read_text()
    assert again.count("\n") == 1, "the same results are not listed twice"

    after, screen = changed(project)
    new = {finding["story"]: finding for finding in after["findings"]}
    fresh, gone = new.keys() - old.keys(), old.keys() - new.keys()
    assert fresh and gone, "the edit changes what is found"
    counts = f"{len(fresh)} new, {len(new.keys() & old.keys())} still there, {len(gone)} gone"
    assert f"Since the last campaign: {counts}" in screen
    report = checked(foresee(project, "report", "out", "--format", "json"))
    for finding in report["findings"]:
        story = next(key for key, value in new.items() if value["name"] == finding["name"])
        assert finding["since"] == ("new" if story in fresh else "still there")
        assert (finding["triage"] is not None) == (f"idm | {story}" in read_decisions(project / FILE))
        review = foresee(project, "review", finding["name"])
        assert ("new since the last campaign" if story in fresh else "still there") in review
    foresee(project, "report", "out", "--format", "markdown")
    foresee(project, "report", "out")
    page = html.document_fromstring((project / "out" / "report.html").read_text()).text_content()
    assert all(counts in text for text in (page, (project / "out" / "report.md").read_text()))
    listed = checked(foresee(project, "review", "--json"))
    assert set(listed["standing"]["since"]) == set(new)

    kept = foresee(project, "history", "--html", "out/history.html")
    table = [line.split() for line in kept.splitlines() if " idm " in line]
    assert table[0][-3:] == [str(len(fresh)), str(len(new.keys() & old.keys())), str(len(gone))] and len(table) == 2
    shown = html.document_fromstring((project / "out" / "history.html").read_text()).text_content()
    assert all(finding["title"] in shown for finding in (*old.values(), *new.values()))
    campaigns = checked(foresee(project, "history", "--json"))["campaigns"]
    assert [campaign["new"] for campaign in campaigns] == [None, len(fresh)]
    third = foresee(project, "campaign", "crosser.foresee", *WINDOW, "--children", "2", expect=1)
    assert " still " in third and "0 gone" in third and " still there" in third


def test_an_entry_that_no_finding_has_is_told_and_stays(project: Path) -> None:
    data = json.loads((project / "out" / "campaign.json").read_text())
    history = [json.loads(line) for line in (project / "out" / HISTORY).read_text().splitlines()]
    before = {finding["story"] for past in history for finding in past["findings"]}
    gone = sorted(before - {finding["story"] for finding in data["findings"]})[0]
    entry = decision(f"idm | {gone}").entry
    # Another campaign of the project may have found the second story, so only the list of entries speaks of it.
    family = data["test_cases"][0]["family"]
    (project / FILE).write_text(f"{entry}\n{decision(f'idm | {family} | zeppelin | flies').entry}\n")
    listed = foresee(project, "triage")
    assert "triage.toml: line 1 has a story that this campaign does not find any more" in listed
    assert listed.count("not a finding of the campaign in out") == 2
    assert "triage.toml: line 1 has" in foresee(project, "report", "out", "--format", "text")
    (project / FILE).write_text(entry + "\n")
    name = data["findings"][0]["name"] if data["findings"] else ""
    if name:
        foresee(project, "triage", name, "known", "--note", "x")
        assert "open again" in foresee(project, "triage", name, "open")
        assert "has no entry" in foresee(project, "triage", name, "open", expect=1)
    assert (project / FILE).read_text().splitlines()[-1] == entry
    assert "known" in foresee(project, "triage", "1", expect=2)
    assert "say why" in foresee(project, "triage", "1", "known", expect=2)
    elsewhere = foresee(project.parent, "triage", "1", "known", "--note", "x", "--campaign", project / "out", expect=1)
    assert "there is no crosser.foresee here" in elsewhere
    (project / FILE).write_text("[")
    refused = foresee(project, "campaign", "crosser.foresee", *SHORT, "--out", "other", expect=1)
    assert f"{FILE}:1: this is not an entry" in refused and not (project / "other").exists()
    (project / FILE).unlink()


def test_all_campaigns_of_a_project_have_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = tmp_path / "tests" / "one", tmp_path / "tests" / "more" / "two"
    for folder in (one, two, tmp_path / "elsewhere"):
        folder.mkdir(parents=True)
    cases = [f"{one}/a.foresee::r01", f"{two}/b.foresee"]
    monkeypatch.chdir(tmp_path)
    for order in (cases, cases[::-1], cases[:1], cases[1:], ["tests/one/a.foresee"], []):
        assert triage_file(order) == tmp_path / FILE, "there is no marker: the working folder"
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert triage_file(cases) == triage_file(cases[::-1]) == tmp_path / "tests" / FILE
    for marker, place in ((".gitattributes", tmp_path), ("pyproject.toml", tmp_path / "tests")):
        (place / marker).write_text("")
        for order in (cases, cases[::-1], cases[:1], cases[1:]):
            assert triage_file(order) == place / FILE


def test_an_interrupted_campaign_is_named_as_such(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for folder in (out, out / "pdm_reach"):
        folder.mkdir()
        result = CampaignResult(CampaignSettings(), (), (), 1.0, interrupted=folder != out)
        (folder / "campaign.json").write_text(as_text(campaign_document(result)))
        said = str(run_here("history", out, expect=1).exception)
        told = f"the campaign in {out} was interrupted, and only campaigns that have ended are listed"
        assert said.startswith(told if folder != out else f"there is no campaign in {out}")


def test_the_columns_of_the_history_have_names_of_their_own() -> None:
    table = history_table([CampaignChange(Path("out"), PAST, {"driver": 3}, None, None, None)])
    assert len(set(table.headings)) == len(table.headings)
    assert table.rows[0][table.headings.index("driver's fault")] == "3"
    assert table.rows[0][table.headings.index("driver")] == "pdm"


def test_a_damaged_history_is_named(project: Path) -> None:
    file = project / "out" / HISTORY
    text = file.read_text()
    file.write_text(text + '{"driver": 3}\n')
    number = text.count("\n") + 1
    assert f"out/{HISTORY}:{number}: this is not what a campaign writes" in foresee(project, "history", expect=1)
    file.write_text(text)


def test_a_finding_whose_test_case_is_not_run_again_is_not_gone() -> None:
    findings = tuple(PastFinding(story, "driver", story, f"{story}.foresee") for story in ("a", "b", "c"))
    past = replace(PAST, test_cases=tuple(f.test_case for f in findings), findings=findings)
    assert [finding.story for finding in past.gone({"a"}, ["a.foresee", "b.foresee"])] == ["b"]
