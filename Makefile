# The two commands a newcomer needs: `make demo` and `make test`. `make help` lists the rest.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := demo-output

.PHONY: help setup guest browser demo test test-slow test-camera soak fuzz check bench recordings lock clean

help: ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 14

setup: $(VENV)/.ready ## .venv/bin/fishlight, from the lock, and the system's GL parts

$(VENV)/.ready: requirements.lock pyproject.toml setup.sh
	PYTHON=$(PYTHON) ./setup.sh $(VENV)
	@touch $@

guest: ## the system's parts that the camera's tests boot a guest with: QEMU and busybox
	./setup.sh --guest

browser: ## the system's parts that the live page's and window's tests need: Chromium, Xvfb
	./setup.sh --browser

demo: setup ## replay the bundled recording: lights, maps, pictures and a video in demo-output/
	$(BIN)/fishlight replay recordings/outdoor -o $(DEMO) --count 64 --force
	@echo "Look at $(DEMO)/video.mp4, $(DEMO)/pictures/, $(DEMO)/maps/ and $(DEMO)/lights/."

# Kept whatever the shell says: without bytecode each test process takes 6 s more to begin.
test test-slow: export PYTHONDONTWRITEBYTECODE :=

test: setup ## the tests, on two processes; test-slow has the longest
	$(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder -q -m "not slow"

test-slow: setup ## the few tests that take longer than ten seconds, the camera's guest among them
	$(BIN)/python -m pytest -n 2 --dist loadscope -q -m slow

test-camera: setup guest ## the camera's tests on real kernel drivers, vivid's injected faults included
	FISHLIGHT_REQUIRE_GUEST=1 $(BIN)/python -m pytest -q tests/camera \
	    -o python_files="test_*.py vivid_faults.py"

soak: setup ## twenty minutes of a live session, watched and followed: memory, threads, counters
	$(BIN)/python -m tests.render.soak

fuzz: setup ## forge files for an hour or so, and read them
	$(BIN)/python -m pytest tests/test_fuzzed_files.py --hypothesis-profile=fuzz -q

check: setup ## formatter, linter, type checker, import contract
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: setup ## speed and accuracy against the peers: tests/benchmarks/results.json and its tables
	$(BIN)/python -m tests.benchmarks.bench

recordings: setup ## the bundled recordings again, from npm's @pmndrs/assets, and the README's pictures
	$(BIN)/python -m recordings.make
	$(BIN)/python -m recordings.gallery

lock: ## requirements.lock from pyproject.toml, with hashes (needs uv)
	uv pip compile -q --universal --python-version 3.11 --generate-hashes --extra dev \
	    --custom-compile-command "make lock" pyproject.toml -o requirements.lock

clean: ## everything that was made here
	rm -rf $(VENV) $(DEMO) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
