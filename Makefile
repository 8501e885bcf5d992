# Every verb does its own set-up: a virtual environment with the locked versions, made once and kept in .venv.

PYTHON ?= python3
ARM ?= sasaki2012-lab

BIN := .venv/bin
RIG := tests/data/quanser-2dsfl
INSTALLED := .venv/.installed
BROWSER_INSTALLED := .venv/.browser
DOCS_INSTALLED := .venv/.docs
LOWEST := .venv-lowest
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check install -c requirements.lock

# What `make survey` runs, one module of tests a line; each takes a size and a seed.
SIZE ?= 100
SEED ?= 1
SURVEYS := \
	left_out \
	golden \
	plausible.survey \
	properties \
	audit.test_planted_slips \
	exact.accuracy \
	response.test_rigid \
	response.test_extrema \
	spectrum.damped \
	spectrum.chains \
	loop.agreement \
	loop.loci \
	loop.law_counts \
	synthesis.designs \
	synthesis.agreement_design \
	reduced.test_accuracy \
	loop.settled \
	loop.law_orders \
	loop.single_laws \
	loop.norms \
	fitting.planted \
	fitting.expected \
	studies.kills \
	studies.planted \
	tuner.bounded \
	exported.laws \
	exported.worst \
	exported.tuners \
	cli.fuzz \
	cli.stops \
	assessment.steps \
	report.plausible \
	report.twice

.PHONY: help install reports modes bode margins locus sampled tune audit docs test lowest test-browser kernels survey lint bench clean

help: ## list these verbs
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | while IFS="$$(printf '\t')" read -r verb what; do \
		printf '  make %-12s %s\n' "$$verb" "$$what"; done

install: $(INSTALLED) ## set up .venv with the locked versions and the tfarm command

reports: $(INSTALLED) ## write every preset's report, and that of a real rig's controllers, to reports/index.html
	@$(BIN)/tfarm report --out reports
	@$(BIN)/tfarm report $(RIG)/rig.toml --law $(RIG)/lqg.toml --law $(RIG)/hinf.toml --only sampled --out reports

modes: $(INSTALLED) ## write one arm's modal tables and shapes (ARM=name-or-file)
	@$(BIN)/tfarm report '$(ARM)' --only modes --out reports

bode: $(INSTALLED) ## write one arm's Bode plots (ARM=name-or-file)
	@$(BIN)/tfarm report '$(ARM)' --only bode --out reports

margins: $(INSTALLED) ## write one arm's map of gains, verdict and margins (ARM=name-or-file)
	@$(BIN)/tfarm report '$(ARM)' --only margins --out reports

locus: $(INSTALLED) ## write one arm's root loci (ARM=name-or-file)
	@$(BIN)/tfarm report '$(ARM)' --only locus --out reports

sampled: $(INSTALLED) ## write one arm's sampled loop: overlay, loci, time responses (ARM=name-or-file)
	@$(BIN)/tfarm report '$(ARM)' --only sampled --out reports

tune: $(INSTALLED) ## write one arm's gain tuner beside what it has to beat (ARM=name-or-file)
	@$(BIN)/tfarm report '$(ARM)' --only tune --out reports

audit: $(INSTALLED) ## check the paper equation by equation
	@$(BIN)/tfarm proof audit

docs: $(DOCS_INSTALLED) ## write the documentation to docs/_build/html/index.html
	@$(BIN)/python -m sphinx -q -W --keep-going docs docs/_build/html && echo docs/_build/html/index.html

test: $(INSTALLED) ## run the tests
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 --dist loadfile # else each process compiles what it loads

lowest: $(LOWEST)/.installed ## run the tests with the lowest versions that pyproject.toml allows
	@PYTHONDONTWRITEBYTECODE= $(LOWEST)/bin/python -m pytest -n 2 --dist loadfile

test-browser: $(INSTALLED) ## open pages in Chromium: errors, digits, times, phone, dark, axe, Nu (ONLY=--marked: CI's part)
	@if ! { command -v chromium || command -v chromium-browser || command -v google-chrome; } > /dev/null; then \
		echo "no Chromium on this machine: the browser tests are left out"; \
	elif ! $(MAKE) --silent $(BROWSER_INSTALLED); then \
		echo "the packages of the browser tests cannot be installed here: they are left out"; \
	else $(BIN)/python -m pytest tests/browser/pages.py tests/browser/sound.py -n 0 $(if $(ONLY),-m quick); fi

kernels: $(INSTALLED) ## run the numerical rooms under other kernels of BLAS and NumPy (ONLY=--marked: CI's minute)
	@$(BIN)/python -m tests.kernels $(ONLY)

survey: $(INSTALLED) ## search random cases for a wrong answer (SIZE, SEED, SURVEYS=one or more)
	@failed=; for each in $(SURVEYS); do echo "== $$each $(SIZE) $(SEED)"; \
		OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.$$each $(SIZE) $(SEED) || failed="$$failed $$each"; done; \
		test -z "$$failed" || { echo "failed:$$failed"; exit 1; }

lint: $(INSTALLED) ## check style, types and which room imports which
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

bench: $(INSTALLED) ## measure speed, beside other packages
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.bench

clean: ## remove everything that was generated
	@rm -rf .venv $(LOWEST) build dist docs/_build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	@find reports -mindepth 1 -maxdepth 1 ! -name README.md ! -name pictures -exec rm -rf {} +
	@find tfarm tests -name __pycache__ -type d -prune -exec rm -rf {} +

# pip alone would byte-compile on one core, with every package's own tests and with what is never imported again: itself
# and what mypy has as machine code.  Meanwhile one process compiles the numerical kernels, which numba then keeps on
# disk: two would each compile those that kernels call.
NOT_COMPILED := /tests?/|/(pip|setuptools|pkg_resources|mypy|mypyc)/|/pygments/(lexers|styles)/
$(INSTALLED): pyproject.toml requirements.lock
	$(if $(shell $(PYTHON) -c 'import sys; print("yes" * (sys.version_info >= (3, 11)))' 2>/dev/null),,$(error \
		tfarm needs Python 3.11 or newer; name one, e.g. make PYTHON=python3.12))
	@echo "setting up .venv (once; a minute or two)"
	@$(PYTHON) -m venv .venv
	@$(PIP) --no-compile -e '.[dev]'
	@touch $@
	@{ $(BIN)/python -m compileall -q -x '$(NOT_COMPILED)' .venv/lib tfarm tests || true; } & \
		$(BIN)/python -m tests.exact.signatures && wait $$!

# pip itself knows only the newest versions
$(LOWEST)/.installed: pyproject.toml
	@$(PYTHON) -m venv $(LOWEST)
	@$(LOWEST)/bin/python -m pip --quiet --disable-pip-version-check install uv
	@$(LOWEST)/bin/uv pip install --quiet --python $(LOWEST)/bin/python --resolution lowest-direct -e '.[dev]'
	@touch $@

$(BROWSER_INSTALLED) $(DOCS_INSTALLED): .venv/.%: $(INSTALLED)
	@$(PIP) -e '.[$*]'
	@touch $@
