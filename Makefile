# SPDX-License-Identifier: GPL-3.0-or-later
# Each command sets up what it needs, the first time only. PYTHON must be a Python 3.11: bpy 4.5 and 5.0 exist for no other.
PYTHON ?= python3.11
BPY45 := 4.5.15
BPY50 := 5.0.1
VENV := .venv
VENV50 := .venv-bpy5.0
BIN := $(VENV)/bin
DEMO_OUT ?= demo-output
# Arguments for pytest, as in `make test PYTEST_ARGS='-k friction'`
PYTEST_ARGS ?=
# Which Blender `make test-ui` opens: 4.3 or 5.2
BLENDER ?= 4.3
# One group of benchmarks, as in `make bench ONLY=solver`
ONLY ?=
# Address of documentation and support, for the zips that are uploaded to extensions.blender.org
WEBSITE ?=

.DEFAULT_GOAL := help
.PHONY: help demo test test-long test-all test-ui compiled bench docs zip lint clean distclean env env50
.NOTPARALLEL:

help:
	@echo 'make demo     set up and run the demo: a picture, tactile images and the forces, in $(DEMO_OUT)/'
	@echo 'make env      set up all that the commands below need, without running anything'
	@echo 'make test     before each commit: lint and the quick tests in bpy $(BPY45), on all cores'
	@echo 'make test-all everything: make test, test-long, docs and test-ui (the window needs Debian and root)'
	@echo 'make test-long  the long tests in bpy $(BPY45), and what depends on the version in bpy $(BPY50)'
	@echo 'make test-ui  the extension in a real Blender window (Debian, as root: it sets up a Blender of its own);'
	@echo '              BLENDER=5.2 for that one (default $(BLENDER))'
	@echo 'make bench    benchmarks, one JSON line per figure; ONLY=solver for one group'
	@echo 'make docs     the documentation as a site, in build/site/'
	@echo 'make zip      the extension zips for every platform and Python, in dist/, checked by Blender's own tool;'
	@echo '              WEBSITE=https://… makes those to upload, too, in dist/upload/'
	@echo 'make lint     ruff, mypy and the order of imports alone'
	@echo 'make clean    remove build products; distclean: the environments too'

# --- environments: a stamp each, renewed when what they are made from changes
# Enough for `make demo`; $(VENV)/.ready adds what tests, benchmarks, studies and bags need.
$(VENV)/.runtime: pyproject.toml Makefile tools/system_packages.sh
	tools/system_packages.sh $(PYTHON)
	test -x $(VENV)/bin/python || $(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --editable . bpy==$(BPY45)
	touch $@

# bpy is named again, so that pip keeps NumPy within what bpy accepts.
$(VENV)/.ready: $(VENV)/.runtime
	$(VENV)/bin/python -m pip install --quiet --editable '.[test,bench]' bpy==$(BPY45)
	touch $@

$(VENV50)/.ready: pyproject.toml Makefile tools/system_packages.sh
	tools/system_packages.sh $(PYTHON)
	test -x $(VENV50)/bin/python || $(PYTHON) -m venv $(VENV50)
	$(VENV50)/bin/python -m pip install --quiet --editable '.[test]' bpy==$(BPY50)
	touch $@

env: $(VENV)/.ready
env50: $(VENV50)/.ready

# --- what a user runs
demo: $(VENV)/.runtime
	$(BIN)/palpate demo --out $(DEMO_OUT)

# --- what a developer runs
lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python tools/check_types.py
	$(BIN)/lint-imports --no-logo

compiled: env
	$(BIN)/python tools/compile_kernels.py

# The tiers are those of docs/testing.md.
# What depends on the version of Blender: what registers, reads, writes, shows and renders a scene. Commands, pages, studies and
# the paper's experiments call the same.
OF_VERSION := $(addprefix tests/blender/,authoring bake display panels properties render sample_blends scene scripting session \
	timeline test_registration.py test_zip.py)
PYTEST := -m pytest --numprocesses=logical --dist=loadfile --durations=10

test: lint compiled
	$(BIN)/python $(PYTEST) -m 'not long' tests/core tests/tools tests/blender $(PYTEST_ARGS)

test-long: compiled env50
	$(BIN)/python $(PYTEST) -m long tests/core tests/tools tests/blender $(PYTEST_ARGS)
	$(VENV50)/bin/python $(PYTEST) $(OF_VERSION) $(PYTEST_ARGS)

test-all: test test-long docs test-ui

test-ui: env
	$(BIN)/python tools/provision_blender.py --blender $(BLENDER)
	$(BIN)/python -m pytest tests/ui --blender $(BLENDER) $(PYTEST_ARGS)

$(VENV)/.bench: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	touch $@

bench: $(VENV)/.bench
	@$(BIN)/python -m benchmarks $(ONLY)

$(VENV)/.docs: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

# A warning, as of a link that leads nowhere, is an error.
docs: $(VENV)/.docs
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --fresh-env -b html -c docs . build/site

zip: env
	$(BIN)/python tools/build_zip.py
ifdef WEBSITE
	$(BIN)/python tools/build_zip.py --website '$(WEBSITE)'
endif

clean:
	rm -rf build dist $(DEMO_OUT) *.egg-info .pytest_cache .ruff_cache .mypy_cache
	find . -name __pycache__ -not -path './.venv*' -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV) $(VENV50)
