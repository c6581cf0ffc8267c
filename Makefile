# The one door. `make demo` and `make test` do all the set-up a fresh machine with Python 3.11 and make needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test check bench soak clean help

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/'

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c "import sys; sys.exit('Python 3.11 or newer is needed, this is ' + sys.version.split()[0]) if sys.version_info < (3, 11) else None"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	touch $(STAMP)

demo: $(STAMP)  ## install, then play a shipped hand through a shipped scene on simulated boards
	$(BIN)/haptics run playground --hand synthetic --out demo.h5 --picture demo.png --force

test: $(STAMP)  ## the tests (no torch needed)
	$(BIN)/python -m pytest -n auto --dist loadgroup

check: $(STAMP)  ## format, lint, types, architecture
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright

bench: $(STAMP)  ## timings, ratios measured side by side in one run
	$(BIN)/python -m pytest -m bench tests/bench -s

soak: $(STAMP)  ## the judged sizes: hundreds of kills, long random runs
	$(BIN)/python -m pytest -m soak -n auto --timeout=3600

clean:  ## forget the environment
	rm -rf $(VENV)
