# The two commands: `make campaign` (the main job on the bundled scenarios) and `make test`.
# Each does its own set-up: a virtual environment in .venv, with uv when it is there, else with pip.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SEEDS ?= scenarios/campaign.foresee
OUT ?= out
JOBS ?= $(shell $(PYTHON) -c 'import os; print(os.cpu_count() or 1)')
ARGS ?=
# Distributions of their own, in the order in which they are installed.
PLUGINS := $(patsubst plugins/%/pyproject.toml,%,$(wildcard plugins/*/pyproject.toml))

# Some containers set it; without bytecode every start of the tool compiles eighty modules.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help campaign study test lint types imports unit bench faults docs format doctor clean

help:  ## what can be made
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  make \1\t\2/' | expand -t 22

campaign: $(VENV)/.installed  ## run the bundled scenarios, find the failures near their near misses (SEEDS=, OUT=, JOBS=, ARGS=)
	@$(BIN)/foresee campaign $(SEEDS) --jobs $(JOBS) --out $(OUT) --exit-zero $(ARGS)

study: SEEDS = scenarios/study.foresee
study: OUT = out/study
study: campaign  ## the same with as many children as the paper's study had simulations, 34,416 (OUT=, JOBS=, ARGS=)

test:  ## everything that must hold: lint, types, import contract, tests (side by side)
	@$(MAKE) --no-print-directory --jobs 2 unit lint

lint: types imports  ## style, types and the import contract
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	@$(BIN)/mypy

imports: $(VENV)/.installed-dev
	@$(BIN)/lint-imports --no-logo
	@for plugin in $(PLUGINS); do $(BIN)/lint-imports --no-logo --config plugins/$$plugin/pyproject.toml || exit 1; done

unit: $(VENV)/.collected  ## the tests alone (ARGS="-k name")
	@$(BIN)/pytest -n $$(( $(JOBS) * 2 )) --dist worksteal $(ARGS)  # two a core: tests wait for processes, browsers and servers a third of the time

# In a new checkout one process compiles all modules and tests; without it each worker does, 17 s of CPU time each.
$(VENV)/.collected: $(VENV)/.installed-dev
	@$(BIN)/pytest --collect-only -q -q >/dev/null 2>&1 || true  # the tests themselves report what is wrong
	@touch $@

bench: $(VENV)/.installed-dev  ## measure: speed against its targets (ARGS="language")
	@$(BIN)/python -m benchmarks.run $(ARGS)

faults: $(VENV)/.installed-dev  ## seed faults into the drivers, measure who finds them (JOBS=, OUT=, ARGS="--faults all")
	@$(BIN)/python -m foresee_study.faults --jobs $(JOBS) --out $(OUT)/faults $(ARGS)

docs: $(VENV)/.installed-dev  ## build the documentation as a site, build/site/index.html
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "build/site/index.html"

format: $(VENV)/.installed-dev  ## format the Python and the scenario files
	@$(BIN)/ruff format .
	@$(BIN)/foresee fmt scenarios

doctor: $(VENV)/.installed  ## what is installed, what works, and how to mend what does not
	@$(BIN)/foresee doctor

clean:  ## remove what was made (the environment too)
	rm -rf $(VENV) $(OUT) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis

# A half-made environment is made anew: the stamp is only written when everything is in.
$(VENV)/.installed: pyproject.toml $(wildcard plugins/*/pyproject.toml)
	@echo "setting up $(VENV) (once; two or three minutes)"
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "foresee-dsl needs Python 3.11 or newer; set PYTHON=")'
	@if command -v uv >/dev/null 2>&1; then \
	  uv venv --quiet --allow-existing --python $(PYTHON) $(VENV) && \
	  install="uv pip install --quiet --python $(BIN)/python"; \
	else \
	  $(PYTHON) -m venv $(VENV) && \
	  install="$(BIN)/python -m pip install --quiet --disable-pip-version-check"; \
	fi && echo "  installing foresee-dsl, SUMO and $(words $(PLUGINS)) plug-ins (most of the time)" && \
	{ $$install -e . $(PLUGINS:%=-e plugins/%) 2>/dev/null || { \
	  echo "  not all of them can be installed here; one by one:" && $$install -e . && \
	  for plugin in $(PLUGINS); do \
	    echo "  $$plugin" && $$install -e plugins/$$plugin || echo "the plug-in $$plugin cannot be installed here; all else works"; \
	  done; }; }
	@$(BIN)/python -c 'import frenetix' 2>/dev/null || echo "the driver frenetix is left out: its package has wheels for Python up to 3.12 on x86_64 Linux and macOS only; all else works"
	@echo "  installed; the first run compiles the inner loops, which takes up to a minute"
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	@echo "  installing what tests need (about a minute)"
	@if command -v uv >/dev/null 2>&1; then \
	  uv pip install --quiet --python $(BIN)/python -e '.[dev,study]'; \
	else \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev,study]'; \
	fi
	@touch $@
