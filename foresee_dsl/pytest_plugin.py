"""The pytest plugin: `pytest regressions --foresee-driver pdm` makes a test of each case of each `.foresee` file.

Without `--foresee-driver` (or `foresee_driver` in pytest's ini file) it makes no tests and imports nothing heavy; if no
other test ran either, it says how to name a driver.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from foresee_dsl.campaign.regression.suite import SuiteTest
    from foresee_dsl.report.builds.case_results import CaseResult

_SKIPPED = pytest.StashKey[bool]()
"""True if there were `.foresee` files but no tests of them, because no driver is named."""
RECORDED = "recorded"
"""Value of `--foresee-driver` that runs each recorded failure with its file's driver, and other cases with `pdm`."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options; each can also stand in pytest's ini file."""
    group = parser.getgroup("foresee", "test cases of .foresee files")
    for name, metavar, help_ in (
        (
            "driver",
            "NAME",
            f"make a test of each case of .foresee files, with this driver ('{RECORDED}': each file's own)",
        ),
        ("traces", "DIR", "keep the trace of every run in this folder (else those of failures, in pytest's own)"),
    ):
        group.addoption(f"--foresee-{name}", metavar=metavar, default=None, help=help_)
        parser.addini(f"foresee_{name}", help_, default="")
    group.addoption("--foresee-seed", type=int, metavar="N", default=0, help="seed of all random choices")
    group.addoption(
        "--foresee-run-programs", action="store_true", help="start the programs that files record as external drivers"
    )
    group.addoption("--foresee-allow-outside", action="store_true", help="files may use files outside the project")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect `.foresee` files if a driver is named."""
    if file_path.suffix != ".foresee":
        return None
    if not _option(parent.config, "driver"):
        parent.config.stash[_SKIPPED] = True
        return None
    collected: pytest.Collector = ForeseeFile.from_parent(parent, path=file_path)
    return collected


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, exitstatus: int, config: pytest.Config) -> None:
    """Say how to name a driver if no test ran for lack of one."""
    if config.stash.get(_SKIPPED, False) and exitstatus in (
        pytest.ExitCode.NO_TESTS_COLLECTED,
        pytest.ExitCode.USAGE_ERROR,
    ):
        terminalreporter.write_line(
            f"foresee: no tests were made of `.foresee` files, as no driver is named: write `--foresee-driver pdm` "
            f"(`--foresee-driver {RECORDED}` drives each with its own), or `foresee_driver = pdm` in pytest's ini file"
        )


class ForeseeFile(pytest.File):
    """One file: a test per case of a scenario and for a mutant; no tests for files such as networks."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield the tests, named as in addresses: `scenario7.foresee::r02`."""
        from foresee_dsl.errors import InputError
        from foresee_dsl.report.builds.pytest_runs import tests_in

        allowed = bool(self.config.getoption("--foresee-allow-outside"))
        try:
            for name, test in tests_in(_relative_name(self), allow_outside=allowed):
                yield ForeseeItem.from_parent(self, name=name, test=test)
        except InputError as error:
            raise self.CollectError(_mistakes(error)) from None


class ForeseeItem(pytest.Item):
    """One test case, which is run once."""

    def __init__(self, *, test: SuiteTest, **others: Any) -> None:  # noqa: ANN401 - pytest's own
        super().__init__(**others)
        self.test = test

    def runtest(self) -> None:
        """Run the test case; fail if it does not end as expected."""
        from foresee_dsl.report.builds.pytest_runs import DriveOptions, drive

        driver = _option(self.config, "driver")
        options = DriveOptions(
            driver="" if driver == RECORDED else driver,
            seed=int(self.config.getoption("--foresee-seed")),
            traces=_traces(self),
            keep_all=bool(_option(self.config, "traces")),
            allow_outside=bool(self.config.getoption("--foresee-allow-outside")),
            run_programs=bool(self.config.getoption("--foresee-run-programs")),
        )
        result, sections = drive(self.test, options)
        self.user_properties += [("verdict", result.rule), *(("trace", file) for file in result.attachments)]
        for title, text in sections:
            self.add_report_section("call", title, text)
        if result.outcome != "passed":
            raise ForeseeFailure(result)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:  # noqa: ANN401
        """Return how the run ended, what happened, where, and how to repeat it; errors in files as in `foresee
        check`."""
        from foresee_dsl.errors import InputError

        if isinstance(excinfo.value, ForeseeFailure):
            return excinfo.value.result.text
        if isinstance(excinfo.value, InputError):
            return _mistakes(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return the file, the case's line, and the address."""
        from foresee_dsl.report.builds.case_results import place_of

        span = place_of(self.test.address).span
        return self.path, span.line - 1 if span else None, self.test.address


class ForeseeFailure(Exception):  # noqa: N818 - a test that failed, not an error
    """A run that did not end as expected."""

    def __init__(self, result: CaseResult) -> None:
        super().__init__(result.message)
        self.result = result


def _option(config: pytest.Config, name: str) -> str:
    return str(config.getoption(f"--foresee-{name}") or config.getini(f"foresee_{name}") or "")


def _traces(item: ForeseeItem) -> Path:
    """Return the folder for traces: that of the option, or one in pytest's temporary folder of this session."""
    named = _option(item.config, "traces")
    if named:
        return item.config.invocation_params.dir / named
    # The fixture `tmp_path_factory` returns this object, but pytest has no public way to it for items that are not
    # functions (seen in 9.2). A folder of our own would escape pytest's `--basetemp` and the removal of old folders.
    factory: pytest.TempPathFactory = item.config._tmp_path_factory  # type: ignore[attr-defined]
    return factory.getbasetemp() / "foresee"


def _relative_name(collector: ForeseeFile) -> str:
    """Return the file's name for messages: relative to the folder in which pytest was called, if it lies below."""
    folder = collector.config.invocation_params.dir
    path = collector.path
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)


def _mistakes(error: Any) -> str:  # noqa: ANN401 - an InputError, whose module is imported late
    from foresee_dsl.language.messages.diagnostics import render_all

    return render_all(error.diagnostics)
