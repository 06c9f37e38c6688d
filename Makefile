# Two commands on a fresh machine: `make dataset` and `make test`. Each sets up .venv from the tested versions first.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: dataset test test-slow bench lint install

dataset: install
	$(BIN)/fgf generate configs/quickstart.yaml

# Files of tests in parallel: most of the time goes into compiling kernels, each on one core.
test: lint
	$(BIN)/python -m pytest -n auto --dist loadfile

test-slow: install
	$(BIN)/python -m pytest -m 'slow or measure'

# Against Mitsuba 3, on a quiet machine: 10 to 15 minutes. It says so where it finds no LLVM of version 16 or newer.
bench: .venv/installed-bench
	$(BIN)/python -m tests.benchmarks --out docs

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

install: .venv/installed

.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

.venv/installed-bench: .venv/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[bench]'
	@touch $@
