"""Stale children: what their parent's edit does to them, and the new pins. With a real git repository."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.documents import plain
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.codes.names import MISSING_FILE, STALE_PIN, WRONG_KIND, WRONG_WAS
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.language.repinning.repin import State, describe, plan, summary, write
from tests.support.repin_project import Repository


@pytest.fixture
def project(tmp_path: Path) -> Repository:
    return Repository(tmp_path)


def said(changes: object) -> list[str]:
    return [str(change) for change in changes]  # type: ignore[attr-defined]


def test_nothing_to_do(project: Repository) -> None:
    children = plan([project.root])
    assert [child.state for child in children] == [State.FRESH] * 3
    assert write(children) == ()
    assert summary(children) == "3 up to date"
    assert describe(children[0]) == ""


def test_what_reaches_a_clip_and_what_does_not(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    project.edit(project.scenario, "36 km/h", "40 km/h")
    project.edit(project.network, "lanes 2", "lanes 3")
    clip = plan([project.clip])[0]
    assert clip.state is State.STALE and clip.known
    assert said(clip.reaching) == ["weather.rain: 0.3 => 0.5 (+0.2)", "road main.lanes: 2 => 3 (+1)"]
    assert said(clip.overridden) == ["ego.start speed: 36 km/h => 40 km/h (+4 km/h)"]
    assert clip.commit and project.git("rev-parse", "HEAD").startswith(clip.commit)


def test_an_edit_of_another_case_or_of_layout_is_no_edit(project: Repository) -> None:
    project.edit(project.scenario, "case far { gap = 60 m }", "case far { gap = 70 m }  # further")
    project.edit(project.scenario, "36 km/h", "10 m/s")
    assert {child.state for child in plan([project.root])} == {State.FRESH}


def test_the_pinned_version_is_found_behind_newer_ones(project: Repository) -> None:
    first = project.git("rev-parse", "HEAD")
    for speed in (37, 38, 39):
        project.edit(project.scenario, f"{speed - 1} km/h", f"{speed} km/h")
        project.commit()
    clip = plan([project.clip])[0]
    assert first.startswith(clip.commit)
    assert said(clip.overridden) == ["ego.start speed: 36 km/h => 39 km/h (+3 km/h)"]


def test_writing_changes_one_line_of_each_and_mutants_follow(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    children = plan([project.clip])
    assert [child.file for child in children] == [project.clip, *project.mutants]
    assert [child.follows for child in children] == [False, True, True]
    assert said(children[1].reaching) == ["weather.rain: 0.3 => 0.5 (+0.2)"]
    before = {child.file: child.file.read_text() for child in children}
    assert write(children) == tuple(before)
    for child in children:
        assert child.file.read_text() == before[child.file].replace(child.pin, child.new_pin)
        load_test_case(child.file)
    assert {child.state for child in plan([project.root])} == {State.FRESH}


def test_line_ends_stay(project: Repository) -> None:
    project.clip.write_bytes(project.clip.read_bytes().replace(b"\n", b"\r\n"))
    before = project.clip.read_bytes()
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    children = plan([project.clip])
    write(children)
    assert project.clip.read_bytes() == before.replace(children[0].pin.encode(), children[0].new_pin.encode())


def test_a_comment_that_holds_the_pin_stays(project: Repository) -> None:
    pin = plan([project.clip])[0].pin
    project.edit(project.clip, "foresee 1\n", f"foresee 1\n# was {pin}\n")
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    write(plan([project.clip]))
    assert f"# was {pin}\n" in project.clip.read_text()
    load_test_case(project.clip)


def test_a_value_that_moved_under_a_mutant_is_a_conflict(project: Repository) -> None:
    project.edit(project.clip, "speed 8.00 m/s {\n", "speed 8.00 m/s {\n    timing 0.90\n")
    children = plan([project.root])
    assert [child.state for child in children] == [State.FRESH, State.CONFLICT, State.CONFLICT]
    (mistake,) = children[1].mistakes
    assert mistake.code == WRONG_WAS and "lead.timing is 0.90 in the clip now, not 1.00" in mistake.message
    assert said(children[1].overridden) == ["added lead.timing: 0.90"]
    before = project.mutants[0].read_bytes()
    assert write(children) == ()
    assert project.mutants[0].read_bytes() == before
    text = describe(children[1])
    assert text.startswith(f"{project.mutants[0]}: conflict with") and "FS123" in text


def test_what_does_not_validate_is_a_conflict(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    children = plan([project.clip], lambda case: [Diagnostic("FS250", f"{case.scenario.name} is off the road")])
    assert [child.state for child in children] == [State.CONFLICT]
    assert children[0].mistakes[0].message == "lead_brakes_p1 is off the road"


def test_children_of_a_conflict_are_blocked(project: Repository) -> None:
    project.edit(project.scenario, "case near { gap = 20 m }", "case close { gap = 20 m }")
    children = plan([project.root])
    assert [child.state for child in children] == [State.CONFLICT, State.BLOCKED, State.BLOCKED]
    assert "no case 'near'" in children[0].mistakes[0].message
    assert summary(children) == "1 in conflict, 2 blocked"


def test_a_mutant_whose_clip_is_stale_and_not_named_is_blocked(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    (child,) = plan([project.mutants[0]])
    assert child.state is State.BLOCKED
    assert child.mistakes[0].code == STALE_PIN and "is stale itself" in child.mistakes[0].message
    assert "blocked" in describe(child)


def test_without_git_the_old_version_is_unknown(tmp_path: Path) -> None:
    project = Repository(tmp_path, git=False)
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    clip, mutant, _ = plan([project.clip])
    assert (clip.state, clip.known, clip.reaching) == (State.STALE, False, ())
    assert "the change is unknown" in describe(clip)
    assert mutant.follows and mutant.state is State.STALE
    write((clip, mutant))
    load_test_case(project.mutants[0])


def test_a_version_that_was_never_committed_is_unknown(project: Repository) -> None:
    pin = plan([project.clip])[0].pin
    project.edit(project.clip, pin, "sha256:000000000000")
    clip = plan([project.clip])[0]
    assert (clip.state, clip.known) == (State.STALE, False)
    assert clip.new_pin == pin


def test_a_mutant_of_a_mutant_follows(project: Repository) -> None:
    pin = load_test_case(project.mutants[0]).meaning
    head = f'mutant again of "lead_brakes_p1_m1.foresee" pin {pin}'
    text = f"foresee 1\n\n{head} {{\n  change lead.delay: 0.00 s => 0.50 s\n}}\n"
    again = project.write("children/again.foresee", text)
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    children = plan([project.clip])
    assert {child.state for child in children} == {State.STALE} and len(children) == 4
    write(children)
    load_test_case(again)


def test_what_is_no_child(project: Repository) -> None:
    for path, code in ((project.scenario, WRONG_KIND), (project.root / "none.foresee", MISSING_FILE)):
        with pytest.raises(InputError) as caught:
            plan([path])
        assert caught.value.diagnostics[0].code == code


def test_a_child_of_itself_ends(project: Repository) -> None:
    project.edit(project.mutants[0], "lead_brakes_p1.foresee", "lead_brakes_p1_m1.foresee")
    child = next(found for found in plan([project.mutants[0]]) if found.file == project.mutants[0])
    assert child.state is State.CONFLICT


def test_in_words(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    project.edit(project.scenario, "36 km/h", "40 km/h")
    children = plan([project.clip])
    clip = children[0]
    assert describe(clip, ("pass", "F5 rear collision with lead at 2.10 s"), written=True) == (
        f"{project.clip}: {clip.parent} changed\n"
        f"  pin {clip.pin} => {clip.new_pin} (written)\n"
        f"  the parent as pinned is in commit {clip.commit}\n"
        "  reaches this child:\n"
        "    Environment\n"
        "      ~ weather.rain: 0.3 => 0.5 (+0.2)\n"
        "  does not reach it: the child has its own, or has no part in it:\n"
        "    Ego\n"
        "      ~ ego.start speed: 36 km/h => 40 km/h (+4 km/h)\n"
        "  run: pass => F5 rear collision with lead at 2.10 s\n\n"
    )
    assert f"follows {project.clip}" in describe(children[1], ("pass", "pass"))
    assert "run: the same, pass" in describe(children[1], ("pass", "pass"))
    assert summary(children) == "3 to re-pin (`--write` does it)"
    assert plain(clip)["reaching"][0]["path"] == "weather.rain"
