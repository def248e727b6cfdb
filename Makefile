# make fly   set up, then fly the emergency twice, side by side
# make test  set up, then run every test
# make check ruff and mypy;  make soak  the same claims at large counts;  make bench  the benchmarks

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
RUNS   := runs/$(shell date +%Y%m%dT%H%M%S)-side-by-side
JOBS   ?= 2
WAITERS ?= 3

.PHONY: setup fly test check soak bench clean

$(VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

setup: $(VENV)/.ready

fly: setup
	$(BIN)/gcs run emergency --controller average --out $(RUNS)/average
	$(BIN)/gcs run emergency --controller trust-r --trust auto --out $(RUNS)/trust-r
	$(BIN)/gcs compare $(RUNS)/average $(RUNS)/trust-r --out $(RUNS)/comparison.png

# What waits for real time runs by itself, more at once than there are cores; what measures it has the machine alone.
marked = $(shell grep -rl 'mark\.$(1)' tests)

test: setup
	$(BIN)/pytest $(TRYING) --numprocesses $(JOBS) --dist worksteal -m "not wall_clock and not alone"
	$(BIN)/pytest $(TRYING) --numprocesses $(WAITERS) --dist loadfile -m "wall_clock and not alone" $(call marked,wall_clock)
	$(BIN)/pytest $(TRYING) -m alone $(call marked,alone)

soak: export TRUSTR_PROFILE = soak
soak: TRYING = --timeout 7200
soak: test

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup
	$(BIN)/python -m tests.benchmarks

clean:
	rm -rf $(VENV) runs build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
