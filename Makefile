# Everything happens in .venv, at the versions of requirements.lock, checked by hash. requirements-demo.lock is the
# part of it that the demo needs.
PYTHON ?= $(shell for p in python3.14 python3.13 python3.12 python3.11 python3; do \
	$$p -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo $$p; break; }; done)
BIN := .venv/bin
KERNELS := $(shell grep -rlE --include='*.py' '^@(inlined_)?kernel|^@intrinsic|njit|JITCodeLibrary' src)
WORKERS ?= 2
# In addition to the base: what an editable installation and the picture of the demo need.
DEMO := hatchling hatch-fancy-pypi-readme editables matplotlib

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup install demo test slow faults soak check docs gallery figures lock clean

help:
	@echo "make setup    make .venv with everything the tests use"
	@echo "make demo     watch the simulated sensor being pressed    ARGS=\"--seconds 5 --no-view\""
	@echo "make test     run the tests                               ARGS=\"-k lattice\""
	@echo "make slow     run the long accuracy suites too"
	@echo "make faults   try 10 000 damaged and hostile inputs, floods of messages, kills"
	@echo "make soak     a live session of a million frames: memory, threads, latency"
	@echo "make check    ruff, mypy and the import rules"
	@echo "make docs     build the documentation site in docs/_build/html"
	@echo "make gallery  make the pictures of the gallery again         ARGS=\"slip shear\""
	@echo "make figures  make the pictures of README and pages again"
	@echo "make lock     renew requirements.lock and requirements-demo.lock (needs uv)"

setup: .venv/ready
	@echo "ready: now run $(BIN)/manytouch doctor, or $(BIN)/manytouch process VIDEO --out results"

.venv/ready: requirements.lock pyproject.toml
	@$(MAKE) --no-print-directory install LOCK=requirements.lock SIZE="about 2.8 GB in some 6 minutes"
	@touch .venv/ready .venv/demo

# Nothing is to be installed where .venv has everything that the tests use. The lock file is complete, and Python
# keeps the bytecode of what the demo imports: to resolve and compile all packages takes longer than to unpack them.
.venv/demo: requirements-demo.lock pyproject.toml
	@test .venv/ready -nt requirements-demo.lock -a .venv/ready -nt pyproject.toml || \
		$(MAKE) --no-print-directory install LOCK=requirements-demo.lock FLAGS="--no-deps --no-compile" SIZE="about 1 GB in about a minute"
	@touch .venv/demo

install:
	@test -n "$(PYTHON)" || { echo "manytouch needs Python 3.11 or newer with venv; none was found. Install it, or specify it: make PYTHON=/path/to/python3"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv || { echo "$(PYTHON) cannot make a virtual environment: install its venv package (on Debian: apt install python3-venv)"; exit 1; }
	@echo "setting up .venv at the versions of $(LOCK): downloads and installs its packages ($(SIZE)) without further lines"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes $(FLAGS) -r $(LOCK)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .

# Compiled code is kept beside its source, but does not notice changes in the modules it calls.
.venv/compiled: $(KERNELS) | .venv/demo
	@find src -name '*.nb[ic]' -delete
	@touch .venv/compiled

demo: export PYTHONDONTWRITEBYTECODE =
demo: .venv/compiled
	@$(BIN)/manytouch demo $(ARGS)

# Each worker and each program that a test starts imports the package: bytecode is kept, whatever the environment says.
test slow: export PYTHONDONTWRITEBYTECODE =
test slow: export CHECK_TYPES = 1

# Kernels are compiled first, each once: two workers would compile the same ones at the same time.
# Files run in the order of their names, the system tests early: long files at the end would leave a worker idle.
test: .venv/ready .venv/compiled
	@$(BIN)/python -c "from manytouch.session.warm_up import warm_up_kernels as warm_up; warm_up('mechanics'); warm_up('perimeter')"
	@$(BIN)/python -m pytest -m "not slow" -n $(WORKERS) --dist loadfile --no-loadscope-reorder $(ARGS)

slow: .venv/ready .venv/compiled
	@$(BIN)/python -m pytest $(ARGS)

faults: .venv/ready .venv/compiled
	@$(BIN)/python tests/faults/run.py $(ARGS)
	@$(BIN)/python tests/faults/floods.py
	@$(BIN)/python tests/faults/kills.py
	@$(BIN)/python tests/faults/recording_kills.py

soak: .venv/ready .venv/compiled
	@$(BIN)/python tests/faults/soak.py $(ARGS)

check: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: .venv/ready .venv/compiled
	$(BIN)/sphinx-build --builder html --fresh-env --fail-on-warning --keep-going --quiet docs docs/_build/html

gallery: .venv/ready .venv/compiled
	$(BIN)/python examples/gallery/make.py $(ARGS)

figures: .venv/ready .venv/compiled
	$(BIN)/python docs/extensions/figures.py

lock:
	uv pip compile pyproject.toml --all-extras --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-header --quiet --output-file requirements.lock
	printf '%s\n' $(DEMO) | uv pip compile pyproject.toml - --universal --python-version 3.11 --generate-hashes \
		--constraint requirements.lock --no-emit-index-url --no-header --quiet --output-file requirements-demo.lock

clean:
	rm -rf .venv out dist
