# make study : set up .venv and run the main job     make test : set up .venv and run the default tests
# make guards : the rules of the house, forged and damaged files, second witnesses, the public surface; part of make test
# make docs : the site in build/site; its blocks are run, and what they print is compared with the pages
# make slow : the tests that make test leaves out, 20 minutes on two cores
# make test-all : lint, all tests, the site, the lowest versions of pyproject.toml, no compiler, no extras, wheel and sdist (.ci/gates)
# Python >= 3.11 as python3; PYTHON=... for another one.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: study quick test guards test-all slow docs lint lowest no-compiler no-extras packaging bench clean
.NOTPARALLEL: # test-all stops at the first that fails, and make names it

$(STAMP): pyproject.toml constraints.txt setup.py $(wildcard identification/recursive/kernel/*.[ch])
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed, this is " + sys.version.split()[0] + ": make PYTHON=python3.12")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[logs,labelled,campaigns,rigorous,shell,live,fmu,test]'
	touch $(STAMP)

study: $(STAMP)
	$(BIN)/symheli study

quick: $(STAMP)
	$(BIN)/symheli study --quick

# what one process has compiled, the others and the programs that tests start read, whatever the environment says
test guards slow: export PYTHONDONTWRITEBYTECODE :=
test: $(STAMP)
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist loadfile

guards: $(STAMP)
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist loadfile -m 'guard and not slow' $$(grep -rl --include='*.py' 'mark\.guard' tests)

test-all: lint test slow docs lowest no-compiler no-extras packaging

slow: $(STAMP)
	@echo "== slow: the tests that make test leaves out"
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist loadfile -m slow

docs: $(STAMP)
	@echo "== docs: the site, every page run"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[docs]'
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -c docs/site docs build/site

lowest no-compiler no-extras packaging:
	@$(PYTHON) .ci/gates $@

lint: $(STAMP)
	@echo "== lint: what is read without running"
	$(BIN)/ruff check . .ci/gates
	$(BIN)/ruff format --check . .ci/gates
	$(BIN)/pyright

bench: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[benchmark]'
	$(BIN)/python benchmarks/model.py --write
	$(BIN)/python benchmarks/flights.py --write
	$(BIN)/python benchmarks/identification.py --write
	$(BIN)/python benchmarks/analysis.py --write
	$(BIN)/python benchmarks/closed_loop_certificates.py --write
	$(BIN)/python benchmarks/synthesis.py --write
	$(BIN)/python benchmarks/designs_near_optimum.py --write
	$(BIN)/python benchmarks/gains_of_loops.py --write
	$(BIN)/python benchmarks/controller_step.py --write
	$(BIN)/python benchmarks/board.py --write
	$(BIN)/python benchmarks/campaigns.py --write

clean:
	rm -rf $(VENV) study build docs/api *.egg-info
