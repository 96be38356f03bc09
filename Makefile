# foretwin: make setup, then make drive; make check test before every commit.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: setup drive test check format bench judge chaos clean

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

drive: setup
	$(BIN)/foretwin drive

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

test: setup
	$(BIN)/pytest -n logical --maxprocesses 8 --dist loadscope --no-loadscope-reorder

bench: setup
	$(BIN)/python -m tests.benchmarks

judge: setup
	$(BIN)/pytest -m judge

# Drives that faults happen to: make chaos COUNT=1000 SEED=7
chaos: setup
	$(BIN)/python -m tests.chaos --count $(or $(COUNT),100) --seed $(or $(SEED),0)

clean:
	rm -rf $(VENV) build dist
