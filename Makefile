# Needs Python 3.11 or newer, make and pip; everything else is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEVELOPMENT := $(VENV)/.with-dev
READERS := .venv-readers
# Tests start many processes: without the compiled modules of the others each would compile all it imports.
export PYTHONDONTWRITEBYTECODE :=
# Modules are compiled when they are first imported: most of what is installed never is.
PIP := pip install --no-compile --quiet --disable-pip-version-check

.PHONY: demo test test-slow test-studies readers lint types install docs docs-site compiled clean

# What an extra brings. The pip of Python 3.11 takes a third more processor time for it than today's.
$(VENV)/.with-%: pyproject.toml constraints.txt
	$(PYTHON) -c "import sys; sys.exit('Python 3.11 or newer is needed, this is ' + sys.version.split()[0] if sys.version_info < (3, 11) else 0)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m $(PIP) --constraint constraints.txt --upgrade pip
	$(BIN)/python -m $(PIP) --constraint constraints.txt --editable '.[$*]'
	touch $@

install: $(DEVELOPMENT)

# It needs no more than the search does, which has no torch; what is there for development has that.
demo: $(or $(wildcard $(DEVELOPMENT)),$(VENV)/.with-search)  ## edge cases of adas in out/demo/index.html; adas beside cas in out/demo_cas/history.html
	rm -rf out/demo out/demo_cas
	$(BIN)/xosc-loop generation/loop/demo --out out/demo --sut adas --labels rules --budget 40 --rounds 1 --most 4 --shown 2 --sample 10
	$(BIN)/xosc-run generation/loop/demo/scenarios --sut cas --sample 10 --quiet --out out/demo_cas --replay || test $$? -eq 1  # cas fails some
	$(BIN)/xosc-replay out/demo/scenarios out/demo_cas

# What no target runs.
OTHERS := not study and not every
test: install  ## the tests of the product without the slow ones, in parallel
	$(BIN)/python -m pytest -n auto --dist worksteal -m '$(OTHERS) and not slow' --ignore tests/studies

test-slow: install  ## the slow tests of the product: whole searches, loops, libraries and recordings
	$(BIN)/python -m pytest -n auto --dist worksteal -m '$(OTHERS) and slow' --ignore tests/studies

test-studies: install  ## the tests of studies/, which no command uses
	$(BIN)/python -m pytest -n auto --dist worksteal tests/studies

$(READERS)/.installed: tests/readers/requirements.txt
	$(PYTHON) -m venv $(READERS)
	$(READERS)/bin/python -m $(PIP) --requirement tests/readers/requirements.txt
	$(READERS)/bin/python -m $(PIP) --no-deps vcd==6.0.3  # not its OpenCV, which needs a desktop
	touch $@

readers: install $(READERS)/.installed  ## what packages of others, in an environment of their own, make of our exports
	XOSC_READERS_PYTHON=$(CURDIR)/$(READERS)/bin/python $(BIN)/python -m pytest -n auto tests/readers

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/mypy

docs: install  ## write the generated pages of docs/ anew
	$(BIN)/python -m studies.coverage docs/coverage.md
	$(BIN)/python docs/generate.py
	$(BIN)/python docs/picture.py

docs-site: install  ## the documentation as a site in out/site; links are checked, no network is used
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build

compiled: install  ## the wheel with compiled modules in dist; the library's trajectories are the same bytes by it and by Python
	.ci/compiled

clean:
	rm -rf $(VENV) $(READERS) out build dist
