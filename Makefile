# Each target sets up what it needs by itself: .venv/, the dependencies, and a way to render.
# PYTHON chooses the interpreter that makes .venv (3.11 or newer).
# HAND=seen shows the demo without a marker on the hand, CAN=seen without one on the can;
# DETECTOR=FILE sees the hand by a file of `kengoro hand-detector`.

PYTHON ?= python3
HAND ?= $(if $(DETECTOR),seen,marker)
CAN ?= marker
DETECTOR ?=
VENV := .venv
PY := $(VENV)/bin/python
PIP := $(PY) -m pip --disable-pip-version-check --quiet
SEEN := $(patsubst %,-%,$(filter-out marker,$(HAND)))$(patsubst %,-can-%,$(filter-out marker,$(CAN)))
INSTALLED := $(VENV)/.installed
DOCS := $(VENV)/.docs
RL := $(VENV)/.rl
RENDERS := $(VENV)/.renders
PARALLEL := -n auto --maxprocesses 4 --dist worksteal
# Files with tests that import torch: pytest imports no others to find them. The second are those
# that only have such tests.
TORCH = $(shell grep -rl --include='test_*.py' 'mark\.torch' tests)
ONLY_TORCH = $(shell grep -rl --include='test_*.py' '^pytestmark = pytest\.mark\.torch' tests)
PACKAGES := kengoro kengoro_env jmm_agent reality_gap mjcf_sandbox hidden_plants experiments benchmarks tools/fuzz

# Tests start hundreds of interpreters, each of which would compile all packages.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-all check docs distributions clean

demo: $(INSTALLED) $(RENDERS)
	$(PY) -m experiments can-grasping --seeds 100-100 --hand $(HAND) --can $(CAN) \
	  $(if $(DETECTOR),--detector $(DETECTOR)) --out out/can-grasping$(SEEN)

# Triton, which comes with torch on Linux, crashes when it is imported after Mesa has drawn.
test: $(INSTALLED) $(RENDERS)
	$(PY) -m pytest -m "torch and not slow" $(PARALLEL) $(TORCH)
	$(PY) -m pytest -m "not torch and not slow" $(PARALLEL) $(addprefix --ignore=,$(ONLY_TORCH))

test-all: $(RL) $(RENDERS)
	$(PY) -m pytest -m torch $(PARALLEL) $(TORCH)
	$(PY) -m pytest -m "not torch" $(PARALLEL) $(addprefix --ignore=,$(ONLY_TORCH))

check: $(INSTALLED)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy $(PACKAGES)
	$(VENV)/bin/lint-imports

docs: $(DOCS)
	$(VENV)/bin/mkdocs build --strict

distributions: $(INSTALLED)
	$(PY) tools/try_distributions.py python3.11 python3.12 python3.13

clean:
	rm -rf $(VENV) out dist build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(INSTALLED): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)"; exit 1; }
	@test -x $(PY) && $(PY) -m pip --version >/dev/null 2>&1 \
	  || $(PYTHON) -m venv --clear $(VENV) \
	  || { echo "Python's venv module is missing: apt-get install python3-venv"; exit 1; }
	@echo "Installing the dependencies into $(VENV) (minutes the first time) ..."
	@$(PIP) install --editable '.[dev]'
	@touch $@

$(DOCS): $(INSTALLED)
	@$(PIP) install --editable '.[docs]'
	@touch $@

$(RL): $(INSTALLED)
	@$(PIP) install --editable '.[dev,rl]'
	@touch $@

$(RENDERS): tools/ensure_rendering.py | $(INSTALLED)
	@$(PY) tools/ensure_rendering.py
	@touch $@
