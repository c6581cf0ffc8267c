# The one door. `make demo` and `make test` do all the set-up a fresh machine with Python 3.11 and make needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
FUZZ_S ?= 60

.PHONY: demo test slow check docs docs-links bench soak mutants clean help protocol firmware firmware-flash fuzz firmware-fuzzers

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/'

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c "import sys; sys.exit('Python 3.11 or newer is needed, this is ' + sys.version.split()[0]) if sys.version_info < (3, 11) else None"
	@echo "== installing into $(VENV): about a hundred packages, a few minutes the first time"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install -c constraints.txt -e '.[dev]'
	touch $(STAMP)

demo: $(STAMP)  ## install, then play a shipped hand that grasps a ball on simulated boards
	@echo "== playing 4 s of a hand on simulated boards; the first time, its inner loops are compiled first (half a minute)"
	$(BIN)/haptics run examples/ball.toml --hand synthetic --out demo.h5 --picture demo.png --force
	@echo "== demo.png shows what was felt, demo.h5 holds all of it; for the commands of the README: . $(BIN)/activate"

test: $(STAMP)  ## the tests (no torch needed); those of seconds are in make slow
	$(BIN)/python -m pytest -n auto --dist worksteal

slow: $(STAMP)  ## what make test leaves out: whole devices, garments and programs, firmware on the simulated chip
	$(BIN)/python -m pytest -m "slow and not soak and not bench" -n auto --dist loadfile

check: $(STAMP)  ## format, lint, types, architecture
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright

docs: $(STAMP)  ## the documentation site, into build/site; a warning fails it, no network is used
	rm -rf docs/reference/api
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/site
	@echo "build/site/index.html"

docs-links: $(STAMP)  ## try every link of the pages that leads elsewhere (needs the network)
	$(BIN)/python -m sphinx -q -b linkcheck -d build/doctrees docs build/linkcheck

bench: $(STAMP)  ## timings, ratios measured side by side in one run
	$(BIN)/python -m pytest -m bench tests/bench

soak: $(STAMP)  ## the judged sizes: hundreds of kills, long random runs
	$(BIN)/python -m pytest -m soak -n auto --timeout=3600

mutants: $(STAMP)  ## safety code broken on purpose, one break at a time: the tests must find each
	$(BIN)/python tests/mutants/run.py

protocol: $(STAMP)  ## bring the C header and the protocol page up to date with the message table
	$(BIN)/python -m firmware_models.cores.c_headers
	$(BIN)/python tools/protocol_page.py

firmware:  ## the images of both boards, into build/firmware (avr-gcc, no Python)
	@command -v avr-gcc >/dev/null || { echo "avr-gcc not found: install gcc-avr, binutils-avr and avr-libc"; exit 1; }
	@$(MAKE) --no-print-directory -C firmware_models/firmware avr OUT=$(CURDIR)/build/firmware

firmware-flash:  ## flash BOARD=tactiles or brake on PORT=/dev/..., by the Arduino boot loader
	@case "$(BOARD)" in tactiles|brake) ;; *) echo "BOARD = '$(BOARD)' is not a board; allowed: BOARD=tactiles, BOARD=brake"; exit 1;; esac
	@[ -n "$(PORT)" ] || { echo "PORT is missing: which serial port is the board on? PORT=/dev/ttyACM0, for one"; exit 1; }
	@command -v avrdude >/dev/null || { echo "avrdude not found: install avrdude"; exit 1; }
	@$(MAKE) --no-print-directory firmware
	avrdude -p atmega328p -c arduino -b 115200 -P "$(PORT)" -U flash:w:build/firmware/$(BOARD).hex:i

fuzz: firmware-fuzzers  ## random streams against the C core, FUZZ_S seconds a board
	build/fuzz/fuzz_tactiles -max_total_time=$(FUZZ_S) -max_len=400 -len_control=0 build/fuzz/corpus_tactiles
	build/fuzz/fuzz_brake -max_total_time=$(FUZZ_S) -max_len=400 -len_control=0 build/fuzz/corpus_brake

firmware-fuzzers:
	$(MAKE) -C firmware_models/firmware fuzz OUT=$(CURDIR)/build/fuzz
	mkdir -p build/fuzz/corpus_tactiles build/fuzz/corpus_brake

clean:  ## forget the environment
	rm -rf $(VENV)
