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

.PHONY: demo web test test-long test-web test-slow dev lint docs figures bench dist clean

demo: $(VENV)/.demo ## the paper's first experiment: table, figure, csv, video
	$(BIN)/qpsafe demo fixed --out $(OUT)

web: $(VENV)/.web ## a robot among people, in the browser
	$(BIN)/qpsafe web --open

test: $(VENV)/.dev
	$(BIN)/python -m pytest $(SHARED) -m "not slow and not long and not web"

test-long: $(VENV)/.dev ## whole experiments, commands from start to end, processes that die: what `make test` leaves out for its length
	$(BIN)/python -m pytest $(SHARED) -m "long and not slow and not web"

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

docs: $(VENV)/.docs ## the site, in build/docs/html; a warning is an error
	$(BIN)/python docs/recordings.py build/recordings
	$(BIN)/python -m sphinx -E -W --keep-going -q -j auto -b html -d build/docs/doctrees docs build/docs/html
	$(BIN)/python docs/site_pages/links.py build/docs/html
	@echo "docs: build/docs/html/index.html"

# with the back end of OpenGL that works here, unless MUJOCO_GL names one
figures: $(VENV)/.browser ## all figures of the docs again, from the code
	export MUJOCO_GL=$${MUJOCO_GL:-$$($(BIN)/python -m qpsafe.sim.drawing.gl)}; \
	for script in docs/figures*.py robots/*/picture.py; do $(BIN)/python $$script || exit 1; done

bench: $(VENV)/.bench ## the tick, its parts and its peers; the hierarchical solvers against exact arithmetic
	$(BIN)/qpsafe bench --out bench.json
	$(BIN)/qpsafe bench --compile --out bench-compile.json
	$(BIN)/python benchmarks/bench_hqp.py --out bench-hqp.json
	$(BIN)/python benchmarks/bench_gate.py bench-gate.json

dist: $(VENV)/.dev ## sdist and wheel, checked as an index would
	rm -rf dist
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[release]'
	$(BIN)/python -m build
	$(BIN)/python -m twine check --strict dist/*

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
	@touch $@ $(VENV)/.demo $(VENV)/.docs $(VENV)/.web

$(VENV)/.docs: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@touch $@

$(VENV)/.bench: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[video,bench]'
	@touch $@

clean:
	rm -rf $(VENV) out build dist *.egg-info bench.json bench-compile.json bench-hqp.json
