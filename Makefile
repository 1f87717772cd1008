# Everything runs in .venv, which is made when it is missing and renewed when its two sources change.
# Another Python: make PYTHON=/path/to/python3.12

PYTHON ?= python3
JOBS ?= auto
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: help demo page test check bench format clean
.DEFAULT_GOAL := help

help:
	@echo "make demo     a character walks, turns, runs and stops: writes demo/"
	@echo "make page     build the page anew after a change in web/"
	@echo "make test     tests and examples"
	@echo "make check    format, lint, types, layers"
	@echo "make bench    how fast it is"
	@echo "make format   put the sources in order"
	@echo "make clean    remove everything that make has made"

$(STAMP): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "no $(PYTHON) here; name a Python 3.11 or newer: make PYTHON=/path/to/python" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("stridecast needs Python 3.11 or newer, and $(PYTHON) is %d.%d; name another: make PYTHON=/path/to/python" % sys.version_info[:2])'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

demo: $(STAMP)
	$(BIN)/python examples/demo.py

page: $(STAMP)
	$(BIN)/python web/bundle.py build

test: $(STAMP)
	$(BIN)/python -m pytest -n $(JOBS)

check: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python web/bundle.py check

bench: $(STAMP)
	@if ls bench/*.py >/dev/null 2>&1; \
	then $(BIN)/python -m pytest bench --benchmark-only -o python_files='bench_*.py test_*.py'; \
	else echo "no benchmarks in bench/"; fi

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/python web/bundle.py format

clean:
	rm -rf .venv .venv-blender .venv-pedpy .venv-jupedsim .venv-vmcp build dist demo web/node_modules tests/node/node_modules src/stridecast/live/static .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
