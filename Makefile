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

demo: install  ## from recordings to a report of runs, left in out/demo
	rm -rf out/demo
	$(BIN)/xosc-check xosc/library xodr/library
	$(BIN)/xosc-recognize record out/demo/recordings --scale 0.01 --site motorway_two_lanes
	$(BIN)/xosc-recognize out/demo/recordings --out out/demo/catalogue
	$(BIN)/xosc-generate xosc/library/cut_in_highway.xosc --sut cas --budget 200 --most 10 --out out/demo/edge_cases
	$(BIN)/xosc-run xosc/library/*_highway.xosc xosc/library/highway_*.xosc out/demo/edge_cases/cut_in_highway_edge_cases.xosc \
	  --out out/demo/runs --replay --jobs 2 --junit out/demo/junit.xml; test $$? -le 1
	@echo "out/demo/runs/report.html shows the runs, each with its replay; out/demo/catalogue what was recognised in the recordings."

test: install  ## the whole test suite, in parallel
	$(BIN)/python -m pytest -n auto

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/mypy

docs: install  ## write the generated pages of docs/ anew
	$(BIN)/python -m runner.coverage docs/coverage.md
	$(BIN)/python docs/generate.py

clean:
	rm -rf $(VENV) out build dist
