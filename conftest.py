"""What the tests, those of the plug-ins too, share: a private cache, the repository's folders, small helpers."""

from __future__ import annotations

import gc
import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from foresee_dsl.drivers.consent import allowing
from tests.support.command import SERVER, fork_interpreters, start_server
from tests.support.goldens import Golden

if TYPE_CHECKING:
    from tests.support.scenes import Town

ROOT = Path(__file__).resolve().parent
SCENARIOS = ROOT / "scenarios"
CARLA = ROOT.parent / "shared" / "data" / "carla"


settings.register_profile("ours", deadline=None)  # the first call of a kernel loads it
settings.load_profile("ours")


@pytest.fixture(scope="session", autouse=True)
def _private_cache(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> None:
    """Keep compiled networks of the tests apart from the user's, and share them between the workers of one run."""
    base = tmp_path_factory.getbasetemp()
    os.environ["FORESEE_CACHE"] = str((base if worker_id == "master" else base.parent) / "cache")


@pytest.fixture(scope="session", autouse=True)
def _quick_interpreters(worker_id: str, _private_cache: None) -> None:
    """Fork the interpreters that campaigns start, where many tests share the cost of the server that is forked."""
    if worker_id != "master":
        fork_interpreters()


@pytest.fixture(autouse=True)
def _consent_ends_with_the_test() -> Iterator[None]:
    """Start no program in a test because another test has consented to it."""
    with allowing(()):
        yield


def pytest_configure(config: pytest.Config) -> None:
    """Start the server that forks commands once for all workers, before they collect."""
    if config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        os.environ[SERVER] = start_server()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the flag that writes golden files anew instead of comparing with them."""
    parser.addoption("--rewrite-goldens", action="store_true", help="write golden files (see `git diff` afterwards)")


LONG = (
    "test_fortnight.py",
    "test_readme.py",
    "test_repeats.py",
    "test_start_pages.py",
    "test_ci.py",
    "test_miniature.py",
    "test_chaos.py",
    "test_diff_properties.py",
    "test_surroundings.py",
    "test_received_files.py",
    "test_isolation.py",
    "test_wheel.py",
    "test_init_drivers.py",
    "test_contract.py",
    "test_plan.py",
    "test_exit_codes.py",
    "test_spoilt_process.py",
    "test_commands.py",
    "test_triage.py",
    "test_fixes.py",
    "test_library.py",
    "test_sure.py",
    "test_words.py",
    "test_bad_drivers.py",
    "test_grpc.py",
    "test_numbers.py",
    "test_carla_towns.py",
    "test_broken_expectations.py",
    "test_kept.py",
)
"""Files with the longest tests, the longest first: a long test that comes last keeps one worker busy alone."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin the share of each worker with its part of the longest files.

    `--dist worksteal` gives each worker an equal number of tests in the order of the collection, and lets a worker that
    has ended take from the end of another's: with all long files in front, the first worker had them all.
    """
    files = {name: [item for item in items if item.path.name == name] for name in LONG}
    rest = iter([item for item in items if item.path.name not in files])
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    size = -(-len(items) // workers)
    shares: list[pytest.Item] = []
    for worker in range(workers):
        share = [item for name in LONG[worker::workers] for item in files[name]]
        shares += [*share, *itertools.islice(rest, max(0, size - len(share)))]
    items[:] = [*shares, *rest]


def pytest_collection_finish() -> None:
    """Leave what the collection created, thousands of modules and tests, out of all further garbage collections.

    Measured on 350 tests of the language after all had been collected: 56 s of CPU time instead of 61 to 71 s.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def golden(request: pytest.FixtureRequest) -> Golden:
    """Compare text with a golden file: `golden(text, file)`; see `tests.support.goldens`."""
    return Golden(rewrite=bool(request.config.getoption("--rewrite-goldens")))


@pytest.fixture(scope="session")
def town() -> Town:
    """The grid of 4 x 4 junctions that simulations share, with signals at n11 and n22."""
    from tests.support.scenes import Town
    from tests.support.worlds import grid_net

    return Town(grid_net())


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(scope="session")
def scenarios() -> Path:
    """The bundled scenarios."""
    return SCENARIOS


@pytest.fixture(scope="session")
def carla() -> Path:
    """Real CARLA maps and routes; the test is skipped where they are not."""
    if not CARLA.is_dir():
        pytest.skip("CARLA's maps are not here (they are third-party and not part of the project)")
    return CARLA
