"""What build servers, code hosts, hooks and pytest get, on the project that `foresee init` writes."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path

import jsonschema
import pytest

from foresee_dsl.report.builds.case_results import BuildOutcome, CaseResult, ReportPlace
from foresee_dsl.report.builds.junit import to_junit
from tests.support.command import pytest_program, quick_path
from tests.support.first_project import FOUND, checked, copy_first_runs, foresee, sarif_schema

etree = pytest.importorskip("lxml.etree", reason="lxml checks JUnit XML against a schema")
yaml = pytest.importorskip("yaml", reason="PyYAML reads the files of build servers")

CHILDREN = Path("out/children/main_street")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project that `foresee init` writes, with its first campaign in `out`, all from inside the folder."""
    folder = tmp_path_factory.mktemp("first") / "crossroads"
    done = foresee("init", folder)
    assert f"wrote {folder / 'scenarios' / 'main_street.foresee'}" in done.output
    before = Path.cwd()
    os.chdir(folder)
    try:
        foresee("fmt", "--check", ".")
        foresee("check", "--strict", ".")
        copy_first_runs(folder)
        options = ("--children", "1", "--jobs", "2", "--quiet", "--format", "github", "--junit", "campaign.xml")
        found = foresee("campaign", "campaign.foresee", *options, expect=1)
        Path("annotations.txt").write_text(found.stdout)
    finally:
        os.chdir(before)
    return folder


@pytest.fixture(autouse=True)
def _inside(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(project)


def ran(*command: str | Path, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a program, with this environment's programs on its path."""
    settings = {**os.environ, "PATH": quick_path(), **environment}
    return subprocess.run([*map(str, command)], cwd=cwd, capture_output=True, text=True, check=False, env=settings)


# ---- init -----------------------------------------------------------------------------------------------------------


def test_the_first_campaign_finds_a_failure_of_each_case() -> None:
    data = checked(Path("out/campaign.json").read_text())
    assert data["seeds"] == {"total": 3, "passed": 3, "failed": 0}
    assert data["findings"]
    for name in FOUND:
        assert (CHILDREN / f"main_street_{name}.foresee").is_file()


def test_the_first_hour_shows_the_finding_that_there_is(root: Path) -> None:
    text = Path("out/findings/main_street_steps_out_p1_m1/main_street_steps_out_p1_m1.foresee").read_text()
    change = next(line.strip() for line in text.splitlines() if "change " in line)
    for page in ("start/first-finding.md", "guide/ci.md"):
        assert change in (root / "docs" / page).read_text(), change


def test_init_overwrites_nothing(project: Path) -> None:
    before = {file: file.read_bytes() for file in project.rglob("*") if file.is_file()}
    done = foresee("init", expect=1)
    assert "nothing was written" in str(done.exception)
    assert {file: file.read_bytes() for file in project.rglob("*") if file.is_file()} == before


def test_what_init_writes_for_a_build_server_calls_commands_that_exist(project: Path, tmp_path: Path) -> None:
    foresee("init", tmp_path / "two words", "--ci", "gitlab", "--driver", "idm", "--install", "wheels/f.whl")
    pipeline = yaml.safe_load((tmp_path / "two words" / ".gitlab-ci.yml").read_text())
    assert pipeline["default"]["before_script"] == ["python -m pip install wheels/f.whl"]
    workflow = yaml.safe_load((project / ".github/workflows/scenarios.yml").read_text())
    steps = "\n".join(step.get("run", "") for step in workflow["jobs"]["scenarios"]["steps"]).splitlines()
    jobs = (pipeline["files"], pipeline["scenarios"])
    lines = [
        line for line in [*steps, *(line for job in jobs for line in job["script"])] if line.startswith("foresee ")
    ]
    assert len(lines) == 6
    for line in lines:
        foresee(*line.split()[1:])
    assert "campaign two_words {" in (tmp_path / "two words" / "campaign.foresee").read_text()
    foresee("check", tmp_path / "two words")


# ---- JUnit XML, annotations, SARIF ----------------------------------------------------------------------------------


def junit(text: str, root: Path) -> etree._Element:
    """Return the document, which must be valid, with its counts."""
    tree = etree.fromstring(text.encode())
    etree.XMLSchema(etree.parse(root / "tests" / "support" / "junit.xsd")).assertValid(tree)
    for holder in (tree, *tree.iter("testsuite")):
        for name, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error")):
            assert int(holder.get(name)) == len(list(holder.iter(tag)))
    names = [(case.get("classname"), case.get("name")) for case in tree.iter("testcase")]
    assert len(names) == len(set(names)), "GitLab ignores all but the first of a name"
    return tree


def test_junit_of_a_campaign_has_every_test_case_and_child(root: Path) -> None:
    tree = junit(Path("campaign.xml").read_text(), root)
    failed = {
        case.get("name"): case.find("failure").text for case in tree.iter("testcase") if len(case.findall("failure"))
    }
    assert {f"main_street_{name}" for name in FOUND} <= set(failed)
    told = failed["main_street_steps_out_p1_m1"].splitlines()
    assert told[0].startswith("F2 collision with passenger")
    assert f"{CHILDREN}/main_street_steps_out_p1_m1.foresee:" in told[-2] and "change passenger.timing" in told[-2]
    assert told[-1] == f"reproduce: foresee run {CHILDREN}/main_street_steps_out_p1_m1.foresee --driver pdm"
    assert {case.get("name") for case in tree.iter("testcase")} >= {"car_just_after", "steps_out", "hurries_out"}


def test_hostile_texts_are_valid_xml(root: Path) -> None:
    text = "\x1b[31m<script>&\"'\x00\ufffe]]>"
    made = CaseResult(
        f"a/{text}", text, BuildOutcome.FAILED, text, text, ReportPlace(text), (text,), attachments=(text,)
    )
    tree = junit(to_junit(text, [made], properties=[(text, text)]), root)
    assert "\\x1b[31m<script>&\"'\\x00\\xfffe]]>" in tree.find(".//failure").text
    for here in (".", "/", ".."):  # the folder from which a suite is run
        junit(to_junit("foresee verify", [replace(made, suite=here)]), root)


def test_annotations_of_a_campaign_stand_at_the_change_and_are_one_a_finding() -> None:
    found = checked(Path("out/campaign.json").read_text())["findings"]
    lines = Path("annotations.txt").read_text().splitlines()
    assert len(lines) == len(found)
    for line in lines:
        file, number = re.match(r"::error file=([^,]+),line=(\d+),endLine=\2,", line).groups()
        assert Path(file).read_text().splitlines()[int(number) - 1].strip().startswith("change ")


@pytest.mark.parametrize("driver", ["pdm", "idm"])
def test_verify_in_every_form(driver: str, root: Path, tmp_path: Path) -> None:
    files = [CHILDREN / f"main_street_{name}.foresee" for name in FOUND[1:]]
    command = ("verify", *files, "--driver", driver, "--jobs", "2", "--junit", tmp_path / "j.xml")
    done = foresee(*command, "--format", "sarif", "--output", tmp_path / "s.sarif", expect=None)
    assert (driver == "pdm") == (done.exit_code == 0), done.output
    tree = junit((tmp_path / "j.xml").read_text(), root)
    assert all(float(case.get("time")) > 0 for case in tree.iter("testcase"))
    log = json.loads((tmp_path / "s.sarif").read_text())
    jsonschema.Draft7Validator(sarif_schema()).validate(log)
    results = log["runs"][0]["results"]
    assert len(results) == len(list(tree.iter("failure"))) == (0 if driver == "pdm" else 2)
    for result in results:
        place = result["locations"][0]["physicalLocation"]
        line = Path(place["artifactLocation"]["uri"]).read_text().splitlines()[place["region"]["startLine"] - 1]
        assert line.strip().startswith("change ")
    assert "as expected" in done.stdout if driver == "pdm" else done.stdout


def test_run_and_assess_in_every_form(root: Path) -> None:
    address = "scenarios/main_street.foresee::steps_out"
    tree = junit(foresee("run", address, "--format", "junit").stdout, root)
    assert [case.get("name") for case in tree.iter("testcase")] == ["steps_out"]
    checked(foresee("run", address, "--json").stdout)
    command = ("assess", address, "--driver", "idm", "--driver", "pdm", "--jobs", "2", "--format", "junit")
    tree = junit(foresee(*command, expect=None).stdout, root)
    assert [case.get("name") for case in tree.iter("testcase")] == ["steps_out [idm]", "steps_out [pdm]"]


# ---- pytest ---------------------------------------------------------------------------------------------------------


def run_pytest(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    installed = any(entry.value == "foresee_dsl.pytest_plugin" for entry in entry_points(group="pytest11"))
    plugin = () if installed else ("-p", "foresee_dsl.pytest_plugin")  # an environment made before there was one
    return ran(pytest_program(), *plugin, "-p", "no:cacheprovider", *arguments, cwd=cwd)


def test_pytest_says_what_a_failure_is_and_keeps_its_trace(project: Path, tmp_path: Path) -> None:
    found = CHILDREN / f"main_street_{FOUND[2]}.foresee"
    file = found.with_name("kept.foresee")
    file.write_text(found.read_text().replace("  origin {", "  expected pdm passes\n\n  origin {"))
    options = ("--foresee-driver", "pdm", "-k", "kept", "--foresee-traces", tmp_path, "--junit-xml", tmp_path / "j.xml")
    done = run_pytest(file.parent, *options)
    file.unlink()
    assert done.returncode == 1, done.stdout + done.stderr
    assert "1 failed, 3 deselected" in done.stdout
    for said in (
        "came back: F2 collision with passenger (pedestrian)",
        "expected: pdm passes",
        "'passenger' (pedestrian) steps onto the road",
        f"{file}:5: change passenger.timing: 1.00 => 1.36",
        f"reproduce: foresee run {file} --driver pdm",
        "what happened",
    ):
        assert said in done.stdout, said
    trace = tmp_path / "main_street_steps_out_p1_m1.npz"
    assert trace.is_file()
    kept = {one.get("name"): one.get("value") for one in etree.parse(tmp_path / "j.xml").iter("property")}
    assert kept == {"verdict": "came_back", "trace": str(trace)}


def test_pytest_takes_what_files_record_and_spreads_over_processes() -> None:
    done = run_pytest("out/children", "--foresee-driver", "recorded", "-n", "2", "-k", "out_p1_m1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout


def test_pytest_shows_mistakes_and_stops_at_the_first(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.foresee").write_text("foresee 1\n\nscenario s {\n  end after 5 kmh\n}\n")
    done = run_pytest(".", "--foresee-driver", "pdm", "-x", cwd=tmp_path)
    assert "a.foresee:4:" in done.stdout and "FS005" in done.stdout and "Traceback" not in done.stdout
    assert "b.foresee:4:" not in done.stdout


def test_pytest_without_a_driver_imports_nothing_and_says_what_to_do(project: Path) -> None:
    code = (
        "import sys, pytest\n"
        "code = pytest.main(['-q', '-p', 'no:cacheprovider', '.'])\n"
        "heavy = {'numpy', 'libsumo', 'pydantic', 'foresee_dsl.language'} & set(sys.modules)\n"
        "sys.exit(9 if heavy else code)\n"
    )
    done = ran(sys.executable, "-c", code, cwd=project)
    assert done.returncode == pytest.ExitCode.NO_TESTS_COLLECTED, done.stdout + done.stderr
    assert "no driver is named: write `--foresee-driver pdm`" in done.stdout
    named = run_pytest("scenarios/main_street.foresee")
    assert named.returncode == pytest.ExitCode.USAGE_ERROR
    assert "no tests were made of `.foresee` files, as no driver is named" in named.stdout


def test_pytest_and_verify_run_the_same_tests_of_a_kept_suite_and_exit_alike(tmp_path: Path) -> None:
    suite = tmp_path / "regressions"
    foresee("keep", *(f"main_street_{name}" for name in FOUND[1:]), "scenarios/main_street.foresee::steps_out", "--to",
            suite)  # fmt: skip
    assert (suite / "parents").is_dir()
    findings = {one["name"]: one for one in checked(Path("out/campaign.json").read_text())["findings"]}
    index = (suite / "README.md").read_text()  # tells the form that is kept, not the mutant that failed first
    assert findings["main_street_steps_out_p1_m1"]["minimised"]["sentence"] in index
    for driver in ("pdm", "idm", "recorded"):
        verified = foresee("verify", suite, *(("--driver", driver) if driver != "recorded" else ()), "--jobs", "2",
                           "--json", expect=None)  # fmt: skip
        tests = checked(verified.stdout)["tests"]
        done = run_pytest(suite, "--foresee-driver", driver, "-rA")
        assert done.returncode == verified.exit_code, (driver, done.stdout, verified.stdout)
        ran_by_pytest = {*re.findall(r"^(?:PASSED|FAILED) \S*?(\w+)\.foresee::", done.stdout, re.MULTILINE)}
        assert ran_by_pytest == {Path(test["file"]).stem for test in tests}, done.stdout
        good = sum(test["status"] == "as_expected" for test in tests)
        assert f"{good} passed" in done.stdout if good else f"{len(tests)} failed" in done.stdout, done.stdout


GOOD = """foresee 1

scenario s {
  network n {
    junction a at (0 m, 0 m)
    junction b at (90 m, 0 m)
    road r from a to b
  }
  ego: car.sedan {
    route [r]
  }
  expect never collision(ego)
  end after 5 s
}
"""

# ---- hooks, the action, the template --------------------------------------------------------------------------------


def git(folder: Path, *arguments: str) -> str:
    names = ("-c", "user.name=Someone", "-c", "user.email=someone@example.com", "-c", "commit.gpgsign=false")
    return subprocess.run(["git", *names, *arguments], cwd=folder, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("ending", ["", "-installed"])
def test_the_hooks_run_in_pre_commit(root: Path, tmp_path: Path, ending: str) -> None:
    pytest.importorskip("pre_commit", reason="pre-commit is not installed")
    hooks, used = tmp_path / "hooks", tmp_path / "used"
    for folder in (hooks, used):
        folder.mkdir()
        git(folder, "init", "-q")
    # Installing the tool needs a network; all else is pre-commit's own way.
    text = (root / ".pre-commit-hooks.yaml").read_text()
    assert text.count("language: python") == 2
    (hooks / ".pre-commit-hooks.yaml").write_text(text.replace("language: python", "language: system"))
    git(hooks, "add", ".")
    git(hooks, "commit", "-qm", "hooks")
    used_hooks = {"repo": str(hooks), "rev": git(hooks, "rev-parse", "HEAD").strip(),
                  "hooks": [{"id": f"foresee-fmt{ending}"}, {"id": f"foresee-check{ending}"}]}  # fmt: skip
    (used / ".pre-commit-config.yaml").write_text(yaml.safe_dump({"repos": [used_hooks]}))
    (used / "s.foresee").write_text(GOOD.replace("    route", "      route"))
    git(used, "add", ".")

    def hook() -> subprocess.CompletedProcess[str]:
        command = (sys.executable, "-m", "pre_commit", "run", "--all-files")
        return ran(*command, cwd=used, PRE_COMMIT_HOME=str(tmp_path / "home"))

    first = hook()
    assert first.returncode == 1 and "foresee fmt" in first.stdout and "Failed" in first.stdout, (
        first.stdout + first.stderr
    )
    assert "foresee check" in first.stdout
    git(used, "add", ".")
    second = hook()
    assert second.returncode == 0 and second.stdout.count("Passed") == 2, second.stdout
    (used / "s.foresee").write_text((used / "s.foresee").read_text().replace("5 s", "5 kmh"))
    git(used, "add", ".")
    assert "FS005" in hook().stdout


def test_the_steps_of_the_action(root: Path, project: Path, tmp_path: Path) -> None:
    """Each step's shell text as GitHub calls it; pip resolves the checkout without fetching or installing anything."""
    action = yaml.safe_load((root / "action.yml").read_text())
    inputs = {name: str(value.get("default", "")) for name, value in action["inputs"].items()}
    inputs |= {
        "suite": str(CHILDREN / f"main_street_{FOUND[2]}.foresee"),
        "campaign": "campaign.foresee",
        "report": "kept",
    }
    inputs["options"] = "--quiet --jobs 2 --children 1 --store out/store"
    source = tmp_path / "action"
    source.mkdir()
    for name in ("foresee_dsl", "grammars", "templates", "scenarios"):
        (source / name).symlink_to(root / name)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / name, source / name)
    runner = {
        "GITHUB_ACTION_PATH": str(source),
        "GITHUB_WORKSPACE": str(project),
        "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md"),
        "PIP_DRY_RUN": "1",
        "PIP_NO_DEPS": "1",
        "PIP_NO_BUILD_ISOLATION": "0",  # pip's odd way to say: none
    }
    steps = []
    for step in action["runs"]["steps"]:
        if "run" not in step:
            assert step["uses"].startswith("actions/")
            continue
        values = {
            name: re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda found: inputs[found[1]], text)
            for name, text in step.get("env", {}).items()
        }
        shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]  # as GitHub calls `shell: bash`
        done = ran(*shell, cwd=project, **runner, **values)
        steps.append((step["name"], done.returncode, done.stdout + done.stderr))
    codes = {name: code for name, code, _ in steps}
    assert (codes["Install"], codes["Check the files"], codes["Run kept failures again"]) == (0, 0, 0), steps
    assert (codes["Run the campaign"], codes["Summary"]) == (1, 0) and "::error file=" in steps[-2][2], steps
    assert "'passenger' (pedestrian) steps onto the road" in (tmp_path / "summary.md").read_text()
    for report in ("verify.xml", "campaign.xml"):
        junit((project / "kept" / report).read_text(), root)
    shutil.rmtree(project / "kept")


def test_mistakes_in_files_do_not_hide_failures_that_came_back(root: Path, project: Path) -> None:
    action = yaml.safe_load((root / "action.yml").read_text())["runs"]["steps"]
    workflow = yaml.safe_load((project / ".github/workflows/scenarios.yml").read_text())["jobs"]["scenarios"]["steps"]
    for steps in (action, workflow):
        checked_at = [step.get("name") for step in steps].index("Check the files")
        for step in steps[checked_at + 1 :]:
            assert "!cancelled()" in step["if"] or step["if"] == "always()", step


def test_the_template_of_gitlab(root: Path, project: Path) -> None:
    template = yaml.safe_load((root / "ci" / "gitlab.yml").read_text())
    variables = {**template["variables"], "FORESEE_REPORT": "kept"}
    variables["FORESEE_SUITE"] = str(CHILDREN / "main_street_steps_out_p1_m1.foresee")
    script = [line for job in ("foresee-check", "foresee-verify") for line in template[job]["script"]]
    done = ran("bash", "-eo", "pipefail", "-c", "\n".join(script), cwd=project, **variables)
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert all(template[job]["extends"] == ".foresee" for job in template if job.startswith("foresee-"))
    junit((project / "kept" / "verify.xml").read_text(), root)
    refused = ran("bash", "-c", template[".foresee"]["before_script"][0], **variables)
    assert "say what pip installs" in refused.stderr
    shutil.rmtree(project / "kept")
