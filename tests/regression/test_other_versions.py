"""`foresee verify` says when a test was recorded with another version of its driver or of this tool."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl import __version__
from foresee_dsl.campaign.regression.suite import SuiteTest
from foresee_dsl.campaign.regression.verify import other_version
from foresee_dsl.language.model import Origin


def test_another_version_of_the_driver_or_the_tool_is_said() -> None:
    def said(driver: str, tool: str, run_with: str = "pdm") -> str:
        return other_version(SuiteTest(Path("x.foresee"), origin=Origin(driver=driver, tool=tool)), run_with, "4")

    assert said("pdm 4", __version__) == ""
    assert said("pdm 3", __version__) == "it was recorded with pdm 3, and is now run with pdm 4"
    assert "with foresee-dsl 0.0.1, and is now run with foresee-dsl" in said("pdm 4", "0.0.1")
    assert said("pdm 3", __version__, run_with="idm") == "", "another driver was asked for"
    assert other_version(SuiteTest(Path("x.foresee")), "pdm", "4") == ""
