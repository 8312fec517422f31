# Two commands are enough on a fresh machine: make demo, make test.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# Small matrix products are slower on several BLAS threads than on one.
export OPENBLAS_NUM_THREADS ?= 1
# Tests and the demo start many processes, and each would compile all that it imports again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install demo test test-slow browser-test lint docs bench lock clean

help:  ## say what can be made
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 16

install: $(READY)  ## create .venv from requirements.lock

$(READY): requirements.lock pyproject.toml
	@if command -v uv >/dev/null; then \
	  uv venv --quiet --clear --python 3.11 .venv && \
	  uv pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock && \
	  uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e . ; \
	else \
	  $(PYTHON) -m venv --clear .venv && \
	  $(BIN)/python -m pip install --quiet --require-hashes -r requirements.lock && \
	  $(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e . ; \
	fi
	@touch $@

DEMO := reports/demo
SEED ?= 0

demo: $(READY)  ## study a tilt-wing, then diagnose flights with an effect that a sealed file names; prints the report
	@$(BIN)/freqid study la8 --at u20,u45,u70 --no-page -o $(DEMO)
	@$(BIN)/freqid margins $(DEMO)/model.h5 la8 --at u20,u30,u45,u70 --beside la8 --no-page -o $(DEMO)/margins.h5
	@$(BIN)/freqid fly-sealed la8 $(DEMO)/design.h5 --at u30,u45 --duration 60 --seed $(SEED) -o $(DEMO)/sealed
	@$(BIN)/freqid diagnose-gap $(DEMO)/sealed/u30.h5 $(DEMO)/sealed/u45.h5 --scenario la8 --no-page \
	  -o $(DEMO)/sealed/gap.h5
	@$(BIN)/freqid open-seal $(DEMO)/sealed/seal.h5 $(DEMO)/sealed/gap.h5
	@$(BIN)/freqid report $(DEMO) $(DEMO)/sealed/gap.h5 $(DEMO)/sealed/gap-trial.h5 --scenario la8 -o $(DEMO)/index.html

test: $(READY) lint  ## everything that must hold: up to 20 minutes on two cores, by the machine
	$(BIN)/pytest -n 2 --dist worksteal

test-slow: $(READY)  ## tests that are marked slow: recovery on larger cases, further seeds
	$(BIN)/pytest -n 2 --dist worksteal -m slow

browser-test: demo  ## the demo's pages in chromium (Debian's, installed if it is missing)
	@$(BIN)/python -c "import playwright, axe_playwright_python" 2>/dev/null || \
	  if command -v uv >/dev/null; then uv pip install --quiet --python $(BIN)/python -e '.[browser]'; \
	  else $(PYTHON) -m pip --python $(BIN)/python install --quiet -e '.[browser]'; fi
	@command -v chromium >/dev/null || \
	  if [ "$$(id -u)" = 0 ]; then apt-get update -q && apt-get install -qy chromium; \
	  else sudo apt-get update -q && sudo apt-get install -qy chromium; fi
	FREQID_STUDY=reports/demo $(BIN)/pytest -n 0 tests/browser

lint: $(READY)  ## style, types and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyrefly check
	$(BIN)/lint-imports

docs: $(READY)  ## build docs/ into site/
	$(BIN)/mkdocs build --quiet --strict

bench: $(READY)  ## print every benchmark and rewrite its result table
	@for script in benchmarks/[a-z]*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

lock:  ## choose versions anew (needs uv)
	uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 --generate-hashes \
	  --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" --quiet --upgrade -o requirements.lock

clean:  ## remove what can be made again
	rm -rf .venv site .cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
