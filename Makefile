# Two commands do all the set-up: 'make reproduce' and 'make test'.  'make help' lists the rest.
SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
export PROFILE ?= quick
PORT ?= 8000
VO_PYTHON ?= $(PYTHON)

# The same bytes from every run: a fixed build date, hash seed and number of BLAS threads.
export SOURCE_DATE_EPOCH := 1767225600
export PYTHONHASHSEED := 0
export OPENBLAS_NUM_THREADS := 1
# Waiting OpenMP threads sleep instead of spinning: several times faster beside any other busy process.
export OMP_WAIT_POLICY := PASSIVE
# Chapters run in this environment's kernel, whatever kernels the user has installed.
export JUPYTER_PREFER_ENV_PATH := 1
unexport JUPYTER_PATH PYTHONPATH
# Figures go where each cell is; with another backend there would be none.
unexport MPLBACKEND
# Matplotlib's settings and list of fonts are this environment's: a broken one of the user's would talk in a cell.
export MPLCONFIGDIR := $(CURDIR)/.venv/matplotlib
unexport MATPLOTLIBRC
# Of pages, so that processors round alike: bfloat16, where there is any, changes errors by a seventh.
book serve lab pdf: export LMMAP_PRECISION := float32

BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: help env reproduce evaluate test test-lmmap test-robustness test-pythons lint book check-book pdf serve lab train bench vo clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-16s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo "  Settings: PROFILE=quick|paper (now $(PROFILE)), PYTHON=python3.12, PORT=8000, DATA=FOLDER ADAPT=1"

env: $(STAMP)  ## make .venv from environment.txt

$(STAMP): environment.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null || { \
	  echo "lmmap needs Python 3.11, 3.12 or 3.13, and '$(PYTHON)' is $$($(PYTHON) --version 2>/dev/null || echo absent)."; \
	  echo "Name another one: make $(or $(MAKECMDGOALS),env) PYTHON=python3.12"; exit 1; }
	@echo "env: making .venv with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv .venv || { echo "env: '$(PYTHON) -m venv' failed; on Debian, install python3-venv."; exit 1; }
	@total=$$(grep -c '==' environment.txt); echo "env: installing $$total packages, a few minutes"; \
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar off -r environment.txt | \
	  awk -v total="$$total" '/^Collecting/ && ++n % 25 == 0 {print "env:   found " n " of " total; fflush()} \
	    /^Installing/ {print "env:   installing"; fflush()}'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation \
	  --config-settings editable_mode=compat -e .
	@$(BIN)/python -m pip check --disable-pip-version-check
	@touch $@
	@echo "env: ready"

reproduce: book  ## simulate, estimate, build the book, compare all with the reference (DATA=FOLDER: authors' bags too; ADAPT=1: networks learn from them)
	@$(if $(DATA),cat "data/derived/recordings/$$(basename "$$(realpath "$(DATA)")")/told.txt")
	@status=0; $(BIN)/python -m lmmap check || status=$$?; \
	echo "Open book: _build/html/index.html (or 'make serve', with which search works too)"; exit $$status

evaluate: env  ## make the accuracy study's results alone, resumable (PROFILE=paper takes hours; JOBS=2: two sequences at once)
	@$(BIN)/python -m lmmap reproduce --profile $(PROFILE) --jobs $(or $(JOBS),1)

ORACLES := .venv/.oracles

$(ORACLES): tests/oracles.txt $(STAMP)
	@echo "test: installing what only tests and benchmarks need"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c environment.txt -r tests/oracles.txt
	@touch $@

# Each process of the tests computes in one thread, or two of them would wait for each other.
PYTEST = OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(or $(JOBS),2) --dist worksteal

test: test-lmmap  ## run the tests: the thin package's alone, then all others (JOBS=4: on four processes, else on two)
	@$(PYTEST) --ignore tests/lmmap --ignore tests/robustness

test-lmmap: env $(ORACLES)  ## run the thin package's tests alone, where lmmap_lab cannot be imported
	@$(PYTEST) tests/lmmap

test-robustness: env $(ORACLES)  ## run what needs processes of its own or long compilations: attacks, full disks, interrupts, wheels, builds of a book, EVO
	@$(PYTEST) tests/robustness

test-pythons:  ## run both commands in a fresh clone, on each promised Python that is found here (half an hour each)
	@.ci/pythons test reproduce

lint: env  ## ruff, formatting, types, and the floors (imports run downward only)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

book: env  ## build the book, making the results that are absent or old; warnings are errors
	@echo "book: results, profile $(PROFILE)"
	@$(BIN)/python -m lmmap reproduce --profile $(PROFILE) --jobs $(or $(JOBS),$(if $(filter quick,$(PROFILE)),2,1))
	@$(if $(DATA),$(BIN)/python -m lmmap reproduce --profile $(PROFILE) --data "$(DATA)"$(if $(ADAPT), --adapt))
	@$(BIN)/python -c 'import matplotlib.pyplot' 2>/dev/null  # its first import may talk about fonts, in a cell
	@echo "book: building; chapters run only when they, the module or the data changed"
	@rm -rf _build/html  # or pages of modules that were renamed would stay; unchanged pages are only written again
	@$(BIN)/jupyter-book build . -W --keep-going --quiet || { rm -rf _build; \
	  echo "book: failed, see above; _build is gone, or the next build would pass over the page that failed"; exit 1; }
	@echo "book: _build/html/index.html"

check-book: $(ORACLES)  ## look at the built book in a browser: every page, narrow and wide, light and dark
	@test -f _build/html/index.html || { echo "check-book: no book yet; make book first"; exit 1; }
	@$(PYTEST) -rs tests/check_book.py tests/check_cells.py

pdf: book  ## print the book: _build/pdf/lmmap.pdf (needs Chromium)
	@$(BIN)/python book/_ext/lmmap_print.py

serve: book  ## show the book on http://localhost:8000
	@echo "serve: http://localhost:$(PORT) (Ctrl-C ends it)"
	@$(BIN)/python -m http.server $(PORT) --bind 127.0.0.1 --directory _build/html

lab: env  ## open the chapters as notebooks in JupyterLab (copies in _build/lab; the chapters stay as they are)
	@$(BIN)/python book/_ext/lmmap_notebooks.py _build/lab
	@JUPYTER_CONFIG_PATH=book/_lab $(BIN)/jupyter lab --ServerApp.root_dir=. _build/lab/intro.ipynb

train: env  ## train all twelve filters (an interrupted run goes on)
	@$(BIN)/python -m lmmap train

bench: $(ORACLES)  ## run the benchmarks against their peers
	@for file in benchmarks/bench_*.py; do echo "bench: $$file"; $(BIN)/python "$$file"; done

vo: env .venv-vo/.installed  ## run ORB-SLAM3, SVO (GPL-3, in .venv-vo) and EVO beside our method (less than an hour)
	@$(BIN)/python benchmarks/vo/run.py $(if $(WORKERS),--workers $(WORKERS)) $(if $(RUNS),--runs $(RUNS)) $(if $(METHODS),--methods $(METHODS))

.venv-vo/.installed: benchmarks/vo/requirements.txt
	@$(VO_PYTHON) -m venv .venv-vo
	@.venv-vo/bin/python -m pip install --quiet --disable-pip-version-check -r $< || { \
	  echo "vo: svo-cpp has packages for Python 3.11 and 3.12 on x86-64 Linux: make vo VO_PYTHON=python3.12"; exit 1; }
	@.venv-vo/bin/python -c 'import pyorbslam3, svo_cpp' || { echo "vo: on Debian or Ubuntu, first: apt-get install" \
	  "libgl1 libegl1 libopengl0 libglx0 libsm6 libice6 libx11-6 libxext6"; exit 1; }
	@touch $@

clean:  ## remove the book, derived data and caches; .venv stays
	rm -rf _build data/derived .pytest_cache .ruff_cache .mypy_cache .hypothesis .import_linter_cache
	find lmmap tests book benchmarks tuning -name __pycache__ -type d -prune -exec rm -rf {} +
