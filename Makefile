# `make help` lists the targets. Everything runs in .venv, which the first target makes; results go to out/.
SHELL := /bin/sh
.DEFAULT_GOAL := help
.PHONY: help setup setup-tests demo test test-long test-versions check sanitize processors bench bench-long compare docs clean
# A sourced ROS 2 would put its own packages, of another Python, in front of the environment's.
unexport PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH ROS_DISTRO
# Where a shell forbids bytecode, as many images do, every process compiles the sources that it imports.
unexport PYTHONDONTWRITEBYTECODE

BIN := .venv/bin
# Both parts of the tests, whichever fails, and one summary.
TESTS := $(BIN)/python tools/run_tests.py
# make demo ARGS='--cell my_cell.yaml'; make test ARGS='-k energy'; make bench ARGS='--seeds 3'
ARGS ?=
# make compare BEFORE=../checkout_of_another_commit, with its core built
BEFORE ?=

help:             ## this list
	@echo "make TARGET [ARGS='...'], with TARGET one of"
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{printf "%-12s %s\n", $$1, $$2}'

SET_UP := python=$$(PYTHON='$(PYTHON)' tools/find_python.sh) && "$$python" tools/set_up.py

setup:            ## make or complete .venv: ROS 2 Jazzy, interfaces, compiled core, packages
	@$(SET_UP)

setup-tests:      ## the same, and what checks, tests and benchmarks need
	@$(SET_UP) --tests

demo: setup       ## plan, drive, record and explain the demonstration cell
	@$(BIN)/ir demo $(ARGS)

test: setup-tests ## every test that takes seconds to a few minutes; it says how long all take
	@$(TESTS) -m 'not long' $(ARGS)

test-long: setup-tests ## every test, also those that run for minutes; then sanitizers, processors and versions
	@$(TESTS) $(ARGS)
	@[ -n '$(ARGS)' ] || PYTHON=$(CURDIR)/$(BIN)/python src/ir_kernels/sanitize.sh
	@[ -n '$(ARGS)' ] || $(BIN)/python tools/processors.py --tests
	@[ -n '$(ARGS)' ] || $(MAKE) --no-print-directory test-versions

test-versions: setup-tests ## the tests with the oldest versions, and with the newest on Python 3.12 and 3.13
	@$(BIN)/python tools/oldest_versions.py $(ARGS)
	@$(BIN)/python tools/oldest_versions.py --newest --python 3.12 --python 3.13 $(ARGS)

check: setup-tests ## ruff, mypy --strict and dead code
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/python tools/dead_code.py

processors: setup-tests ## are answers the same bytes on other processors? ARGS='--tests' also runs tests as they would
	@$(BIN)/python tools/processors.py $(ARGS)

sanitize: setup-tests ## the compiled core under the sanitizers of addresses, undefined behaviour and threads
	@PYTHON=$(CURDIR)/$(BIN)/python src/ir_kernels/sanitize.sh $(ARGS)

# compare.py needs another checkout: it has a target of its own.
BENCHMARKS := $(filter-out benchmarks/compare.py,$(wildcard benchmarks/[!_]*.py))
define run_benchmarks
	@mkdir -p out/bench; for script in $(BENCHMARKS); do \
	  name=$$(basename "$$script" .py); echo "== $$name"; \
	  $(BIN)/python "$$script" $(1) --json "out/bench/$$name.json" $(ARGS) || exit 1; \
	done
endef

bench: setup-tests ## every benchmark in at most 2 minutes each, its claims at the end; JSON in out/bench
	$(call run_benchmarks,--quick)

bench-long: setup-tests ## every benchmark in full: what claims quote; JSON in out/bench
	$(call run_benchmarks,)

compare: setup-tests ## the same answers, and as fast? This checkout against BEFORE=CHECKOUT
	@$(BIN)/python benchmarks/compare.py --before "$(BEFORE)" --json out/bench/compare.json $(ARGS)

docs: setup-tests ## pages that are written from code, then all of docs/ as a site: out/site
	@$(BIN)/python tools/interface_reference.py
	@$(BIN)/python tools/parameter_reference.py
	@$(BIN)/python tools/security_policy.py
	@$(BIN)/python tools/mistakes_page.py
	@$(BIN)/python tools/architecture_page.py
	@$(BIN)/python tools/readme_figures.py
	@$(BIN)/python tools/docs_site.py

clean:            ## remove what was built; .venv stays (rm -rf .venv for all)
	rm -rf out build install log ros_ws/build ros_ws/install ros_ws/log .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find src ros_ws tests -name __pycache__ -prune -exec rm -rf {} +
	find src \( -name build -o -name '*.egg-info' \) -prune -exec rm -rf {} +
