# foretwin: make setup, then make drive; make check test before every commit.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# A drive starts ten processes: where none may keep what is compiled, each compiles 500 files anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup drive test check docs format bench judge chaos clean lock

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r constraints.txt
	# What is here has no hash: it is installed apart, and built by what is installed already.
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/pip install --quiet --disable-pip-version-check uv
	grep '^[^# ]' constraints.txt | cut -d' ' -f1 > build/lock/pins.txt
	echo '# Made by `make lock`: every package that `make setup` installs, with the hashes of its files.' > build/lock/constraints.txt
	build/lock/bin/uv pip compile pyproject.toml --quiet --extra dev --constraint build/lock/pins.txt \
		--python-version 3.11 --generate-hashes --no-header --no-annotate $(LOCK) >> build/lock/constraints.txt
	mv build/lock/constraints.txt constraints.txt

drive: setup
	$(BIN)/foretwin drive

check: setup docs
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The pages as a site in build/docs, warnings being errors; nothing is fetched.
docs: setup
	$(BIN)/sphinx-build -q -W --keep-going -b html -d build/doctrees docs build/docs

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

test: setup
	$(BIN)/pytest -n logical --maxprocesses 8 --dist loadscope --no-loadscope-reorder

bench: setup
	$(BIN)/python -m tests.benchmarks

judge: setup
	$(BIN)/pytest -m judge

# Drives that faults happen to: make chaos COUNT=1000 SEED=7; with FROM=12 it goes on at drive 12
chaos: setup
	$(BIN)/python -m tests.chaos --count $(or $(COUNT),100) --seed $(or $(SEED),0) --from $(or $(FROM),0)

clean:
	rm -rf $(VENV) build dist
