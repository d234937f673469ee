# The first Python that runs (a shim that fails is passed over), 3.11 before newer ones: PyBullet has wheels for it.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3; do \
	"$$p" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 15))' >/dev/null 2>&1 && echo "$$p" && break; done)
VENV ?= .venv
BIN := $(VENV)/bin

PAPER ?= paper

FUZZ ?= 600

MODEL ?= model

.PHONY: run test test-slow fuzz mutants model lint format paper paper-quick docs clean

run: $(VENV)/.ready  ## The main job on a bundled world; writes runs/<world>-0
	$(BIN)/closedrooms run $(ARGS)

test: $(VENV)/.ready  ## The default tests (no whole simulated runs)
	$(BIN)/pytest -q -n 2

test-slow: $(VENV)/.ready  ## The tests that simulate whole runs
	$(BIN)/pytest -q -n 2 -m slow

fuzz: $(VENV)/.ready  ## Spoilt files for every reader; FUZZ=1800 for half an hour
	$(BIN)/python tests/hostile/test_fuzz.py $(FUZZ)

mutants: $(VENV)/.ready  ## Which changes of one operator the tests do not notice; ARGS="core mapping --sample 10"
	$(BIN)/pip install --quiet -c constraints.txt cosmic-ray==8.7.0
	nice $(BIN)/python tests/mutation/mutants.py $(ARGS)

paper: $(VENV)/.ready  ## The paper's protocol in full: 3,885 maps, every method; writes $(PAPER)/, goes on where it stopped
	$(BIN)/closedrooms dataset all --out $(PAPER)/dataset
	$(BIN)/closedrooms evaluate $(PAPER)/dataset --out $(PAPER)/evaluation

paper-quick: $(VENV)/.ready  ## A tenth of it, in minutes: two orders of closing, up to eleven closed doors
	$(BIN)/closedrooms dataset all --repetitions 2 --max-closed 11 --out $(PAPER)-quick/dataset
	$(BIN)/closedrooms evaluate $(PAPER)-quick/dataset --out $(PAPER)-quick/evaluation

docs: $(VENV)/.ready  ## The site, into docs/_build/html; warnings are errors, and nothing in it asks the network
	$(BIN)/python docs/render_results.py
	$(BIN)/sphinx-build -W --keep-going -q -b html -d docs/_build/doctrees docs docs/_build/html
	$(BIN)/python docs/check_offline.py docs/_build/html

model: $(VENV)/.ready  ## Train the network of the method `learned`, on drawn maps of the floor plans in PLANS; writes $(MODEL)/
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[train]'
	$(BIN)/python benchmarks/fitting/drawn_maps.py "$(PLANS)" --use fit --maps 10 --generated 80 --bundled --out $(MODEL)/fit
	$(BIN)/closedrooms train $(MODEL)/fit --out $(MODEL)/trained --threads 1

lint: $(VENV)/.ready  ## Style and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(VENV)/.ready
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

$(VENV)/.ready: pyproject.toml constraints.txt
	@sh .ci/install "$(PYTHON)" "$(VENV)"
	@touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info docs/_build
