# Requires Python 3.11+ and make. `make test` says what else it needs.
PYTHON ?= python3
BIN := .venv/bin
# --no-compile: Python compiles what it imports; compiling every file of every dependency would delay the first page.
PIP := $(BIN)/python -m pip install --quiet --no-compile
# More than the cores of a small machine: much of the time the tests wait for browsers and servers.
PYTEST_WORKERS ?= 4
# Where this variable is set (in many images), every process compiles its imports again: 10 s instead of 2.
unexport PYTHONDONTWRITEBYTECODE
# Installed first and alone: with other packages, pip might choose a build that does not suit the machine.
TORCH := $(shell sed -n 's/.*"\(torch==[^"]*\)".*/\1/p' pyproject.toml)

.PHONY: help setup serve test test-slow bench audit gallery docs lint format system clean

help:
	@echo "make setup      create the Python environment in .venv, for everything except the tests"
	@echo "make serve      start kitchenmind at http://127.0.0.1:8000 (ARGS=... are passed on)"
	@echo "make test       run the tests that every change must pass"
	@echo "make test-slow  run the long tests"
	@echo "make lint       check style, spelling and types; make format fixes the style"
	@echo "make bench      run the measurements"
	@echo "make audit      list known vulnerabilities of the dependencies (asks PyPI)"
	@echo "make docs       build the documentation as a website in build/site"
	@echo "make gallery    make the pictures of docs/gallery: a simulated study, its dashboard and report"

setup: .venv/.complete
	@echo "Ready: make serve, or $(BIN)/kitchenmind --help"

serve: .venv/.serving
	@$(BIN)/kitchenmind serve $(ARGS)

test: .venv/.compiled system
	$(BIN)/python -m pytest -n $(PYTEST_WORKERS) --dist loadfile --no-loadscope-reorder -m "not slow" $(ARGS)

test-slow: .venv/.test
	@.ci/system nginx caddy
	$(BIN)/python -m pytest -m slow --timeout 3600 $(ARGS)

lint: .venv/.test
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/codespell
	$(BIN)/mypy
	$(BIN)/mypy --package docs.generate
	@.ci/lint-scripts

format: .venv/.test
	$(BIN)/ruff check --fix
	$(BIN)/ruff format
	@.ci/lint-scripts format

# Quick forms; the full ones take hours (benchmarks/faults.py: a thousand kills, an hour of soak) or more than ten minutes
# (benchmarks/foresight.py). A failure does not stop the others.
bench: .venv/.test
	@failed=; for script in benchmarks/*.py; do echo "== $$script"; \
	  case $$script in */faults.py|*/foresight.py|*/fit_*.py) quick=--quick ;; *) quick= ;; esac; \
	  $(BIN)/python $$script $$quick $(ARGS) || failed="$$failed $$script"; done; \
	  test -z "$$failed" || { echo "failed:$$failed"; exit 1; }

# A whole simulated study with pictures of it: minutes. ARGS="--participants 6" for a quick one.
gallery: .venv/.test system
	@$(BIN)/python tests/e2e/take_gallery.py $(ARGS)

# A broken link is an error. NO_MKDOCS_2_WARNING: mkdocs.yml explains that warning.
docs: .venv/.docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "Open build/site/index.html"

# Asks PyPI about known vulnerabilities of what is installed: needs the network, so it is not part of the tests.
audit: .venv/.test
	@$(PIP) --upgrade pip  # not ours to pin, and often all that is found
	@$(BIN)/pip-audit --skip-editable $(ARGS)

# Chromium, PostgreSQL and Redis: the tests use the real ones; the slow ones TLS proxies too.
system:
	@.ci/system

clean:
	rm -rf .venv node_modules build *.egg-info
	find . -name __pycache__ -prune -exec rm -rf {} +

# The stamp files make a second call free.
.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "kitchenmind needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version 2>&1 || echo missing)." >&2; \
	  echo "Install it, or name another one: make setup PYTHON=python3.12" >&2; exit 2; }
	@$(PYTHON) -m venv .venv || { rm -rf .venv; \
	  echo "Python cannot make a virtual environment here (on Debian and Ubuntu: apt-get install python3-venv)." >&2; exit 2; }

.venv/.serving: pyproject.toml | .venv/bin/python
	@echo "Installing what the server needs into .venv (less than a minute, once) ..."
	@$(PIP) --editable .
	@touch $@

.venv/.torch: .venv/.serving
	@echo "Installing torch ..."
	@$(PIP) $(TORCH)
	@touch $@

.venv/.complete: .venv/.torch
	@echo "Installing what training and analysis need ..."
	@$(PIP) --editable ".[training,analysis]"
	@touch $@

.venv/.docs: .venv/.serving
	@echo "Installing what the documentation's website needs ..."
	@$(PIP) --editable ".[docs]"
	@touch $@

.venv/.test: .venv/.torch
	@echo "Installing what the tests need ..."
	@$(PIP) --editable ".[training,analysis,test]"
	@touch $@

# Compile once, not in every worker of the tests at the same time: the bytecode of all imports, and the kernels of the
# game, of simulated participants, of the transformers and of training. Failures here fail again in the tests, which
# report them.
.venv/.compiled: .venv/.test
	@echo "Compiling what the tests load (a minute, once) ..."
	@{ $(BIN)/python -m pytest --collect-only; \
	  $(BIN)/python -c 'from models.inference import attention; attention.warm()'; \
	  $(BIN)/python -m pytest tests/training/test_predictors_in_play.py -k accurate_in_play; \
	  $(BIN)/python -m pytest tests/training/test_ppo.py -k "every_form or interrupted or advantages or fused"; \
	  } > /dev/null 2>&1 & \
	  $(BIN)/python -m pytest tests/overcooked/test_vector_env.py \
	    tests/server/bots/test_foresight.py -k "vector_env or acts_alike" > /dev/null 2>&1; wait
	@touch $@
