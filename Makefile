# Every target sets up what it needs in $(VENV); nothing outside the checkout is touched.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
RESOLUTION ?=
# One thread a process, and what Python compiled is kept, whatever the environment says.
PYTEST := OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n auto --dist worksteal
KOOP := $(BIN)/koop

.DEFAULT_GOAL := help
.PHONY: help reproduce reproduce-edmd reproduce-eigen reproduce-beyond smoke test test-all test-lowest test-newest check \
  docs pins bench peers scaling faults kernels traps wheel clean

help: ## Show this help
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 20

reproduce: $(VENV)/.installed ## Reproduce the paper at full size, both methods, and print paper versus here
	$(KOOP) reproduce all

reproduce-edmd: $(VENV)/.installed ## Reproduce the EDMD experiment alone
	$(KOOP) reproduce edmd

reproduce-eigen: $(VENV)/.installed ## Reproduce the eigenfunction experiment alone
	$(KOOP) reproduce eigen

reproduce-beyond: $(VENV)/.installed ## The eigenfunction experiment and what goes beyond the paper (minutes)
	$(KOOP) reproduce eigen --beyond

smoke: $(VENV)/.installed ## Run both methods on reduced datasets, in a store of its own
	@store=$$(mktemp -d) && trap 'rm -rf "$$store"' EXIT && \
	$(KOOP) reproduce all --smoke --store "$$store" && \
	$(KOOP) reproduce all --smoke --store "$$store" 2>/dev/null

test: $(VENV)/.developing ## Run the tests, on every core (minutes)
	$(PYTEST)

test-all: $(VENV)/.developing ## Run the slow tests too
	$(PYTEST) -m ''

test-lowest: ## Run the tests with the lowest version allowed of every dependency (for Python 3.11, which has them all)
	$(MAKE) VENV=.venv-lowest RESOLUTION=lowest-direct test

test-newest: ## Run the tests and the checks with the newest version of every dependency
	$(MAKE) VENV=.venv-newest RESOLUTION=highest test check

check: $(VENV)/.developing ## Lint, types and the direction of imports
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.developing ## Write docs/cli.md from the commands' own help
	$(BIN)/python -m koopcli.cli.reference > docs/cli.md

pins: $(VENV)/.developing ## Pin the stages' toy results, after raising a stage's version
	$(BIN)/python -m tests.stages.toys

bench: $(VENV)/.developing ## Measure speed and memory as ratios within one run (minutes)
	$(BIN)/python benchmarks/run.py
	$(BIN)/python benchmarks/store.py

peers: $(VENV)/.developing ## Set koop beside other EDMD packages in one run, each in an environment of its own (a quarter of an hour)
	$(BIN)/python benchmarks/peers.py

scaling: $(VENV)/.developing ## Measure sizes, sweeps and engines, for docs/scaling.md (a quarter of an hour)
	$(BIN)/python benchmarks/scaling.py

faults: $(VENV)/.developing ## Count what a store loses under thousands of faults, for docs/reliability.md (minutes)
	$(BIN)/python -m tests.faults

traps: $(VENV)/.developing ## Measure what generic least squares makes of raw monomials (minutes)
	$(BIN)/python benchmarks/traps.py

kernels: $(VENV)/.developing ## Run the numerical tests under every kernel of OpenBLAS that this processor has (minutes)
	$(BIN)/python -m tests.kernels

wheel: $(VENV)/.developing ## Build the wheel into dist/
	rm -rf dist
	$(BIN)/python -m build --wheel --outdir dist

clean: ## Remove the environment and build leftovers, but no artefacts
	rm -rf $(VENV) .venv-lowest .venv-newest .venv-peers dist build .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find koopcli tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "koop needs Python 3.11 or newer as '$(PYTHON)': install it, or name another with make PYTHON=…" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  v=$$($(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
	  echo "This Python has no ensurepip, which sets up environments: on Debian or Ubuntu, apt install python$$v-venv" >&2; \
	  exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	@touch $@

$(VENV)/.installed: pyproject.toml | $(VENV)/.created
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/.developing: pyproject.toml | $(VENV)/.created
	$(BIN)/python -m pip install --quiet --disable-pip-version-check $(if $(RESOLUTION),uv,-e '.[dev]')
	$(if $(RESOLUTION),$(BIN)/uv pip install --quiet --upgrade --python $(BIN)/python --resolution $(RESOLUTION) -e '.[dev]')
	@touch $@ $(VENV)/.installed
