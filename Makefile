# make demo: see it. make test: every check that needs no hardware, some 20 minutes on two cores. make check: the quick ones, about one.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
GENERATORS := packed_schema constants nominal_table golden_vectors protocol_page cli_page boards_page wiring_page state_page fault_page plant_page demo_picture membrane_pictures contact_pictures control_page chip_profile control_pictures calibration_picture pattern_pictures promises_page
EVERYDAY := -n 2 --dist worksteal -m "not slow and not chip" --ignore tests/house
QUICK := -n 2 --dist worksteal -m "not medium and not slow and not chip" --ignore tests/house --ignore docs/calibration.md --ignore docs/contact.md
COVERED := tests/bench tests/boards tests/cli tests/contact tests/demonstrations tests/examples tests/flash tests/native tests/planner tests/plot tests/sdk tests/studio tests/sweeps
UNCOVERED := tests/sdk/test_leaks.py
EMULATED := --target rp2040://wristband7?contact=0

.DEFAULT_GOAL := help
.PHONY: help setup demo test chip chip-long check lint generated micropython docs release release-trial bench day soak fuzz hostile leaks readers mutants generate lock clean

help: ## what can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

setup: $(READY) ## the virtual environment .venv with the bubbleskin command

$(READY): pyproject.toml build.lock requirements.lock
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("bubbleskin needs Python 3.11 or newer; this is " + sys.version.split()[0] + ". Try: make PYTHON=python3.12")'
	@echo "setting up $(VENV): a minute or two, once"
	@$(PYTHON) -m venv $(VENV) || { echo "Python cannot make virtual environments here; on Debian: apt-get install python3-venv"; exit 1; }
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement build.lock
	@$(BIN)/python -m pip install --quiet --require-hashes --no-build-isolation --requirement requirements.lock
	@$(BIN)/python -m pip install --quiet --no-build-isolation --no-deps --editable .
	@touch $@

demo: setup ## a simulated wristband takes two shapes; ends with a picture
	$(BIN)/bubbleskin demo

test: setup lint generated micropython ## every check that needs no hardware, some 20 minutes
	@echo "the everyday tests, 100 examples of each property; coverage, which makes them half as slow again, is of these"
	$(BIN)/python -m pytest $(EVERYDAY) --cov --cov-report= --cov-fail-under=0
	@echo "and of the slow tests of the SDK's rooms; its floor is one of both"
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "slow and not chip" $(COVERED) --ignore $(UNCOVERED) --cov --cov-append --cov-report=term
	@echo "what is left in memory, without coverage, which keeps some itself"
	$(BIN)/python -m pytest -n 2 -m "slow and not chip" $(UNCOVERED)
	@echo "the firmware's arithmetic as Python that raises where a result leaves 32 bits"
	BUBBLESKIN_JIT=check $(BIN)/python -m pytest -q -n 2 tests/firmware/test_golden_traces.py tests/firmware/test_arithmetic.py
	@echo "hil_tests where bubbles touch"
	$(BIN)/python -m pytest -q -n 2 hil_tests --target "sim://wristband7"
	@echo "the slow tests of all else that needs no emulated chip, 2,000 scenarios of the promises among them"
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "slow and not chip" $(COVERED:%=--ignore %)

chip: setup micropython ## build the RP2040's firmware, run its tests and hil_tests on an emulated chip, 12 minutes
	$(BIN)/bubbleskin firmware build
	$(BIN)/python -m pytest -n 2 -m "chip and not long"
	$(BIN)/python -m pytest -n 2 hil_tests $(EMULATED)

chip-long: setup micropython ## what takes longer on an emulated chip
	$(BIN)/bubbleskin firmware build
	$(BIN)/python -m pytest -n 2 -m "chip and long"

check: setup lint ## lint, types, imports, rules, and the tests that take less than half a second: about a minute
	@echo "the quick tests, 20 examples of each property; one that takes a second is named, and wants the mark medium"
	BUBBLESKIN_EXAMPLES=20 $(BIN)/python -m pytest -q $(QUICK) --durations=5 --durations-min=1

lint: setup ## style, types, import contracts, the rules of tests/house
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache --no-logo
	$(BIN)/python -m pytest -q -n 2 tests/house

generated: setup ## fail if a generated file is out of date
	@for tool in $(GENERATORS); do $(BIN)/python tools/generate/$$tool.py --check || exit 1; done; $(BIN)/python tools/generate/lock.py --check && echo "generated files are up to date"

lock: setup ## versions and hashes of what setup installs, after a change of requirements; asks the package index
	$(BIN)/python tools/generate/lock.py

generate: setup ## write all generated files
	@for tool in $(GENERATORS); do $(BIN)/python tools/generate/$$tool.py || exit 1; done

micropython: setup ## build the real MicroPython that the tests run on, once
	$(BIN)/python tools/build_micropython.py

docs: setup ## the site, in build/site: fails at a link, an anchor or a page of no menu that leads nowhere
	$(BIN)/python -m sphinx -q -W --keep-going -b html -d build/site-doctrees -c docs/site . build/site
	@echo "build/site/index.html"

release: setup ## sdist, wheel, UF2s, bill of materials and checksums of this commit, in dist; minutes the first time; uploads nothing
	$(BIN)/python tools/release/make.py

release-trial: setup ## the wheel of dist in an empty environment without a compiler: installed, and its demo run
	$(BIN)/python tools/release/trial.py dist/bubbleskin-*/*.whl

soak: setup ## a million commands over a line that fails, ten minutes
	$(BIN)/python tools/stress/soak.py

fuzz: setup ## look for bytes that harm the firmware, ten minutes; keeps what it finds in tests/firmware/corpus.txt
	$(BIN)/python tools/stress/fuzz.py

hostile: setup micropython ## 100,000 requests that nobody should send, for each board on MicroPython, three minutes
	$(BIN)/python tools/stress/hostile.py

leaks: setup micropython ## 500 connections to each target but the chip, and 100,000 states: what is left of them; ten minutes
	$(BIN)/python tools/stress/leaks.py

readers: setup ## 100,000 files that are none, for every reader; six minutes
	$(BIN)/python tools/stress/readers.py

mutants: setup micropython ## plant mistakes, one at a time, and look what finds them: a list, then a sample of mutmut's; an hour
	$(BIN)/python tools/report/mutants.py; listed=$$?; $(BIN)/python tools/report/mutation_score.py && exit $$listed

bench: setup ## measure speeds
	$(BIN)/bubbleskin bench

day: setup micropython ## 24 virtual hours with faults and reconnects on MicroPython: counters and heap; most of an hour
	$(BIN)/python tools/stress/day.py

clean: ## remove what setup and tests made here
	rm -rf $(VENV) build dist .coverage .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find protocol firmware host_sdk tools tests hil_tests -name __pycache__ -type d -prune -exec rm -rf {} +
