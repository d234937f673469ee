PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: run test test-slow lint format clean

run: $(VENV)/.ready  ## The main job on a bundled world; writes runs/<world>-0
	$(BIN)/closedrooms run $(ARGS)

test: $(VENV)/.ready  ## The default tests (no whole simulated runs)
	$(BIN)/pytest -q -n 2

test-slow: $(VENV)/.ready  ## The tests that simulate whole runs
	$(BIN)/pytest -q -n 2 -m slow

lint: $(VENV)/.ready  ## Style and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(VENV)/.ready
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

$(VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11) and "closedrooms needs Python 3.11; set PYTHON=/path/to/python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info
