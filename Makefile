# Two commands on a fresh machine: `make dataset` and `make test`. Each sets up .venv from the tested versions first.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: dataset test test-slow lint install

dataset: install
	$(BIN)/fgf generate configs/quickstart.yaml

test: lint
	$(BIN)/python -m pytest

test-slow: install
	$(BIN)/python -m pytest -m slow

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

install: .venv/installed

.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@
