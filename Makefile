# Set-up happens once, in .venv, from the lock file; every target takes care of it by itself.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# A second Python for `make test-latest`: the newest there is above 3.11.
LATEST ?= $(firstword $(foreach v,3.14 3.13 3.12,$(shell python$(v) -c 'import sys; print(sys.executable)' 2>/dev/null)))

.PHONY: demo demo-results test quick test-slow profile test-latest lint types check bench bench-fleet bench-before study-coverage study-crosschecks \
  study-accidents study-bodies study-discovery study-exam study-faults study-first-hour study-fleet study-fleet-discovery study-fleet-kills study-fuzz study-misfit study-ordinary study-paderborn \
  study-readings study-real study-shutdown study-view audit house docs notebooks notebooks-rendered schemas lock clean

demo: $(VENV)/ready
	$(BIN)/heatrun demo

# One thread for the linear algebra of NumPy, as the commands have it, before pytest loads it.
test quick test-slow: export OPENBLAS_NUM_THREADS = 1
# Byte code is kept, also where the environment says no: a process that tests start imports for 5 s.
test quick test-slow: export PYTHONDONTWRITEBYTECODE =

test: $(VENV)/ready
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not slow and not notebook"

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

# What a calibration costs, by phase; WORDS="motor.toml test.csv --quick" for one of your own.
profile: $(VENV)/ready
	$(BIN)/python tests/benchmarks/profile_calibrate.py $(WORDS)

# Machines per second of a fleet, and the tree before unmodelled heat beside this one.
bench-fleet: $(VENV)/ready
	$(BIN)/python tests/benchmarks/fleet.py

bench-before: $(VENV)/ready
	$(BIN)/python tests/benchmarks/against.py

# Certificate, workbook, DCC, reports and discovery of bundled data, kept under results/demo.
demo-results: $(VENV)/ready
	$(BIN)/python tests/studies/demo_results.py

# The notebooks with their outputs as pages under results/notebooks.
notebooks-rendered: $(VENV)/ready
	$(BIN)/python tests/studies/rendered_notebooks.py

# From five unlike files to a certificate by init, check and calibrate.
study-first-hour: $(VENV)/ready
	$(BIN)/python tests/studies/first_hour.py

study-bodies: $(VENV)/ready
	$(BIN)/python tests/studies/bodies.py

study-crosschecks: $(VENV)/ready
	$(BIN)/python tests/crosschecks/study.py

study-discovery: $(VENV)/ready
	$(BIN)/python tests/studies/discovery.py --clean 72 --unknown 32 --pairs 32
	$(BIN)/python tests/studies/discovery_time.py

study-misfit: $(VENV)/ready
	$(BIN)/python tests/studies/misfit.py

# Accidents that happen to bench records: caught, named, and what clean records are accused of.
study-accidents: $(VENV)/ready
	$(BIN)/python tests/studies/accidents.py

# Ordinary machines of six kinds with two to four imperfections at once; goes on where it was stopped.
study-ordinary: $(VENV)/ready
	$(BIN)/python tests/studies/ordinary.py --discover 0.33

study-paderborn: $(VENV)/ready
	$(BIN)/python tests/studies/paderborn.py

# Real records where they are at hand, under ../shared/bench.
study-real: $(VENV)/ready
	$(BIN)/python tests/studies/real_records.py

# make study-exam FILE=measures_v2.csv, the public "Electric Motor Temperature"; TRAIN=24 or all.
FILE ?= measures_v2.csv
study-exam: $(VENV)/ready
	$(BIN)/python tests/studies/exam.py "$(FILE)" $(if $(TRAIN),--train "$(TRAIN)")

# The winding at switch-off of simulated machines, and methods by hand on the same readings.
study-shutdown: $(VENV)/ready
	$(BIN)/python tests/studies/shutdown.py
	$(BIN)/python tests/studies/shutdown_real.py

study-view: $(VENV)/ready
	$(BIN)/python tests/studies/view_speed.py

study-faults: $(VENV)/ready
	$(BIN)/python tests/faults/campaign.py
	$(BIN)/python tests/faults/memory.py

# Populations of simulated fleets: coverage, pooling, outliers, and one stage beside the two.
study-fleet: $(VENV)/ready
	$(BIN)/python tests/studies/fleet_one_stage.py
	$(BIN)/python tests/studies/fleet.py --fleets 12 --machines 200
	$(BIN)/python tests/studies/fleet_noise.py

# Effects that the machines of a fleet share; goes on where it was stopped.
study-fleet-discovery: $(VENV)/ready
	$(BIN)/python tests/studies/fleet_discovery.py

# A fleet whose client and workers are killed at random.
study-fleet-kills: $(VENV)/ready
	$(BIN)/python tests/fleet/kills_campaign.py --kills 60

# Properties on random examples too, which `make test` tries on the same ones each time.
study-fuzz: $(VENV)/ready
	$(BIN)/pytest --hypothesis-profile random -m hypothesis
	$(BIN)/python tests/fuzz/campaign.py

study-readings: $(VENV)/ready
	$(BIN)/python tests/readings/study.py

# How large the house is: files, lines, rooms, who imports whom; what a quick calibration enters.
house: $(VENV)/ready
	$(BIN)/python tests/studies/house.py --profile

# Licences of the lock file; known vulnerabilities too where pip-audit is installed.
audit: $(VENV)/ready
	$(BIN)/python tests/audit/licences.py

study-coverage: $(VENV)/ready
	$(BIN)/python tests/studies/coverage_study.py

notebooks: $(VENV)/ready
	$(BIN)/pytest -n auto tests/test_notebooks.py $(if $(NOTEBOOKS),-k "$(NOTEBOOKS)")

# The JSON schemas of fit.json, discovery.json and population.json, from the types in the rooms `results`.
schemas: $(VENV)/ready
	$(BIN)/python -m heatrun.results.schema
	$(BIN)/python -m heatrun_fleet.results.schema

# The reference page of the motor file, from the meanings of its keys.
docs: $(VENV)/ready
	$(BIN)/python -m heatrun.motor_keys notebooks/motor_file.md

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
