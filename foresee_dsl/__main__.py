"""`python -m foresee_dsl` is `foresee`."""

from foresee_dsl.cli import main

main()
