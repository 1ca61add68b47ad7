"""The report's page, in a real browser, and what it makes of hostile names; one small campaign for all."""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from lxml import html

from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.responsibility import Responsibility, Whose
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.records import JudgedRun, WrittenFinding
from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.campaign.written import campaign_folders
from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.page.contents import Contents, contents_of
from foresee_dsl.report.page.entries import FindingEntry
from foresee_dsl.report.page.html import rendered, write_report
from foresee_dsl.report.page.markdown import LONGEST_BYTES, as_markdown, as_text, block, code, escaped, write_markdown
from foresee_dsl.report.page.playback import ego_way, shown_frames
from foresee_dsl.report.page.running import EVERY_S, RunningPage
from foresee_dsl.report.page.runs import FailingRun, Reader, RunEntry
from foresee_dsl.report.page.single import write_view
from foresee_dsl.report.page.tables import Table
from foresee_dsl.report.show.panels import VIEW_S
from foresee_dsl.report.show.sources import RunRequest, find
from foresee_dsl.report.show.steps import recorded_steps
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, criticality
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.sensing.settings import STANDARD
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_dsl.story import Moment
from tests.support import command
from tests.support.browser import browser, needs_chromium
from tests.support.small_campaign import SETTINGS, campaign, finished, write_project

DOCS = Path(__file__).parents[2] / "docs"

FOLDERS = ("x<script>window.hacked=1<", "script>`a`|b|&lt;'\u202e*_[c](d)")
"""Names of folders, which test cases are called by; a slash ends a name, so `</script>` takes two."""
HOSTILE = (
    "</script><script>window.hacked=1</script><img src=x onerror=window.hacked=1>'\"`|\x1b[31m\u202e\x00" + "w" * 9_900
)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign's folder, of a project in a folder with a hostile name."""
    folder = tmp_path_factory.mktemp("page")
    project = write_project(folder.joinpath(*FOLDERS))
    result = finished(project, folder / "out")
    assert any(clip.failing for clip in result.clips)
    return folder / "out"


@pytest.fixture(scope="module")
def page_file(out: Path) -> Path:
    write_report([out], out / "report.html")
    return out / "report.html"


@pytest.fixture(scope="module")
def findings(out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((out / "campaign.json").read_text())["findings"]
    return found


@pytest.fixture(scope="module", name="browser")
def _browser() -> Iterator[Any]:
    with browser() as opened:
        yield opened


class Opened:
    """A page in the browser, and what went wrong in it."""

    def __init__(self, browser: Any, file: Path, width: int = 1440, scheme: str = "light") -> None:
        self.page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        self.errors: list[str] = []
        self.page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self._asked(request.url))
        self.page.goto(file.absolute().as_uri())

    def _asked(self, url: str) -> None:
        if not url.startswith(("file:", "data:")):
            self.errors.append(f"asked for {url}")

    def ask(self, script: str) -> Any:
        return self.page.evaluate(script)

    def wait_for(self, script: str) -> None:
        """Wait until it is true; playwright's own way evaluates strings, which the page forbids."""
        for _ in range(200):
            if self.ask(script):
                return
            self.page.wait_for_timeout(25)
        pytest.fail(f"never true: {script}")

    def seek(self, time_s: float) -> None:
        slider = "const s = document.querySelector('.player .time');"
        self.ask(f"{slider} s.value = {time_s}; s.dispatchEvent(new Event('input', {{bubbles: true}}))")

    def box(self, actor: str) -> tuple[float, ...]:
        """The centre of an actor's footprint as the page draws it, heading, length and width."""
        corners = self.ask(f"foresee.box({json.dumps(actor)})")
        (ax, ay), (bx, by), (cx, cy), _ = corners
        return ((ax + cx) / 2, (ay + cy) / 2, *_axis(bx, by, ax, ay), ((bx - cx) ** 2 + (by - cy) ** 2) ** 0.5)

    def close(self) -> None:
        self.page.close()
        assert self.errors == []


def _axis(ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    return math.atan2(by - ay, bx - ax), math.hypot(bx - ax, by - ay)


@pytest.fixture
def opened(browser: Any, page_file: Path) -> Iterator[Opened]:
    one = Opened(browser, page_file)
    yield one
    one.close()


# ---- in the browser -------------------------------------------------------------------------------------------------


@needs_chromium
def test_slider_moves_the_vehicles_and_at_the_contact_the_boxes_overlap(opened: Opened) -> None:
    run = opened.ask("foresee.player.run.raw")
    assert run["contact"] is not None
    opened.seek(0.0)
    begin = opened.box("ego")
    opened.seek(run["contact"][0])
    ego, other = opened.box("ego"), opened.box(run["opponent"])
    assert abs(ego[0] - begin[0]) + abs(ego[1] - begin[1]) > 3.0
    # positions are rounded to a centimetre
    grown = (*ego[:3], ego[3] + 0.03, ego[4] + 0.03)
    assert box_overlap(np.array(grown), np.array(other))
    opened.seek(max(run["contact"][0] - 1.0, 0.0))
    assert not box_overlap(np.array(opened.box("ego")), np.array(opened.box(run["opponent"])))


def test_a_way_has_every_place_to_the_centimetre() -> None:
    trace = Trace.load(Path(__file__).parents[1] / "cases" / "story" / "out_from_behind" / "trace.npz")
    frames = shown_frames(trace.frames)
    for first, count, x, y, heading, speed in ego_way(trace, trace.frames):
        there = trace.states[frames[first : first + count], 0]
        columns = ((x, X, 100), (y, Y, 100), (heading, HEADING, 1000), (speed, SPEED, 100))
        for (start, *changes), column, per_unit in columns:
            differences = np.cumsum([*changes, *[0] * (count - 1 - len(changes))])
            values = start + np.concatenate(([0], np.cumsum(differences)))
            apart = values / per_unit - there[:, column]
            turns = 2 * math.pi * np.round(apart / (2 * math.pi)) if column == HEADING else 0.0
            assert np.abs(apart - turns).max() <= 0.5001 / per_unit


@needs_chromium
def test_keys_play_step_and_go_through_the_findings(opened: Opened, findings: list[dict[str, Any]]) -> None:
    press, ask = opened.page.keyboard.press, opened.ask
    press("Home")
    assert ask("foresee.player.time") == 0
    press("ArrowRight")
    assert ask("foresee.player.time") == pytest.approx(ask("foresee.player.run.step"))
    press("End")
    assert ask("foresee.player.time") == ask("foresee.player.run.end")
    press("Home")
    press(" ")
    assert ask("foresee.player.playing")
    opened.wait_for("foresee.player.time > 0.1")
    press(" ")
    assert not ask("foresee.player.playing")
    press("f")
    assert ask("foresee.player.show.follow")
    first = ask("foresee.current")
    press("j")
    opened.wait_for("location.hash !== ''")
    assert (ask("foresee.current") != first) == (len(findings) > 1)
    press("k")
    opened.wait_for(f"foresee.current === {json.dumps(first)}")
    press("/")
    assert ask("document.activeElement.id") == "search"


@needs_chromium
def test_filters_filter(opened: Opened, findings: list[dict[str, Any]]) -> None:
    shown = "[...document.querySelectorAll('.items li')].filter((node) => !node.hidden).length"
    assert opened.ask(shown) == len(findings)
    opened.page.fill("#search", findings[-1]["name"])
    assert 1 <= opened.ask(shown) <= len(findings)
    opened.page.fill("#search", "nobody-has-this-name")
    assert opened.ask(shown) == 0
    assert opened.page.is_visible(".list .none")
    opened.page.click("#clear")
    assert opened.ask(shown) == len(findings)
    for name in ("class", "verdict", "preventability", "anticipation"):
        select = opened.page.query_selector(f"[data-filter={name}]")
        if select is None:  # all findings have the same
            continue
        opened.page.select_option(f"[data-filter={name}]", findings[0][name])
        assert opened.ask(shown) == sum(found[name] == findings[0][name] for found in findings)
        opened.page.click("#clear")


@needs_chromium
def test_another_run_of_the_story_and_a_moment_are_chosen(opened: Opened) -> None:
    before = opened.ask("foresee.player.run.raw.end")
    if opened.page.query_selector(".finding.current .runs") is not None:
        opened.page.select_option(".finding.current .runs", "1")
        assert opened.ask("foresee.player.section.dataset.run") == "run-1"
    opened.page.click(".finding.current .run:not([hidden]) .moments button >> nth=0")
    assert opened.ask("foresee.player.time") <= before
    assert opened.ask("document.querySelectorAll('.moments button.at').length") >= 1


@needs_chromium
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_scrolls_one_way_only(browser: Any, page_file: Path, scheme: str) -> None:
    one = Opened(browser, page_file, width=390, scheme=scheme)
    anchor = one.ask("document.querySelector('.items a').getAttribute('href')")
    for part in ("", anchor, "#overview", "#numbers"):
        one.ask(f"location.hash = {json.dumps(part)}")
        one.page.wait_for_timeout(50)
        assert one.ask("document.documentElement.scrollWidth") <= 390, part
    before = one.ask("getComputedStyle(document.body).backgroundColor")
    one.page.click("#theme")
    assert one.ask("getComputedStyle(document.body).backgroundColor") != before
    one.close()


@needs_chromium
def test_hostile_names_run_nothing(browser: Any, opened: Opened, tmp_path: Path) -> None:
    assert opened.ask("window.hacked") is None
    direct = tmp_path / "direct.html"
    direct.write_text(rendered(hostile_contents(), Reader()))
    one = Opened(browser, direct)
    assert one.ask("window.hacked") is None
    assert "<script>window.hacked" in one.ask("document.querySelector('h2').textContent")
    assert one.ask("document.documentElement.scrollWidth") <= 1440
    one.close()


@needs_chromium
def test_one_file_has_a_page(browser: Any, out: Path, findings: list[dict[str, Any]], tmp_path: Path) -> None:
    child = next(found["file"] for found in findings if found["clip"])
    file = write_view(str(out / child), tmp_path / "view.html", driver="idm", allow_outside=True)
    one = Opened(browser, file)
    assert one.ask("foresee.player.run.raw.contact") is not None
    assert one.ask("foresee.player.run.ghosts.length") > 0  # the clip, unmutated
    one.close()
    trace = next(iter(sorted((out / "traces").glob("*.npz"))))
    assert write_view(str(trace), tmp_path / "trace.html").stat().st_size > 10_000


@needs_chromium
def test_a_campaign_without_failures_has_a_page(browser: Any, tmp_path: Path) -> None:
    file = tmp_path / "nothing.html"
    near = Table("Nearest misses that passed", ("run", "TTC s"), (("crosser", "1.20"),))
    file.write_text(rendered(Contents("idm", "No failures", "", (), (), (near,)), Reader()))
    one = Opened(browser, file)
    assert "Nothing failed" in one.page.inner_text("#findings")
    one.page.keyboard.press("j")
    one.page.click("nav a[href='#overview']")
    one.page.wait_for_selector("#overview caption", timeout=10_000)  # raises if it does not become visible
    one.close()


@needs_chromium
def test_curves_are_those_of_the_run(opened: Opened, out: Path, findings: list[dict[str, Any]]) -> None:
    offered = opened.ask("[...document.querySelectorAll('.measure option')].map((option) => option.value)")
    assert offered[0] == "gap" and {"ttc_s", "drac_mps2", "injury_risk"} <= set(offered)
    file = findings[0]["minimised"]["file"] if findings[0]["minimised"] else findings[0]["file"]
    beside = (out / file).with_suffix(".npz")
    trace = Trace.load(beside if beside.exists() else out / "traces" / f"{findings[0]['name']}.npz")
    other = trace.index(opened.ask("foresee.player.run.opponent.id"))
    opened.page.select_option(".measure", "ttc_s")
    drawn = opened.ask("foresee.player.gap.lines[0].values")
    expected = criticality(trace, other)[CriticalityMeasure.TTC][shown_frames(trace.frames)]
    assert [value is not None for value in drawn] == np.isfinite(expected).tolist()
    assert [value for value in drawn if value is not None] == pytest.approx(expected[np.isfinite(expected)], abs=0.006)
    opened.page.keyboard.press("Escape")
    opened.ask("document.activeElement.blur()")
    opened.page.keyboard.press("c")
    assert opened.ask("document.querySelector('.measure').value") == offered[offered.index("ttc_s") + 1]


@needs_chromium
def test_a_broken_rule_is_marked_on_the_time_axis(browser: Any, out: Path, tmp_path: Path) -> None:
    trace = Trace.load(next(iter(sorted((out / "traces").glob("*.npz")))))
    at_s = round(trace.duration_s / 2, 2)
    broken = {"rule": "red_light", "actor": "ego", "time_s": at_s, "place": "j1", "until_s": at_s + 0.5}
    colours = []
    for name, infractions in (("none", []), ("red", [broken])):
        replace(trace, meta={**trace.meta, "infractions": infractions}).save(tmp_path / f"{name}.npz")
        one = Opened(browser, write_view(str(tmp_path / f"{name}.npz"), tmp_path / f"{name}.html"))
        one.seek(0.0)
        assert one.page.is_visible(".legend .ruled") == bool(infractions)
        colours.append(
            one.ask(f"""(() => {{
            const canvas = document.querySelector('.curves .speed');
            const x = 36 + (canvas.clientWidth - 46) * {at_s} / foresee.player.run.end;
            return [...canvas.getContext('2d').getImageData(x, 16, 1, 1).data];
        }})()""")
        )
        one.close()
    assert colours[0] == [255, 255, 255, 255]
    assert colours[1] == [122, 79, 1, 255]  # --warn


@needs_chromium
def test_another_driver_s_run_is_shown_beside_it(browser: Any, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    campaign(write_project(tmp_path / "project"), folder, replace(SETTINGS, against=("pdm",)))
    write_report([folder], folder / "report.html")
    one = Opened(browser, folder / "report.html")
    small = json.loads((folder / "campaign.json").read_text())["findings"][0]["minimised"]["file"]
    theirs = run_test_case(load_test_case(str(folder / small), allow_outside=True), "pdm", 0).trace
    assert one.ask("[...document.querySelectorAll('.other option')].map((o) => o.textContent)") == [
        "no other driver", "pdm",
    ]  # fmt: skip
    one.page.select_option(".other", "1")
    one.seek(1.0)
    pose = one.ask("foresee.player.run.pose(foresee.player.show.other.way, 1.0)")
    assert (pose["x"], pose["y"]) == pytest.approx(theirs.states[20, 0, [X, Y]].tolist(), abs=0.011)
    assert one.page.inner_text(".besides .answer").startswith("pdm ")
    green = """(() => { // pixels in the colour of the other driver's ego
        const canvas = document.querySelector('.scene');
        const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        let count = 0;
        for (let k = 0; k < data.length; k += 4) count += data[k] === 23 && data[k + 1] === 105 && data[k + 2] === 58;
        return count;
    })()"""
    assert one.ask(green) > 20
    one.page.select_option(".other", "0")
    assert one.ask(green) == 0
    one.close()


@needs_chromium
def test_the_driver_s_reasons_at_the_cursor(browser: Any, out: Path, tmp_path: Path) -> None:
    write_report([out], tmp_path / "reasons.html", reasons=True)
    one = Opened(browser, tmp_path / "reasons.html")
    reasons = one.ask("foresee.player.run.raw.reasons")
    small = json.loads((out / "campaign.json").read_text())["findings"][0]["minimised"]["file"]
    steps, same = recorded_steps(find(str(out / small), RunRequest(driver="idm", allow_outside=True)), every_s=0.2)
    assert same and reasons
    for step in steps:
        one.seek(step.time_s)
        expected = [" ".join(reason.rule.split()) for reason in step.reasons] or ["none"]
        items = one.page.query_selector_all(".because li")
        assert len(items) == len(expected)
        assert all(rule in item.inner_text() for rule, item in zip(expected, items, strict=True))
    one.close()


@needs_chromium
def test_a_running_campaign_has_a_page(browser: Any, tmp_path: Path) -> None:
    file, seconds = tmp_path / "report.html", [0.0]
    page = RunningPage(file, SETTINGS, clock=lambda: seconds[0], now=lambda: "12:34:56")
    page.planned("child", 3)
    assert "running, 0 of 3" in file.read_text()
    row = StoredResult("k", "child", f"<b>{HOSTILE[:60]}", b"", verdict="F2", reason="hit <script>")
    page.done(row)
    assert "running, 0 of 3" in file.read_text()  # too early to write again
    seconds[0] += EVERY_S
    page.done(replace(row, verdict="pass"))
    one = Opened(browser, file)
    assert one.page.title() == "running, 2 of 3: idm"
    assert one.page.get_attribute("meta[http-equiv=refresh]", "content") == "10"
    assert len(one.page.query_selector_all(".so-far tbody tr")) == 1
    assert one.ask("window.hacked") is None
    one.close()


def test_a_running_campaign_lists_runs_that_break_only_an_expectation(tmp_path: Path) -> None:
    page = RunningPage(tmp_path / "report.html", SETTINGS, clock=lambda: 0.0, now=lambda: "12:34:56")
    for name, reason in (("a_m1", "does not hold: expect room"), ("a_m2", "arrived at 8.00 s")):
        page.done(StoredResult("k", "child", name, b"", verdict="pass", reason=reason))
    (row,) = html.document_fromstring(page.text()).xpath("//table[@class='so-far']/tbody/tr")
    assert [cell.text_content() for cell in row] == ["a_m1", "does not hold: expect room"]


@needs_chromium
def test_without_scripts_each_finding_has_a_picture(
    browser: Any, page_file: Path, findings: list[dict[str, Any]]
) -> None:
    page = browser.new_context(java_script_enabled=False, viewport={"width": 390, "height": 900}).new_page()
    page.goto(page_file.absolute().as_uri())
    pictures = page.query_selector_all(".picture")
    assert len(pictures) == len(findings)
    assert all(picture.bounding_box()["width"] > 200 for picture in pictures)
    assert page.inner_text("noscript .note").startswith("The playback and the filters need scripts")
    page.close()


@needs_chromium
def test_thumbnails_show_both_where_they_meet(opened: Opened, findings: list[dict[str, Any]]) -> None:
    boxes = opened.ask("""[...document.querySelectorAll('.items .thumb')].map((node) =>
        ['ego', 'opponent'].map((role) => [...node.querySelectorAll(`.t-${role}`)].map((path) => {
            const {x, y, width, height} = path.getBBox();
            return [x, y, x + width, y + height];
        })))""")
    assert len(boxes) == len(findings)
    for ego, other in boxes:
        assert len(ego) == 1
        for (a, b, c, d), (e, f, g, h) in zip(ego, other, strict=False):
            assert a <= g + 2 and e <= c + 2 and b <= h + 2 and f <= d + 2  # decimetres


@needs_chromium
def test_the_facts_of_a_judgement_are_there(opened: Opened) -> None:
    opened.page.click(".finding.current .grounds summary")
    assert "the ego" in opened.page.inner_text(".finding.current .grounds li >> nth=-1")


# ---- without a browser ----------------------------------------------------------------------------------------------


def test_page_needs_nothing_else_and_says_every_finding(page_file: Path, findings: list[dict[str, Any]]) -> None:
    text = page_file.read_text()
    assert "Content-Security-Policy" in text
    assert not re.search(r"<(?:link|script|img)[^>]+(?:src|href)=[\"'](?!data:)", text)
    for found in findings:
        assert f'id="finding-{found["name"]}"' in text
        for name in found["siblings"]:
            assert name in text
    assert page_file.stat().st_size < 1_000_000


def test_constants_of_its_pictures_are_those_of_the_simulation(page_file: Path) -> None:
    (drawing,) = html.document_fromstring(page_file.read_text()).xpath("//script[@id='drawing']")
    constants = json.loads(drawing.text)
    assert (constants["eye_m"], constants["view_s"]) == (STANDARD.eye_m, VIEW_S)


def test_writing_it_again_gives_the_same_bytes(out: Path, page_file: Path, tmp_path: Path) -> None:
    write_report([out], tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == page_file.read_bytes()


def test_markdown_is_short_and_harmless(out: Path, tmp_path: Path, findings: list[dict[str, Any]]) -> None:
    write_markdown([out], tmp_path / "report.md")
    text = (tmp_path / "report.md").read_text()
    assert len(text.encode()) < LONGEST_BYTES
    assert text.count("\n### ") == len(findings)
    pictures = re.findall(r"\]\((report_files/[^)]+\.svg)\)", text)
    assert len(pictures) == len(findings)
    assert all((tmp_path / picture).is_file() for picture in pictures)
    outside_code = re.sub(r"(`+).*?\1", "", text, flags=re.DOTALL)
    assert "<script" not in outside_code
    assert "\u202e" not in text


def test_markdown_leaves_out_what_has_no_room() -> None:
    contents = hostile_contents()
    many = tuple(replace(contents.findings[0], key=f"f{k}") for k in range(60))
    text = as_markdown(replace(contents, findings=many), [""] * 60)
    assert len(text.encode()) < LONGEST_BYTES
    assert "more, which have no room here" in text


@pytest.mark.parametrize(
    "sign", ["<b>", "|", "`", "[a](b)", "@someone", "#12", "https://a.example", "&lt;", "*x*", "\x1b[1m"]
)
def test_markdown_shows_signs_as_they_are(sign: str) -> None:
    shown = escaped(f"a{sign}b")
    assert sign not in shown
    assert "\n" not in code(f"a{sign}\nb")
    assert re.fullmatch(r"(`{3,})\n[^\n]*\n\1", block(f"a{sign}```b", ""))


def test_what_is_missing_or_was_edited_is_said(out: Path, findings: list[dict[str, Any]], tmp_path: Path) -> None:
    copy = tmp_path / "one" / "copy"
    shutil.copytree(out, copy, ignore=shutil.ignore_patterns("store"))
    shutil.rmtree(copy / "findings", ignore_errors=True)
    shutil.rmtree(copy / "traces")
    for found in findings:
        if found["clip"]:
            (copy / found["clip"]).unlink()
    contents = write_report([copy], copy / "report.html")
    assert [found.name for found in contents.findings] == [found["name"] for found in findings]
    for found in contents.findings:
        assert found.runs[0].missing
        assert found.runs[0].id == ""
    assert campaign_folders(copy.parent) == (copy,)


def hostile_contents() -> Contents:
    """A report of which every text is hostile."""
    judgements = (Preventability(Preventable.NO, HOSTILE), Anticipation(Answer.NO, HOSTILE))
    outcome = FailingRun(
        name=HOSTILE, address=HOSTILE, record=JudgedRun(verdict=Verdict.F2, reason=HOSTILE, judgements=judgements),
        driver=HOSTILE, seed=0, trace=None,
    )  # fmt: skip
    run = RunEntry(
        outcome=outcome, id="", title=HOSTILE, moments=(Moment(1.0, HOSTILE, HOSTILE, HOSTILE),), label=HOSTILE,
        class_=HOSTILE, forecast=HOSTILE, changes=(HOSTILE,), unreduced=(HOSTILE,), note=HOSTILE,
        commands=((HOSTILE, HOSTILE),), missing=(HOSTILE,),
    )  # fmt: skip
    record = WrittenFinding(
        name=HOSTILE, title=HOSTILE, sentence=HOSTILE, class_=HOSTILE, verdict=Verdict.F2, test_case=HOSTILE,
        family=HOSTILE, file=HOSTILE, count=1, siblings=(), sibling_files=(), preventability=Preventable.NO,
        why=HOSTILE, anticipation=Answer.NO, rate=HOSTILE,
    )  # fmt: skip
    found = FindingEntry(
        record, key=HOSTILE, title=HOSTILE, label=HOSTILE, driver=HOSTILE, runs=(run, run), more=(HOSTILE,)
    )
    table = Table(HOSTILE, (HOSTILE, HOSTILE), ((HOSTILE, HOSTILE),), (HOSTILE, HOSTILE))
    return Contents(HOSTILE, HOSTILE, HOSTILE, (found,), (HOSTILE,), (table,), (table,))


# ---- the commands ---------------------------------------------------------------------------------------------------


def test_report_gives_every_form(out: Path, page_file: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.html"
    assert foresee("report", out, "--output", again, cwd=tmp_path) == f"{again}\n"
    assert again.read_bytes() == page_file.read_bytes()
    found = json.loads(foresee("report", out, "--format", "json", cwd=tmp_path))
    jsonschema.validate(found, json.loads((DOCS / "schemas" / "report-1.json").read_text()))
    text = foresee("report", out, "--format", "text", cwd=tmp_path)
    assert all(one["sentence"] in text for one in found["findings"])


def test_the_text_has_a_line_for_each_finding_that_nothing_follows_from(out: Path) -> None:
    contents = contents_of(campaign_folders(out), Reader(plays=False))
    first, *others = contents.findings
    unavoidable = replace(first.record, judgement=Responsibility(Whose.UNAVOIDABLE, "nobody avoids it"))
    contents = replace(contents, findings=(replace(first, record=unavoidable), *others))
    text = as_text(contents)
    assert f"\n1 {Whose.UNAVOIDABLE.counted}:\n  {first.name}: {first.title}\n" in text
    assert text.count(first.name) == 1 and all(f"\n{one.name}\n  {one.title}\n" in text for one in others)


def foresee(*arguments: str | Path, cwd: Path) -> str:
    return command.foresee(*arguments, cwd=cwd).stdout
