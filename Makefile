# Set-up happens once, in .venv, from the lock file; every target takes care of it by itself.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# A second Python for `make test-latest`: the newest there is above 3.11.
LATEST ?= $(firstword $(foreach v,3.14 3.13 3.12,$(shell python$(v) -c 'import sys; print(sys.executable)' 2>/dev/null)))

.PHONY: demo demo-results test quick test-slow profile test-latest lint types check bench bench-fleet \
  study audit house docs notebooks notebooks-rendered lock clean

demo: $(VENV)/ready
	$(BIN)/heatrun demo --quick

# One thread for the linear algebra of NumPy, as the commands have it, before pytest loads it.
test quick test-slow: export OPENBLAS_NUM_THREADS = 1
# Byte code is kept, also where the environment says no: a process that tests start imports for 5 s.
test quick test-slow: export PYTHONDONTWRITEBYTECODE =

# MINUTES=10 begins no test after ten minutes, the costly ones last, and says which.
test: $(VENV)/ready
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not slow and not notebook" \
	  $(if $(MINUTES),--minutes $(MINUTES))

# Files that take a second at most: for the inner loop.
quick: $(VENV)/ready
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not slow and not notebook" --quick

test-slow: $(VENV)/ready
	$(BIN)/pytest -m "slow or notebook"

test-latest:
	@if [ -z "$(LATEST)" ]; then echo "No Python 3.12 or newer is found here: skipped."; else \
	$(MAKE) test VENV=.venv-latest PYTHON=$(LATEST); fi

lint: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache --no-logo

types: $(VENV)/ready
	$(BIN)/pyright --pythonpath $(BIN)/python

check: lint types test

bench: $(VENV)/ready
	$(BIN)/python tests/benchmarks/run.py

# What commands cost, by phase; WORDS="calibrate motor.toml test.csv --quick" for one of your own.
profile: $(VENV)/ready
	$(BIN)/python tests/benchmarks/profile_commands.py $(WORDS)

# Machines per second of a fleet.
bench-fleet: $(VENV)/ready
	$(BIN)/python tests/benchmarks/fleet.py

# Certificate, workbook, DCC, reports and discovery of bundled data, kept under results/demo.
demo-results: $(VENV)/ready
	$(BIN)/python tests/studies/demo_results.py

# The notebooks with their outputs as pages under results/notebooks.
notebooks-rendered: $(VENV)/ready
	$(BIN)/python tests/studies/rendered_notebooks.py

# `make study` lists the studies with their hours; `make study NAME=ordinary` or `make study-ordinary`
# runs one.
study: $(VENV)/ready
	@$(BIN)/python tests/studies/studies.py $(NAME)

study-%: $(VENV)/ready
	$(BIN)/python tests/studies/studies.py $*

# How large the house is: files, lines, rooms; what a quick calibration enters.
house: $(VENV)/ready
	$(BIN)/python tests/studies/house.py --profile

# Licences of the lock file; known vulnerabilities too where pip-audit is installed.
audit: $(VENV)/ready
	$(BIN)/python tests/audit/licences.py

notebooks: $(VENV)/ready
	$(BIN)/pytest -n auto tests/test_notebooks.py $(if $(NOTEBOOKS),-k "$(NOTEBOOKS)")

# The reference pages of the motor file and of the findings, from the meanings in the code.
docs: $(VENV)/ready
	$(BIN)/python -m heatrun.motor.keys docs/motor_file.md
	$(BIN)/python -m heatrun.record.findings docs/findings.md

# Hashes for every platform and Python from 3.11 on, no index addresses.
lock:
	uv pip compile pyproject.toml --group dev --all-extras --universal --python-version 3.11 \
	  --generate-hashes --no-emit-index-url --no-header --output-file requirements.lock

clean:
	rm -rf .venv .venv-latest .pytest_cache .ruff_cache

$(VENV)/ready: requirements.lock pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@
