# Two commands do all the set-up: `make demo` (the core) and `make test` (the core, the development tools and learning),
# in either order. Each extra leaves one stamp, so that a second call sets nothing up again.

PYTHON ?= python3
PYTHON_DCC ?= python3.11
OUT ?= demo-out
SITE := build/site

PIP := .venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
PYTEST := .venv/bin/python -m pytest
# Whole files go to whichever process is free: what a file's tests share is made once. They go in their own order, which
# ends with short files; by number of tests, long files of few tests would come last and leave one core idle.
# A worker that crashed ends the run: with another in its place, pytest-xdist waits for ever for the tests that it had.
PARALLEL := -n auto --maxprocesses 4 --max-worker-restart 0 --dist loadfile --no-loadscope-reorder
PINS := pyproject.toml constraints.txt

# Tests start hundreds of processes: what Python compiles for one is kept for the next, whatever the shell says.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help setup demo test lint proof proof-all test-dcc test-faults bench docs
.DELETE_ON_ERROR:

help:
	@echo "make demo         the whole chain on one small bridge; ends with the report's path in $(OUT)/"
	@echo "make test         lint, types and every test that needs no Blender"
	@echo "make setup        only what both of them install"
	@echo "make proof        at full counts, the tests whose rows in docs/proof.json speak of other code, or are missing"
	@echo "make proof-all    every test at full counts; writes docs/proof.json"
	@echo "make test-dcc     the tests against Blender's bpy, in a virtual environment of its own"
	@echo "make docs         check the generated pages, and build the site into $(SITE)/"
	@echo "make bench        regenerate the tables measured in minutes"
	@echo "make test-faults  at full counts, the tests that kill, corrupt and fill disks; writes docs/benchmarks/faults.md"

setup: .venv/.stamp-core .venv/.stamp-dev .venv/.stamp-learn .venv/.stamp-view .venv/.stamp-browser

demo: .venv/.stamp-core
	.venv/bin/falsework demo -o $(OUT)

test: lint .venv/.stamp-browser
	$(PYTEST) -m "not dcc" $(PARALLEL)

# The tests of learn/ and of the viewer need their extras, and so does pyright, which reads what torch and viser say of their types.
lint: .venv/.stamp-dev .venv/.stamp-learn .venv/.stamp-view
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/pyright --threads 2

proof: lint
	FALSEWORK_TESTS_PROOF=1 $(PYTEST) $(PARALLEL) --proof --stale -o faulthandler_timeout=3600

proof-all: lint
	FALSEWORK_TESTS_PROOF=1 $(PYTEST) $(PARALLEL) --proof -o faulthandler_timeout=3600

test-dcc: .venv/.stamp-dev .venv/.stamp-learn .venv/.stamp-view .venv-dcc/.stamp
	FALSEWORK_BPY_PYTHON=$(CURDIR)/.venv-dcc/bin/python $(PYTEST) -m dcc $(PARALLEL)

test-faults: .venv/.stamp-dev .venv/.stamp-learn .venv/.stamp-view
	FALSEWORK_TESTS_PROOF=1 $(PYTEST) -m faults $(PARALLEL) --proof -o faulthandler_timeout=3600
	.venv/bin/python -m benchmarks.checks.faults

bench: .venv/.stamp-dev .venv/.stamp-learn
	.venv/bin/python -m benchmarks

# The site: generated pages and notebooks are checked first, and warnings are errors.
docs: .venv/.stamp-dev .venv/.stamp-docs .venv/.stamp-learn
	.venv/bin/python -m docs.proof_state
	.venv/bin/python -m docs.generate --check
	.venv/bin/python -m sphinx --quiet --fail-on-warning --keep-going --builder html docs $(SITE)
	@echo "the site: $(SITE)/index.html"

.venv/.stamp-venv:
	@command -v $(PYTHON) >/dev/null || { echo "falsework set-up: no $(PYTHON): apt-get install python3-venv" >&2; exit 2; }
	@$(PYTHON) bootstrap/make_venv.py .venv
	@touch $@

.venv/.stamp-core: .venv/.stamp-venv $(PINS)
	@echo "falsework set-up: packages into .venv, about 1.5 GB: some minutes without a word"
	$(PIP) --editable .
	@.venv/bin/python bootstrap/system_libraries.py core
	@touch $@

# Every extra of pyproject.toml: dev, docs, learn, view, …
.venv/.stamp-%: .venv/.stamp-core
	$(PIP) --editable ".[$*]"
	@touch $@

# A browser for the tests of pages; where none can be had, they are skipped and say so.
.venv/.stamp-browser: .venv/.stamp-venv
	@.venv/bin/python bootstrap/system_libraries.py browser
	@touch $@

.venv-dcc/.stamp: constraints-dcc.txt
	@command -v $(PYTHON_DCC) >/dev/null || { echo "falsework set-up: bpy needs Python 3.11: name it with PYTHON_DCC=" >&2; exit 2; }
	@$(PYTHON_DCC) bootstrap/make_venv.py .venv-dcc 3.11
	.venv-dcc/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints-dcc.txt bpy
	@.venv/bin/python bootstrap/system_libraries.py dcc
	@touch $@
