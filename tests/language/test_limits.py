"""What one text may ask for: endless conditions, networks and cases are refused before they cost anything."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.campaign.campaign_file import read_campaign
from foresee_dsl.errors import InputError
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.loading import Project

SCENARIO = """foresee 1

scenario s {
  network lane {
    junction a at (0 m, 0 m)
    junction b at (200 m, 0 m)
    road way from a to b
  }
  param fast: speed = 5 m/s in 1 m/s..10 m/s step 0.1 m/s
  ego: car.sedan {
    route [way]
    speed fast
  }
%s
}
"""
CAMPAIGN = 'foresee 1\n\ncampaign all {\n  seeds "%s"\n}\n'


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        parse(text, "x.foresee")
    return str(caught.value)


def test_fifty_thousand_ands_are_refused_before_they_are_parsed() -> None:
    condition = " and ".join(["ego.speed > 3 m/s"] * 50_000)
    said = refusal(SCENARIO % f"  when {condition} {{ ego stops }}")
    assert "FS002 the file has conditions of 49,999 parts" in said
    assert "`foresee --limit conditions=49999 COMMAND` allows it" in said


def test_a_network_of_twenty_thousand_junctions_is_refused() -> None:
    junctions = "\n".join(f"  junction j{k} at ({k} m, 0 m)" for k in range(20_000))
    said = refusal(f"foresee 1\n\nnetwork big {{\n{junctions}\n}}\n")
    assert "has 20,000 junctions, roads and buildings, more than 2,000" in said and "--limit network=20000" in said


def test_words_in_comments_and_texts_are_not_counted() -> None:
    comment = "# this and that\n" * 3000
    parse(comment + SCENARIO % '  doc "and and and"', "x.foresee")


def test_fifty_times_ten_thousand_cases_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "s.foresee"
    file.write_text(SCENARIO % "\n".join(f"  cases 10000 from seed {k}" for k in range(50)), encoding="utf-8")
    with pytest.raises(InputError, match=r"FS050 with these the scenario has more than 20,000 drawn cases.*--limit"):
        Project().test_cases([file])
    monkeypatch.setenv("FORESEE_LIMITS", "cases=20")
    for name in ("one", "two"):
        (tmp_path / f"{name}.foresee").write_text(SCENARIO % "  cases 15 from seed 1", encoding="utf-8")
    assert len(Project().test_cases([tmp_path / "one.foresee"])) == 15
    with pytest.raises(InputError, match="all files together have more than 20 drawn cases"):
        Project().test_cases([tmp_path / "one.foresee", tmp_path / "two.foresee"])


@pytest.mark.parametrize("path", ["/**", "../**", "/etc/*.foresee", "**/../../*.foresee", "../other/x.foresee"])
def test_a_campaigns_test_cases_stay_inside_the_project(tmp_path: Path, path: str) -> None:
    project = tmp_path / "project"
    (project / ".git").mkdir(parents=True)
    file = project / "all.foresee"
    file.write_text(CAMPAIGN % path, encoding="utf-8")
    with pytest.raises(InputError, match=r"FS138 .* is outside the project folder"):
        read_campaign(file)


def test_patterns_follow_no_links_out_of_the_project(tmp_path: Path) -> None:
    project, other = tmp_path / "project", tmp_path / "other"
    for folder in (project / ".git", project / "deep" / "er", project / ".hidden", other):
        folder.mkdir(parents=True)
    for folder in (project, project / "deep" / "er", project / ".hidden", other):
        (folder / "s.foresee").write_text(SCENARIO % "", encoding="utf-8")
    (project / "linked").symlink_to(other)
    file = project / "all.foresee"
    for pattern, found in (("**", ["deep/er/s", "s"]), ("deep/**/s.*", ["deep/er/s"]), ("*.foresee", ["s"])):
        file.write_text(CAMPAIGN % pattern, encoding="utf-8")
        assert read_campaign(file).paths == tuple(str(project / f"{name}.foresee") for name in found)
