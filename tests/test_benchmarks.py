"""What `make bench` writes, and that what it measures is what it says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from defusedxml import ElementTree
from rich.console import Console

from benchmarks import bench_engine, bench_forecast, bench_workers, library, run, sections
from benchmarks.figures import Figure
from benchmarks.peers import __main__ as peers
from benchmarks.peers import scene
from benchmarks.peers.__main__ import NotMeasuredError, Peer
from benchmarks.scale import actors, schedule
from foresee_dsl.campaign.campaign_file import read_campaign
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.compile import compile_test_case
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case

ASKED = {
    "child_vs_bare": "at most 1.9",
    "child_vs_bound": "at most 1.4",
    "child_vs_getters": "at most 1.3",
    "library_child_vs_getters": "at most 2.5",
    "simulated_s_per_wall_s_pdm": "at least 350",
    "forecast_share": "at most 0.03",
    "two_worker_speedup": "at least 1.85",
    "engine_ms_per_run": "at most 2 ms",
    "resume_s": "at most 10 s",
}


def figures() -> list[Figure]:
    """One of each kind: a ratio that is met, one that is not, one where more is better, seconds, and milliseconds."""
    return [
        Figure("small", 1.5, "ratio", "met", 2.0),
        Figure("large", 2.5, "ratio", "not met", 2.0),
        Figure("fast", 150.0, "ratio", "just met", 150.0, more=True),
        Figure("slow", 149.9, "ratio", "just not met", 150.0, more=True),
        Figure("passing_s", 3.0, "s", "for the reader"),
        Figure("engine_ms_per_run", 1.23456, "ms", "asked for"),
    ]


def test_a_target_is_a_bound_from_above_or_from_below() -> None:
    assert [figure.met for figure in figures()] == [True, False, True, False, True, True]


def test_latest_holds_the_ratios_and_what_was_asked_for() -> None:
    assert run.ratios_of(figures()) == {
        "small": 1.5, "large": 2.5, "fast": 150.0, "slow": 149.9, "engine_ms_per_run": 1.2346
    }  # fmt: skip


def test_a_part_of_the_benchmarks_keeps_the_ratios_of_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "_HERE", tmp_path)
    (tmp_path / "latest.json").write_text('{"schema": 1, "ratios": {"other": 3.0, "small": 9.0}}')
    run._write(figures(), whole=False)
    written = json.loads((tmp_path / "latest.json").read_text())
    assert written["schema"] == 1 and written["ratios"]["other"] == 3.0 and written["ratios"]["small"] == 1.5
    run._write(figures()[:1], whole=True)
    assert json.loads((tmp_path / "latest.json").read_text()) == {"schema": 1, "ratios": {"small": 1.5}}
    lines = [json.loads(line) for line in (tmp_path / "history.jsonl").read_text().splitlines()]
    assert lines[0]["figures"]["passing_s"] == 3.0 and {"cpu", "cores", "python", "versions"} <= set(
        lines[0]["machine"]
    )
    assert len(lines) == 2


def test_the_table_says_each_bound(capsys: pytest.CaptureFixture[str]) -> None:
    Console(width=200).print(run._table(figures()))
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert "at least 150" in lines["slow"] and " no " in lines["slow"]
    assert "at most 2" in lines["small"] and " yes " in lines["small"]


def test_the_last_run_that_is_kept_has_all_that_is_asked_for() -> None:
    written = json.loads((Path(run.__file__).parent / "latest.json").read_text())
    assert written["schema"] == 1
    assert set(ASKED) <= set(written["ratios"])
    assert all(isinstance(value, float | int) and value > 0 for value in written["ratios"].values())
    assert not {name for name in written["ratios"] if name.endswith("_missing")}


def test_the_forecasts_share_is_that_of_a_real_run(monkeypatch: pytest.MonkeyPatch) -> None:
    shortest = library.cases()[:1]
    monkeypatch.setattr(bench_forecast, "cases", lambda: shortest)
    monkeypatch.setattr(bench_forecast, "ROUNDS", 1)
    found = {figure.name: figure for figure in bench_forecast.figures()}
    assert found["forecast_share"].target == 0.03 and not found["forecast_share"].more
    assert 0 < found["forecast_share"].value < 0.3
    assert 0 < found["clip_cutting_share"].value < 0.5


def test_a_measured_campaign_says_its_time_runs_and_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_workers, "cases", lambda: library.cases()[:1])
    monkeypatch.setattr(
        bench_workers, "SETTINGS", CampaignSettings(ranker="foresee", preset="focused", risky_points=1, children=2)
    )
    took_s, runs, parent_mb, worker_mb = bench_workers.measure(2)
    assert took_s > 0 and runs == 1 + 1 + 2
    assert 30 < parent_mb < 4096 and 30 < worker_mb < 4096


def test_the_engines_targets_are_what_was_asked_for() -> None:
    assert f"at most {bench_engine._BARE:g}" == ASKED["child_vs_bare"]
    assert f"at most {bench_engine._BOUND:g}" == ASKED["child_vs_bound"]
    assert f"at most {bench_engine._GETTERS:g}" == ASKED["child_vs_getters"]
    assert f"at most {bench_engine._LIBRARY:g}" == ASKED["library_child_vs_getters"]
    assert f"at least {bench_engine._SLOWEST_PDM:g}" == ASKED["simulated_s_per_wall_s_pdm"]
    assert f"at least {bench_workers._LEAST:g}" == ASKED["two_worker_speedup"]


def test_the_study_is_as_large_as_the_papers() -> None:
    """The library gives some 1,220 children a seed of mutation."""
    study, bundled = (read_campaign(data_folder("scenarios") / f"{name}.foresee") for name in ("study", "campaign"))
    assert study.paths == bundled.paths
    repeat = int(study.settings["repeat"])
    assert dict(bundled.settings.items() - study.settings.items()) == {"preset": "avoidable", "risky_points": 3}
    assert study.settings["preset"] == "focused", "with which the library gives so many children"
    assert 34_416 <= 1_220 * repeat < 36_000


def test_a_schedule_waits_for_what_a_task_follows_from_and_for_the_campaigns_own_process() -> None:
    children = [schedule.Task(1.0, 1, (1, 2)) for _ in range(8)]
    work = schedule.Work((schedule.Task(2.0, 1, (0, 0), children),), (schedule.Task(3.0, 1, (9, 9)),))
    nothing = schedule.Own(0.0, 0.0)
    took_s = {workers: schedule.scheduled_s(work, workers, nothing) for workers in (1, 4, 8, 100)}
    assert took_s == {1: 13.0, 4: 7.0, 8: 6.0, 100: 6.0}
    assert [task.took_s for task in schedule.longest_chain(work)] == [2.0, 1.0, 3.0]
    # 13 s of work: 4 workers are busy for 13 of 28 s, 3 for 13 of 24.
    assert schedule.largest_useful(work, nothing) == 3
    slow = schedule.Own(1.0, 0.5)
    assert slow.of(work) == 15.0
    # Each of the children's results waits for those before it: 2 + 1, then 1 + 8, then 3 + 1, and 5 to write all.
    assert schedule.scheduled_s(work, 8, slow) == 3 + 9 + 4 + 5


def test_tables_are_written_between_their_marks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# a\n\n<!-- x: written by `c` -->\n\nold\n\n<!-- end of x -->\n\nb\n")
    for text in (sections.table(("n", "s"), [(1, "2.0")]), "new"):
        sections.write_section("x", "c", text, page)
    assert page.read_text() == "# a\n\n<!-- x: written by `c` -->\n\nnew\n\n<!-- end of x -->\n\nb\n"
    with pytest.raises(ValueError, match="no section"):
        sections.write_section("y", "c", "", page)


def test_the_row_of_crossings_has_the_actors_that_it_says(tmp_path: Path) -> None:
    file = tmp_path / "row.foresee"
    for number in (10, 30):
        file.write_text(actors.scene(number))
        assert len(compile_test_case(load_test_case(str(file))).scene.actors) == number


def test_a_peer_that_does_not_run_is_left_out_with_the_reason(tmp_path: Path) -> None:
    broken = Peer("broken", "nothing_of_this_name", (), (), "none")
    with pytest.raises(NotMeasuredError, match=r"does not run here \(exit code 2\)") as why:
        peers.measured(broken, tmp_path)
    title = peers.PEERS[0].title
    text = peers.as_text(
        {title: {"cpu_s": 0.05, "actors": 21, "version": "1"}}, {"broken": str(why.value), title: "late"}
    )
    assert f"| {title} | 1 | 21 | 200 |" in text
    assert text.count("Not measured") == 1 and "Not measured: broken, as it does not run here" in text


def test_the_scene_of_the_peers_has_everybody(tmp_path: Path) -> None:
    child = scene.write_scene(tmp_path)
    routes = ElementTree.parse(tmp_path / "scene.vehicles.rou.xml").getroot()
    assert {one.get("id") for one in routes.iter("vehicle")} == {actor.id for actor in child.scene.actors}
    assert ElementTree.parse(tmp_path / "map.xodr").getroot().tag == "OpenDRIVE"
    wanted = {name for peer in peers.PEERS if peer.packages for name in peer.packages}
    assert not any("/" in name or ":" in name for name in wanted)
