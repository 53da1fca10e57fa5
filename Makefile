PYTHON ?= python3
BIN := .venv/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1
unexport PYTHONDONTWRITEBYTECODE  # of hundreds of processes that would compile every module again

help:  ## show this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: .venv/demo  ## simulate the two-area system: outcomes, and pictures in reports/
	$(BIN)/python sims/two_area.py

test: .venv/test  ## run the tests
	$(BIN)/python -m pytest -n auto --dist loadfile

slow: .venv/test  ## run the tests that take long
	$(BIN)/python -m pytest -n auto --dist loadfile -m slow --durations 15

fuzz: .venv/test  ## run mutated inputs until a failure is found or FUZZ_MINUTES (10) are over; FUZZ_SEED gives others
	PYTHONPATH=.:tests $(BIN)/python -m fuzz --minutes $(or $(FUZZ_MINUTES),10) --seed $(or $(FUZZ_SEED),1)

lint: .venv/dev  ## check style, import layers and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/mypy benchmarks/*.py tools/*.py

mutate: .venv/dev  ## put faults into a copy of the code and count those that the tests notice (MUTATE="--seed 7 model io")
	$(BIN)/python tools/mutate.py $(MUTATE)

docs: .venv/docs  ## build the site of the documentation in build/site, and docs/models.md, the page of all devices
	$(BIN)/python tools/models_page.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build

gallery: .venv/demo  ## draw the figures of docs/gallery again
	$(BIN)/python tools/gallery.py

screenshots: .venv/dev  ## take the pictures of docs/live.md again; needs Chromium
	$(BIN)/python tools/screenshots.py

coverage: .venv/demo  ## write docs/coverage.md: how much of a collection of PSS/E systems is supported (COLLECTION=folder)
	$(BIN)/python tools/coverage_page.py $(COLLECTION)

reproduce: .venv/demo  ## run all studies, compared with the paper in reports/index.html (FULL=1: also the long ones)
	$(BIN)/python tools/reproduce.py $(if $(FULL),--full)

bench: .venv/bench  ## measure speed on this machine, of other programs and of version 0.1
	$(BIN)/python benchmarks/start.py
	$(BIN)/python benchmarks/core.py
	$(BIN)/python benchmarks/hard.py
	$(BIN)/python benchmarks/controllers.py
	$(BIN)/python benchmarks/storage_converters.py
	$(BIN)/python benchmarks/estimate.py
	$(BIN)/python benchmarks/linear.py
	$(BIN)/python benchmarks/tuning.py
	$(BIN)/python benchmarks/placement.py
	$(BIN)/python benchmarks/peers.py
	$(BIN)/python benchmarks/equal_accuracy.py
	$(BIN)/python benchmarks/before.py
	$(BIN)/python benchmarks/growth.py
	$(BIN)/python benchmarks/caches.py
	$(BIN)/python benchmarks/large.py
	$(BIN)/python benchmarks/cluster.py
	$(BIN)/python benchmarks/live.py

clean:  ## remove the virtual environment and all generated files
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

.venv/docs: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e '.[docs]'
	@touch $@

.venv/test: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e '.[test]'
	@touch $@

.venv/dev: pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install -q -e '.[dev]'
	@touch $@

.PHONY: help demo test slow fuzz lint mutate docs gallery screenshots coverage reproduce bench clean
.DEFAULT_GOAL := help
