"""Codes of the mistakes of logical scenarios: what is drawn, and what is required of it."""

from foresee_dsl.language.codes.code import Code

_LIMIT = "param limit: time = 9 s in 5 s..20 s step 1 s"

CODES = (
    Code(
        "FS051",
        "a distribution that does not fit its parameter",
        "What is drawn lies in the parameter's range or among its options. A normal distribution needs a range with "
        "the mean inside, a choice one weight for each option, a grid steps or options.",
        f"{_LIMIT} as normal(30 s, 2 s)\nend after limit",
        f"{_LIMIT} as normal(10 s, 2 s)\nend after limit",
    ),
    Code(
        "FS052",
        "a parameter compared where the world is, or the other way round",
        "A `require` is settled before the run, so it compares parameters only. Triggers and expectations watch the "
        "run, in which a parameter never changes.",
        f"{_LIMIT}\nend after limit\nrequire ego.speed < 3 m/s",
        f"{_LIMIT}\nend after limit\nrequire limit < 15 s",
    ),
    Code(
        "FS053",
        "a case that violates a `require`",
        "Every case, and where there are none the defaults, must satisfy what the scenario requires.",
        f"{_LIMIT}\nend after limit\nrequire limit < 15 s\ncase long {{ limit = 18 s }}",
        f"{_LIMIT}\nend after limit\nrequire limit < 15 s\ncase long {{ limit = 14 s }}",
    ),
)
"""In order."""
