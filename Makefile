# Needs Python 3.11 or newer, make and pip; everything else is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test lint types install docs clean

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c "import sys; sys.exit('Python 3.11 or newer is needed, this is ' + sys.version.split()[0] if sys.version_info < (3, 11) else 0)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $@

install: $(STAMP)

demo: install  ## run shipped scenarios on SUMO and leave the results in out/demo
	rm -rf out/demo
	$(BIN)/xosc-check xosc/library xodr/library
	$(BIN)/xosc-run xosc/library/*.xosc --out out/demo --plot --junit out/demo/junit.xml; status=$$?; \
	  echo "Results are in out/demo: for each run a picture, trajectories, event log and result; look at out/demo/highway_cut_in/picture.png."; \
	  test $$status -le 1

test: install  ## the whole test suite, in parallel
	$(BIN)/python -m pytest -n auto

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/mypy

docs: install  ## regenerate the tables in docs/
	$(BIN)/python -m runner.coverage docs/coverage.md

clean:
	rm -rf $(VENV) out build dist
