PYTHON ?= python3
BIN := .venv/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

help:  ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: .venv/demo  ## set up and run the two-area case: verdict table, pictures in reports/
	$(BIN)/python sims/two_area.py

test: .venv/test  ## set up and run the tests
	$(BIN)/python -m pytest -n auto --dist loadfile

lint: .venv/dev  ## style and import walls
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

reproduce: .venv/demo  ## every study, the paper beside ours in reports/index.html; FULL=1: the long ones too
	$(BIN)/python tools/reproduce.py $(if $(FULL),--full)

bench: .venv/bench  ## measure speed on this machine, beside ANDES and TOPS
	$(BIN)/python benchmarks/core.py
	$(BIN)/python benchmarks/estimate.py
	$(BIN)/python benchmarks/linear.py
	$(BIN)/python benchmarks/placement.py
	$(BIN)/python benchmarks/peers.py
	$(BIN)/python benchmarks/growth.py

clean:  ## remove the virtual environment and everything generated
	rm -rf .venv build dist
	git clean -fdqX reports

.venv/bin/python:
	$(PYTHON) tools/make_venv.py .venv

.venv/demo: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e .
	@touch $@

.venv/bench: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e '.[bench]'
	@touch $@

.venv/test: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e '.[test]'
	@touch $@

.venv/dev: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e '.[dev]'
	@touch $@

.PHONY: help demo test lint reproduce bench clean
.DEFAULT_GOAL := help
