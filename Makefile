# Every target sets up what it needs in ./.venv: nothing global, only Python (3.11 to 3.14) and make are required.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
OUT    ?= out/demo-fixed
TYPED  := build/typed
# two processes that share files of tests, not single tests: a file's experiments are simulated once; tests/conftest.py orders
SHARED := -n 2 --dist loadfile --no-loadscope-reorder
# tests start dozens of Pythons: each would compile every source again
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo web test test-web test-slow dev lint bench clean

demo: $(VENV)/.demo ## the paper's first experiment: table, figure, csv, video
	$(BIN)/qpsafe demo fixed --out $(OUT)

web: $(VENV)/.web ## a robot among people, in the browser
	$(BIN)/qpsafe web --open

test: $(VENV)/.dev
	$(BIN)/python -m pytest $(SHARED) -m "not slow and not web"

test-web: $(VENV)/.browser ## the page in a real browser: Chromium, where it is installed
	$(BIN)/python -m pytest -m web -p no:xdist tests/sim/web

test-slow: $(VENV)/.dev
	$(BIN)/python -m pytest $(SHARED) -m "not web"

dev: $(VENV)/.dev ## everything for working on the project
	@echo "ready: $(BIN)/qpsafe --help"

lint: $(VENV)/.dev $(TYPED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	cd $(TYPED) && $(CURDIR)/$(BIN)/mypy --config-file $(CURDIR)/pyproject.toml --cache-dir $(CURDIR)/.mypy_cache -p qpsafe

# Static checkers do not follow setuptools' package-dir: they are shown the packages as they lie in the wheel. The links
# are kept out of the source tree, where tests would come to need them.
.PHONY: $(TYPED)
$(TYPED):
	@rm -rf $@ && mkdir -p $@/qpsafe
	@ln -s $(CURDIR)/qpsafe/* $@/qpsafe/
	@for name in tasks robots sim; do ln -sfn $(CURDIR)/$$name $@/qpsafe/$$name; done

bench: $(VENV)/.bench ## the tick, its parts and its peers; the hierarchical solvers against exact arithmetic
	$(BIN)/qpsafe bench --out bench.json
	$(BIN)/qpsafe bench --compile --out bench-compile.json
	$(BIN)/python benchmarks/bench_hqp.py --out bench-hqp.json
	$(BIN)/python benchmarks/bench_gate.py bench-gate.json

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; ok = (3, 11) <= sys.version_info[:2] <= (3, 14); sys.exit(0 if ok else "qpsafe needs Python 3.11 to 3.14, found " + sys.version.split()[0] + "; try: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[video]'
	@touch $@

$(VENV)/.web: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[web]'
	@touch $@

$(VENV)/.browser: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,browser]'
	@touch $@

$(VENV)/.dev: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@ $(VENV)/.demo $(VENV)/.web

$(VENV)/.bench: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[video,bench]'
	@touch $@

clean:
	rm -rf $(VENV) out build *.egg-info bench.json bench-compile.json bench-hqp.json
