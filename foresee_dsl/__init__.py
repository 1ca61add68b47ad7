"""Traffic situations as text: compile, simulate, forecast near misses, and keep the failures that hide behind them.

For programs and notebooks: `import foresee_dsl as fs`, then `fs.load`, `fs.run`, `fs.assess`, `fs.campaign`,
`fs.findings` and `fs.conform` (`foresee_dsl.api`), which are imported when the first of them is used.
"""

from importlib import import_module

__version__ = "0.1.0"
_API = ("assess", "campaign", "conform", "findings", "load", "run", "Finding", "RunResult", "TestCase", "Verdict")


def __getattr__(name: str) -> object:
    """Return a name of `foresee_dsl.api`; it is imported now, so that `import foresee_dsl` is quick."""
    if name not in _API:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("foresee_dsl.api"), name)


def __dir__() -> list[str]:
    """Return the names of the module, for completion."""
    return sorted({*globals(), *_API})
