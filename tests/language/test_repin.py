"""Stale clips and mutants: the effect of their parent's edit, and the new pins. With a real git repository."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.documents import plain
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.language.repinning.repin import PinState, describe, plan, summary, write
from tests.support.repin_project import Repository


@pytest.fixture
def project(tmp_path: Path) -> Repository:
    return Repository(tmp_path)


def said(changes: object) -> list[str]:
    return [str(change) for change in changes]  # type: ignore[attr-defined]


def test_nothing_to_do(project: Repository) -> None:
    derived_files = plan([project.root])
    assert [derived.state for derived in derived_files] == [PinState.FRESH] * 3
    assert write(derived_files) == ()
    assert summary(derived_files) == "3 up to date"
    assert describe(derived_files[0]) == ""


def test_what_reaches_a_clip_and_what_does_not(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    project.edit(project.scenario, "36 km/h", "40 km/h")
    project.edit(project.network, "lanes 2", "lanes 3")
    clip = plan([project.clip])[0]
    assert clip.state is PinState.STALE and clip.has_old_parent
    assert said(clip.reaching) == ["weather.rain: 0.3 => 0.5 (+0.2)", "road main.lanes: 2 => 3 (+1)"]
    assert said(clip.overridden) == ["ego.start speed: 36 km/h => 40 km/h (+4 km/h)"]
    assert clip.commit and project.git("rev-parse", "HEAD").startswith(clip.commit)


def test_an_edit_of_another_case_or_of_layout_is_no_edit(project: Repository) -> None:
    project.edit(project.scenario, "case far { gap = 60 m }", "case far { gap = 70 m }  # further")
    project.edit(project.scenario, "36 km/h", "10 m/s")
    assert {derived.state for derived in plan([project.root])} == {PinState.FRESH}


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
    derived_files = plan([project.clip])
    assert [derived.file for derived in derived_files] == [project.clip, *project.mutants]
    assert [derived.follows for derived in derived_files] == [False, True, True]
    assert said(derived_files[1].reaching) == ["weather.rain: 0.3 => 0.5 (+0.2)"]
    before = {derived.file: derived.file.read_text() for derived in derived_files}
    assert write(derived_files) == tuple(before)
    for derived in derived_files:
        assert derived.file.read_text() == before[derived.file].replace(derived.pin, derived.new_pin)
        load_test_case(derived.file)
    assert {derived.state for derived in plan([project.root])} == {PinState.FRESH}


def test_line_ends_stay(project: Repository) -> None:
    project.clip.write_bytes(project.clip.read_bytes().replace(b"\n", b"\r\n"))
    before = project.clip.read_bytes()
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    derived_files = plan([project.clip])
    write(derived_files)
    assert project.clip.read_bytes() == before.replace(derived_files[0].pin.encode(), derived_files[0].new_pin.encode())


def test_a_comment_that_holds_the_pin_stays(project: Repository) -> None:
    pin = plan([project.clip])[0].pin
    project.edit(project.clip, "foresee 1\n", f"foresee 1\n# was {pin}\n")
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    write(plan([project.clip]))
    assert f"# was {pin}\n" in project.clip.read_text()
    load_test_case(project.clip)


def test_a_value_that_moved_under_a_mutant_is_a_conflict(project: Repository) -> None:
    project.edit(project.clip, "speed 8.00 m/s {\n", "speed 8.00 m/s {\n    timing 0.90\n")
    derived_files = plan([project.root])
    assert [derived.state for derived in derived_files] == [PinState.FRESH, PinState.CONFLICT, PinState.CONFLICT]
    (mistake,) = derived_files[1].mistakes
    assert mistake.code == "FS123" and "lead.timing is 0.90 in the clip now, not 1.00" in mistake.message
    assert said(derived_files[1].overridden) == ["added lead.timing: 0.90"]
    before = project.mutants[0].read_bytes()
    assert write(derived_files) == ()
    assert project.mutants[0].read_bytes() == before
    text = describe(derived_files[1])
    assert text.startswith(f"{project.mutants[0]}: conflict with") and "FS123" in text


def test_what_does_not_validate_is_a_conflict(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    derived_files = plan([project.clip], lambda case: [Diagnostic("FS250", f"{case.scenario.name} is off the road")])
    assert [derived.state for derived in derived_files] == [PinState.CONFLICT]
    assert derived_files[0].mistakes[0].message == "lead_brakes_p1 is off the road"


def test_files_derived_from_a_conflict_are_blocked(project: Repository) -> None:
    project.edit(project.scenario, "case near { gap = 20 m }", "case close { gap = 20 m }")
    derived_files = plan([project.root])
    assert [derived.state for derived in derived_files] == [PinState.CONFLICT, PinState.BLOCKED, PinState.BLOCKED]
    assert "no case 'near'" in derived_files[0].mistakes[0].message
    assert summary(derived_files) == "1 in conflict, 2 blocked"


def test_a_mutant_whose_clip_is_stale_and_not_named_is_blocked(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    (mutant,) = plan([project.mutants[0]])
    assert mutant.state is PinState.BLOCKED
    assert mutant.mistakes[0].code == "FS135" and "is stale itself" in mutant.mistakes[0].message
    assert "blocked" in describe(mutant)


def test_without_git_the_old_version_is_unknown(tmp_path: Path) -> None:
    project = Repository(tmp_path, git=False)
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    clip, mutant, _ = plan([project.clip])
    assert (clip.state, clip.has_old_parent, clip.reaching) == (PinState.STALE, False, ())
    assert "the change is unknown" in describe(clip)
    assert mutant.follows and mutant.state is PinState.STALE
    write((clip, mutant))
    load_test_case(project.mutants[0])


def test_a_version_that_was_never_committed_is_unknown(project: Repository) -> None:
    pin = plan([project.clip])[0].pin
    project.edit(project.clip, pin, "sha256:000000000000")
    clip = plan([project.clip])[0]
    assert (clip.state, clip.has_old_parent) == (PinState.STALE, False)
    assert clip.new_pin == pin


def test_a_mutant_of_a_mutant_follows(project: Repository) -> None:
    pin = load_test_case(project.mutants[0]).meaning
    head = f'mutant again of "lead_brakes_p1_m1.foresee" pin {pin}'
    text = f"foresee 1\n\n{head} {{\n  change lead.delay: 0.00 s => 0.50 s\n}}\n"
    again = project.write("children/again.foresee", text)
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    derived_files = plan([project.clip])
    assert {derived.state for derived in derived_files} == {PinState.STALE} and len(derived_files) == 4
    write(derived_files)
    load_test_case(again)


def test_a_scenario_cannot_be_pinned_again(project: Repository) -> None:
    for path, code in ((project.scenario, "FS132"), (project.root / "none.foresee", "FS130")):
        with pytest.raises(InputError) as caught:
            plan([path])
        assert caught.value.diagnostics[0].code == code


def test_a_file_that_is_its_own_parent_ends(project: Repository) -> None:
    project.edit(project.mutants[0], "lead_brakes_p1.foresee", "lead_brakes_p1_m1.foresee")
    mutant = next(file for file in plan([project.mutants[0]]) if file.file == project.mutants[0])
    assert mutant.state is PinState.CONFLICT


def test_in_words(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.5")
    project.edit(project.scenario, "36 km/h", "40 km/h")
    derived_files = plan([project.clip])
    clip = derived_files[0]
    assert describe(clip, ("pass", "F5 rear collision with lead at 2.10 s"), written=True) == (
        f"{project.clip}: {clip.parent} changed\n"
        f"  pin {clip.pin} => {clip.new_pin} (written)\n"
        f"  the pinned version of the parent is in commit {clip.commit}\n"
        "  reaches this file:\n"
        "    Environment\n"
        "      ~ weather.rain: 0.3 => 0.5 (+0.2)\n"
        "  does not reach this file: it has its own statement, or does not use the changed one:\n"
        "    Ego\n"
        "      ~ ego.start speed: 36 km/h => 40 km/h (+4 km/h)\n"
        "  run: pass => F5 rear collision with lead at 2.10 s\n\n"
    )
    assert f"follows {project.clip}" in describe(derived_files[1], ("pass", "pass"))
    assert "run: the same, pass" in describe(derived_files[1], ("pass", "pass"))
    assert summary(derived_files) == "3 to re-pin (`--write` does it)"
    assert plain(clip)["reaching"][0]["path"] == "weather.rain"
