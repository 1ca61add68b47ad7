"""Findings of a campaign, minimised and reviewed: as steps of the campaign, and by command."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterable
from dataclasses import replace
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest
from click.testing import Result
from lxml import html
from rich.console import Console
from typer.testing import CliRunner

from foresee_dsl.avoidance.responsibility import FOLDED, Whose
from foresee_dsl.campaign.plan import plan_campaign
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.minimise import MinimiseStep
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions, Task, WorkerPool
from foresee_dsl.cli import app
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.report.page.html import write_report
from foresee_dsl.report.page.markdown import write_markdown
from foresee_dsl.report.terminal.campaign import print_campaign
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.story import tell
from tests.support import command
from tests.support.bad_driver import install
from tests.support.first_project import checked
from tests.support.small_campaign import SETTINGS, Heard, campaign, published, write_project
from tests.support.small_street import STREET


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a project and its finished campaign, `out`."""
    root = tmp_path_factory.mktemp("minimise")
    (root / "street.foresee").write_text(STREET)
    campaign([write_project(root), root / "street.foresee"], root / "out", options=RunOptions(jobs=2))
    return root


@pytest.fixture(autouse=True)
def here(done: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands are called in the project's folder."""
    monkeypatch.chdir(done)


@pytest.fixture(scope="module")
def names(done: Path) -> list[str]:
    """The findings."""
    return [finding["name"] for finding in published(done / "out")["json"]["findings"]]


def foresee(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})


def test_each_finding_has_a_folder_with_its_minimised_files(done: Path, names: list[str]) -> None:
    out = done / "out"
    assert len(names) > 1 and sorted(folder.name for folder in (out / "findings").iterdir()) == sorted(names)
    for finding in published(out)["json"]["findings"]:
        small = finding["minimised"]
        raw, case = load_test_case(str(out / finding["file"])), load_test_case(str(out / small["file"]))
        assert raw.mutant is not None and case.mutant is not None and case.clip is not None
        assert len(case.mutant.changes) == small["changes"]["now"] <= len(raw.mutant.changes)
        assert case.mutant.origin is not None and case.mutant.origin.minimised
        clips = (out / finding["file"]).parent / raw.mutant.parent, out / small["clip"]
        assert small["clip_lines"] == {
            key: clip.read_text().count("\n") for key, clip in zip(("before", "now"), clips, strict=True)
        }
        # The time is another one, as the clip begins later; the kind and the actor are the same.
        assert small["reason"].partition(" at ")[0] == case.mutant.origin.found.partition(" at ")[0]  # type: ignore[union-attr]
        assert (out / small["file"]).with_suffix(".npz").is_file()
    assert not check_paths([str(out / "findings")]).diagnostics


def test_all_statements_about_a_finding_are_about_one_run(done: Path, tmp_path: Path) -> None:
    """Terminal, page, Markdown, review, `keep` and the file say the same words and numbers: those of the run's trace.

    The run as found, of which some differ, is the second one on the page.
    """
    shutil.copytree(done / "out" / "store", tmp_path / "store")
    out, files = done / "out4", [done / "crosser.foresee", done / "street.foresee"]
    result, heard = campaign(files, out, replace(SETTINGS, against=("pdm",)), store=tmp_path / "store")
    assert set(heard.kinds) == {"reference", "minimised_reference"}
    page_file, markdown_file = tmp_path / "report.html", tmp_path / "report.md"
    contents = write_report([out], page_file)
    write_markdown([out], markdown_file)
    page, markdown = html.document_fromstring(page_file.read_text()), unescape(markdown_file.read_text())
    console = Console(record=True, width=1000, file=io.StringIO(), highlight=False)
    print_campaign(console, result, out)
    terminal = console.export_text()
    listed = {finding["name"]: finding for finding in published(out)["json"]["findings"]}
    assert len(result.findings) == len(contents.findings) > 1
    different = 0
    for finding, entry in zip(result.findings, contents.findings, strict=True):
        file = out / (finding.reduced or finding).file
        assert entry.name == finding.name and file.parent.parent == out / "findings"
        case, trace = load_test_case(str(file)), Trace.load(file.with_suffix(".npz"))
        story, reason = tell(trace, case), str(trace.meta["reason"])
        answers = [(judgement.name, str(judgement.answer), judgement.why) for judgement in finding.run.judgements]
        assert len(answers) == 2 and finding.run.references
        different += story.sentence != finding.story_as_found.sentence

        def text(node: html.HtmlElement) -> str:
            return " ".join(node.text_content().split())

        (article,) = page.xpath(f"//article[@id='finding-{entry.anchor}']")
        (item,) = page.xpath(f"//li[a/@href='#finding-{entry.anchor}']")
        first, second, *_ = article.xpath(".//section")
        chips = [text(chip) for chip in article.xpath(".//p[@class='chips']/span")]
        assert text(article.xpath(".//h2")[0]) == story.sentence
        assert text(item.xpath(".//span[@class='what']")[0]) == f"{finding.number}. {finding.title}"
        assert text(article.xpath(".//p[@class='judgement']")[0]) == finding.responsibility.sentence
        assert chips[0] == str(finding.number)
        assert chips[1].startswith(finding.verdict.value) and chips[2] == story.contact.value
        assert chips[3:5] == [f"R157: {answers[0][1]}", f"anticipating: {answers[1][1]}"]
        said = [text(node) for node in first.xpath(".//p|.//li")]
        assert [line for line in said if line.endswith(answers[0][2])] == [": ".join(answers[0])]
        assert [line.lower() for line in said if line.endswith(answers[1][2])] == [": ".join(answers[1]).lower()]
        assert [text(node) for node in first.xpath("./p[@class='ended']")] == [reason]
        moments = [f"{moment.time_s:.2f} s{moment.text}" for moment in story.moments]
        assert [text(node) for node in first.xpath("./ol[@class='moments']/li")] == moments
        changes = [text(node) for node in first.xpath("./ul[@class='changes']/li")]
        assert changes == [f"change {change}" for change in listed[finding.name]["minimised"]["changed"]]
        references = [text(node) for node in first.xpath("./ul[@class='references']/li")]
        for line, run in zip(references, finding.run.references, strict=True):
            assert line.startswith(run.driver)
            assert (", ".join(run.how) if run.avoids else run.apart or run.before or run.reason) in line
        assert str(file) in unquote(text(first.xpath(".//div[@class='command']/code")[0]))
        (played,) = page.xpath(f"//script[@id='{first.get('data-run')}']")
        assert json.loads(played.text)["moments"] == [[round(m.time_s, 3), m.text] for m in story.moments]
        assert text(second.xpath("./p[@class='run-title']")[0]) == finding.story_as_found.sentence
        assert text(second.xpath("./p[@class='ended']")[0]) == finding.representative.reason

        rows = [line for line in terminal.split("\n") if line[:3].strip() == str(finding.number)]
        assert len(rows) == (finding.responsibility.whose not in FOLDED)
        for row in rows:
            assert row.split()[1] == finding.verdict.value and finding.title in row
            above = terminal.partition(row)[0].split("\n")
            headings = [line.strip() for line in above if line.strip() in {whose.text for whose in Whose}]
            assert headings[-1] == finding.responsibility.whose.text
        sections = [part for part in markdown.split("### ")[1:] if f"`{finding.name}`, " in part]
        assert len(sections) == len(rows) and f"`{finding.name}`" in markdown
        for section in sections:
            assert section.startswith(f"{finding.verdict.value} {story.sentence}")
            judgement = finding.responsibility
            assert f"**{judgement.whose.text}**: {judgement.reason}" in section
        review = " ".join(foresee("review", finding.name, "--campaign", out).stdout.split())
        judged = f"Judgement: {finding.responsibility.sentence}"
        assert f"{finding.verdict.value}, {story.contact.value} {judged} {story.sentence} " in review
        for answer in answers:
            assert ": ".join(answer) in review
            assert all(f"{answer[0]}: **{answer[1]}**: {answer[2]}" in section for section in sections)
        for run in finding.run.references:
            assert (", ".join(run.how) if run.avoids else run.apart or run.reason) in review

        written = file.read_text()
        assert re.findall(r"^  # (.*)\n  change ", written, re.MULTILINE) == [story.sentence]
        assert case.mutant is not None and case.mutant.origin is not None
        origin = case.mutant.origin
        assert (origin.found, origin.preventable, origin.anticipating) == (
            reason,
            *(judgement.origin[1] if judgement.origin else None for judgement in finding.run.judgements),
        )
        kept = foresee("keep", finding.name, "--campaign", out, "--to", tmp_path / "suite").stdout
        assert kept.splitlines()[1].strip() == story.sentence
        copy = (tmp_path / "suite" / file.name).read_text()
        assert story.sentence in copy and story.sentence in (tmp_path / "suite" / "README.md").read_text()
        assert copy.partition("origin {")[2] == written.partition("origin {")[2]
    assert different


def test_the_minimised_files_go_through_every_command(done: Path, names: list[str], tmp_path: Path) -> None:
    mutant = done / "out" / "findings" / names[0] / f"{names[0]}.foresee"
    clip = next(file for file in mutant.parent.glob("*.foresee") if file != mutant)
    assert foresee("verify", mutant.parent, "--jobs", "1").exit_code == 0
    assert foresee("fmt", "--check", mutant, clip).exit_code == 0
    assert foresee("diff", clip, mutant).stdout.startswith("Stimulus\n  + ")
    said = json.loads(foresee("run", mutant, "--driver", "idm", "--json").stdout)
    assert said["reason"] in mutant.read_text()
    copy = tmp_path / clip.name
    copy.write_text(clip.read_text().replace("../../../", f"{done}/"))
    said = json.loads(foresee("mutate", copy, "--driver", "idm", "--children", "1", "--allow-outside", "--json").stdout)
    assert len(said["children"]) == 1


def test_the_command_takes_what_the_campaign_found(done: Path, names: list[str], tmp_path: Path) -> None:
    arguments = ("minimise", names[0], "--campaign", done / "out", "--out", tmp_path / "small", "--allow-outside")
    said = checked(foresee(*arguments, "--json").stdout)
    assert said["runs_now"] == 0 and said["runs"] > 0
    there = done / "out" / "findings" / names[0]
    for file in map(Path, said["files"]):
        assert file.read_text().split("\n")[3:] == (there / file.name).read_text().split("\n")[3:]
    load_test_cases(said["files"], allow_outside=True)
    assert "nothing was run" in foresee(*arguments).stdout


def test_any_failing_child_can_be_minimised_once(done: Path, tmp_path: Path) -> None:
    """One without a campaign, with fewer runs: they are stored in the user's cache."""
    raw = next((done / "out" / "children").rglob("*_m?.foresee"))
    clip = raw.with_name(f"{raw.stem.rpartition('_m')[0]}.foresee")
    for file in (raw, clip):
        shutil.copy(file, done / file.name)
        (done / file.name).write_text(file.read_text().replace("../../../crosser.foresee", "crosser.foresee"))
    arguments = ("minimise", done / raw.name, "--budget", "7", "--out", tmp_path / "small", "--allow-outside", "--json")
    first, again = (json.loads(foresee(*arguments).stdout) for _ in range(2))
    assert 0 < first["runs_now"] <= 7 and not first["complete"] and "budget of 7 runs" in first["note"]
    assert again["runs_now"] == 0
    assert {**again, "runs_now": 0} == {**first, "runs_now": 0}


@pytest.mark.parametrize(("how", "said"), [("os_exit", "its process died with exit code 0"), ("environ", "")])
def test_a_driver_that_spoils_its_process_spoils_no_other(done: Path, tmp_path: Path, how: str, said: str) -> None:
    environment, _ = install(tmp_path)
    raw = next((done / "out" / "children").rglob("*_m?.foresee"))
    arguments = ("minimise", raw, "--driver", f"bad:{how}", "--budget", "3", "--out", tmp_path / "small")
    given = command.foresee(*arguments, "--allow-outside", "--store", tmp_path / "store", env=environment, expect=None)
    assert given.returncode in (0, 1), given.stderr
    if said:
        assert f"cannot be minimised with bad:{how}: {said}" in " ".join(given.stderr.split())
        assert "its output was: so long" in " ".join(given.stderr.split())
    assert "foresee has a fault" not in given.stderr


def test_a_mutant_of_a_mutant_is_one_mutant_of_the_clip(done: Path, names: list[str], tmp_path: Path) -> None:
    """Its own change does nothing to the failure, and goes."""
    small = next(done / "out" / f["minimised"]["file"] for f in published(done / "out")["json"]["findings"]
                 if f["name"].startswith("beside"))  # fmt: skip
    case = load_test_case(str(small))
    more = small.with_name("more.foresee")
    more.write_text(f"""foresee 1

mutant more of "{small.name}" pin {case.meaning} {{
  change weather.wetness: 0 => 0.1

  origin {{
    driver "idm 1"
  }}
}}
""")
    try:
        said = json.loads(foresee("minimise", more, "--out", tmp_path / "small", "--allow-outside", "--json").stdout)
    finally:
        more.unlink()
    assert said["changes"] == {"before": 2, "now": 1}
    assert case.mutant is not None and said["changed"][0].startswith("neighbour.steer: 0.00 => ")


def test_the_unreduced_files_can_be_had(done: Path, names: list[str], tmp_path: Path) -> None:
    said = foresee("minimise", names[0], "--campaign", done / "out", "--full", "--out", tmp_path / "raw",
                   "--allow-outside")  # fmt: skip
    files = [Path(line) for line in said.stdout.split()]
    found = next((done / "out" / "children").rglob(f"{names[0]}.foresee"))
    assert files[0].read_text() == found.read_text()
    assert load_test_cases([str(file) for file in files], allow_outside=True)


def test_a_review_fits_the_screen_and_says_all(done: Path, names: list[str]) -> None:
    out = done / "out"
    finding = published(out)["json"]["findings"][0]
    text = foresee("review", names[0], "--campaign", out).stdout
    assert all(len(line) <= 80 or "/" in line for line in text.splitlines())  # paths stay whole
    for part in ("Difference", "Boundary", "Other mutations of the same clip", "Files", "Commands"):
        assert f"\n{part}" in text
    (edge,) = finding["minimised"]["boundary"]
    assert f"fails at {edge['fails']:.2f}" in text and f"passes at {edge['passes']:.2f}" in text
    assert finding["preventability"] in text
    data = checked(foresee("review", names[0], "--campaign", out, "--json").stdout)
    runs = [child for clip in published(out)["json"]["clip_runs"] for child in clip["children"]]
    passed = {child["mutant"] for child in runs if child["verdict"] == "pass"}
    assert set(data["withstood"]) <= passed and data["finding"]["name"] == names[0]
    assert data["others"] and all(one["changes"] for one in data["others"])


def test_hostile_texts_do_nothing_to_the_terminal(done: Path, names: list[str], tmp_path: Path) -> None:
    data = published(done / "out")["json"]
    evil = "\x1b[31m<script>\u202e" + "x" * 10_000
    data["findings"][0]["minimised"]["sentence"] = evil
    for clip in data["clip_runs"]:
        for child in clip["children"]:
            child |= {"reason": evil, "changes": [evil]}
    (tmp_path / "campaign.json").write_text(json.dumps(data))
    text = foresee("review", names[0], "--campaign", tmp_path).stdout
    assert "\x1b" not in text and "\u202e" not in text and len(text) < 60_000


def test_what_is_no_failing_mutant_is_refused_in_words(done: Path, names: list[str], tmp_path: Path) -> None:
    out = done / "out"

    def says(*arguments: object) -> str:
        said = foresee(*arguments)
        assert said.exit_code == 1 and isinstance(said.exception, ForeseeError), said.output
        return str(said.exception)

    assert "did you mean" in says("minimise", names[0][:-1], "--campaign", out)
    assert "no campaign in" in says("minimise", "nothing", "--campaign", tmp_path)
    clip = next(file for file in (out / "findings" / names[0]).glob("*.foresee") if file.stem != names[0])
    assert "contains a clip, not a mutant" in says("minimise", clip)
    raw = next((out / "children").rglob(f"{names[0]}.foresee"))
    stale = raw.with_name("stale.foresee")
    stale.write_text(_stale(raw.read_text()))
    try:
        assert "is pinned" in says("minimise", stale)
    finally:
        stale.unlink()
    (tmp_path / "campaign.json").write_text("[1]")
    assert "was not written by a campaign of this version" in says("minimise", "nothing", "--campaign", tmp_path)


def _stale(text: str) -> str:
    """A mutant whose clip was edited since."""
    head, _, rest = text.partition("pin sha256:")
    return f"{head}pin sha256:{'0' * 12}{rest[12:]}"


def test_a_mutant_that_passes_is_refused_in_words(done: Path, names: list[str], tmp_path: Path) -> None:
    """Its number is the one beyond the boundary."""
    finding = published(done / "out")["json"]["findings"][0]
    (edge,) = finding["minimised"]["boundary"]
    mutant = done / "out" / finding["minimised"]["file"]
    passing = mutant.with_name("passing.foresee")
    passing.write_text(mutant.read_text().replace(f"=> {edge['fails']:.2f}", f"=> {edge['passes']:.2f}"))
    try:
        said = foresee("minimise", passing, "--out", tmp_path)
    finally:
        passing.unlink()
    assert said.exit_code == 1 and "does not fail" in str(said.exception)
    assert not list(tmp_path.iterdir())


def raises(_: object) -> None:
    raise ValueError("the disk of the worker is full")


class Raising(WorkerPool):
    """Worker processes in which nothing can be minimised."""

    def add(self, tasks: Iterable[Task], priority: tuple[int, ...] = ()) -> None:
        kinds = {task: getattr(task.argument, "steps", ())[0].kind for task in tasks}
        super().add((replace(t, function=raises) if kind == "minimise" else t for t, kind in kinds.items()), priority)


def test_a_finding_that_cannot_be_minimised_is_kept_as_it_was_found(
    done: Path, names: list[str], tmp_path: Path
) -> None:
    files = [done / "crosser.foresee", done / "street.foresee"]
    shutil.copytree(done / "out" / "store", tmp_path / "store")
    with Store(tmp_path / "store") as store:
        store.execute("DELETE FROM runs WHERE kind = 'minimise'")
    options = RunOptions(executor=lambda how: Raising(how.jobs))
    result, _ = campaign(files, done / "out3", store=tmp_path / "store", options=options)
    assert [small.child.name for small in result.minimised] == sorted(names) and not result.broken
    for finding in published(done / "out3")["json"]["findings"]:
        assert "the disk of the worker is full" in finding["minimised"]["note"]
        found, small = (done / "out3" / name for name in (finding["file"], finding["minimised"]["file"]))
        assert found.read_text() == small.read_text()
    assert not check_paths([str(done / "out3" / "findings")]).diagnostics
    _, heard = campaign(files, done / "out3", store=tmp_path / "store")
    assert heard.kinds == []
    _, heard = campaign(files, done / "out3", store=tmp_path / "store", options=RunOptions(retry=True))
    assert heard.kinds == ["minimise"] * len(names)
    assert published(done / "out3")["json"] == published(done / "out")["json"]


class Stopping(Heard):
    """Asks for an end when the first finding is minimised."""

    def __call__(self) -> bool:
        return "minimise" in self.kinds


def test_a_campaign_that_is_stopped_while_it_minimises_continues(done: Path, names: list[str], tmp_path: Path) -> None:
    files = [done / "crosser.foresee", done / "street.foresee"]
    shutil.copytree(done / "out" / "store", tmp_path / "store")
    with Store(tmp_path / "store") as store:
        store.execute("DELETE FROM runs WHERE kind = 'minimise'")
        cases = load_test_cases(files)
        plan = plan_campaign(Stages(cases, SETTINGS, store, tmp_path / "out"), store, jobs=1)
    minimising = next(stage for stage in plan.stages if stage.step is MinimiseStep)
    assert (minimising.to_run, minimising.at_most) == (len(names), 0)
    stopping = Stopping()
    result, heard = campaign(files, done / "out2", store=tmp_path / "store", heard=stopping,
                             options=RunOptions(stop=stopping))  # fmt: skip
    assert heard.kinds == ["minimise"] and result.interrupted
    _, heard = campaign(files, done / "out2", store=tmp_path / "store")
    assert heard.kinds == ["minimise"] * (len(names) - 1)
    assert published(done / "out2")["json"] == published(done / "out")["json"]
