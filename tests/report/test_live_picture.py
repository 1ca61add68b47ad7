"""The live page in a real browser: in an editor's web view (a stand-in for its host alone), and `draw --watch`."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foresee_dsl.report.picture.draw import answer, page_of
from tests.report.test_picture import SMALL
from tests.support.browser import browser, needs_chromium

pytestmark = needs_chromium
FORESEE = Path(sys.executable).parent / "foresee"
HOST = "window.sent = []; window.acquireVsCodeApi = () => ({ postMessage: (message) => window.sent.push(message) });"


@pytest.fixture(scope="module", name="browser")
def _browser() -> Iterator[Any]:
    with browser() as opened:
        yield opened


@pytest.fixture
def small(tmp_path: Path) -> Path:
    file = tmp_path / "small.foresee"
    file.write_text(SMALL, encoding="utf-8")
    return file


def opened(browser: Any, *, scheme: str = "light") -> tuple[Any, list[str]]:
    page = browser.new_page(viewport={"width": 700, "height": 900}, color_scheme=scheme)
    errors: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    return page, errors


def wait_for(page: Any, script: str) -> None:
    for _ in range(400):
        if page.evaluate(script):
            return
        page.wait_for_timeout(25)
    pytest.fail(f"never true: {script}")


def test_a_web_view_shows_marks_and_posts(browser: Any, small: Path, tmp_path: Path) -> None:
    page, errors = opened(browser)
    page.add_init_script(HOST)
    file = tmp_path / "page.html"
    file.write_text(page_of("abc123", title="small", connect=""), encoding="utf-8")
    page.goto(file.as_uri())
    wait_for(page, "window.sent.length > 0")
    assert page.evaluate("window.sent[0]") == {"type": "wish", "case": "", "whole": False, "width": 700}

    def show(state: dict[str, Any]) -> None:
        before = int(page.evaluate("document.getElementById('picture').dataset.drawn || 0"))
        page.evaluate(f"window.postMessage({json.dumps({'type': 'picture', 'state': state})}, '*')")
        wait_for(page, f"document.getElementById('picture').dataset.drawn > {before}")

    # every moment in which there is no drawing, or two, would be counted
    page.evaluate(
        "window.counts = []; new MutationObserver(() => window.counts.push("
        "document.querySelectorAll('svg.foresee-draw').length)).observe(document.getElementById('picture'),"
        " { childList: true })"
    )
    show(answer(small, width=700))
    show(answer(small, {small: SMALL.replace("start at 30 m", "start at 60 m")}, width=700))
    assert page.evaluate("window.counts") == [1, 1]
    assert page.evaluate("getComputedStyle(document.querySelector('.body path.p-ego')).fill") == "rgb(20, 89, 184)"

    # a click on an actor goes to its text, and so does Enter
    page.locator("g.body[data-name=turner] path").last.click(force=True)
    line = SMALL[: SMALL.index("vehicle turner")].count("\n") + 1
    wanted = {"type": "goto", "path": small.as_posix(), "line": line, "column": 3}
    assert page.evaluate("window.sent.at(-1)") == wanted
    page.evaluate("window.sent.length = 0; document.querySelector('g.body[data-name=turner]').focus()")
    page.keyboard.press("Enter")
    assert page.evaluate("window.sent.at(-1)") == wanted

    # a text that does not parse: the last picture stays, greyed, with the message and the actor marked
    show(answer(small, {small: SMALL.replace("left over b", "lft over b")}, width=700))
    assert page.evaluate("document.getElementById('picture').classList.contains('stale')")
    assert page.evaluate("document.querySelectorAll('svg.foresee-draw').length") == 1
    assert "lft" in page.inner_text("#mistakes")
    marked = page.evaluate("[...document.querySelectorAll('.mistaken')].map((node) => node.dataset.name)")
    assert "turner" in marked and "ego" not in marked
    page.click("#mistakes button")
    assert page.evaluate("window.sent.at(-1).line") == line + 1

    show(answer(small, width=700))
    assert not page.evaluate("document.getElementById('picture').classList.contains('stale')")
    assert page.is_hidden("#mistakes") and page.evaluate("document.querySelectorAll('.mistaken').length") == 0

    # dark as the editor is; nothing of the page reaches over its width
    page.evaluate("document.body.classList.add('vscode-dark')")
    show(answer(small, width=700))
    assert page.evaluate("getComputedStyle(document.querySelector('.p-paper')).fill") == "rgb(20, 24, 29)"
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert errors == []
    page.close()


def test_names_do_not_overlap_in_the_browser(browser: Any, scenarios: Path) -> None:
    """At the width of a phone and of a desk, with the letters that the browser has."""
    from foresee_dsl.report.drawing.svg import svg_of
    from foresee_dsl.report.picture.draw import draw

    page, errors = opened(browser, scheme="dark")
    covered = (
        "(() => { const names = [...document.querySelectorAll('svg.map text')];"
        "const boxes = names.map((node) => node.getBoundingClientRect());"
        "let count = 0; boxes.forEach((a, k) => boxes.slice(0, k).forEach((b) => {"
        " if (a.left + 1 < b.right && b.left + 1 < a.right && a.top + 2 < b.bottom && b.top + 2 < a.bottom) count += 1;"
        " })); return [boxes.length, count]; })()"
    )
    for address in ("scenario7.foresee::r03", "scenario8.foresee::r01", "scenario4/roadworks.foresee"):
        svg = svg_of(draw(str(scenarios / address)).sheet)
        for width in (375, 1200):
            page.set_viewport_size({"width": width, "height": 900})
            page.set_content(f"<body style='margin:0'>{svg}")
            names, count = page.evaluate(covered)
            assert names > 5 and count == 0, (address, width)
            assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert errors == []
    page.close()


def test_watch_draws_on_every_save_for_who_knows_the_token(browser: Any, small: Path, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [FORESEE, "draw", "small.foresee", "--watch"], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stderr is not None
        found = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", process.stderr.readline())
        assert found is not None
        address = found.group()
        base = address.rsplit("/", 2)[0]
        for url, host in ((f"{base}/", ""), (f"{base}/guess/", ""), (address, "evil.example:80")):
            request = urllib.request.Request(url, headers={"Host": host} if host else {})
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request)
            assert refused.value.code == 404
            refused.value.close()
        page, errors = opened(browser)
        page.goto(address)
        wait_for(page, "document.querySelectorAll('g.body').length === 2")
        small.write_text(SMALL.replace("vehicle turner", "vehicle other").replace("turner", "other"), encoding="utf-8")
        wait_for(page, "document.querySelector('g.body[data-name=other]') !== null")
        small.write_text(SMALL.replace("vehicle turner", "vehicl turner"), encoding="utf-8")
        wait_for(page, "document.getElementById('picture').classList.contains('stale')")
        assert "vehicl" in page.inner_text("#mistakes")
        small.write_text(SMALL, encoding="utf-8")
        wait_for(page, "document.querySelector('g.body[data-name=turner]') !== null")
        page.click("g.body[data-name=ego] text")
        assert "small.foresee:" in page.inner_text("#state")
        assert errors == []
        page.close()
    finally:
        process.terminate()
        process.wait()
        if process.stderr is not None:
            process.stderr.close()
