# `make demo` shows what fantoccini does, `make show` puts strings into your hands, `make test` checks
# it. All set everything up in .venv;
# a stamp file stands for each finished step, so a second run starts at once.

VENV := .venv
OLDER := .venv-mujoco317
CROCODDYL := .venv-crocoddyl
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo show test test-slow test-all test-portable test-install clean-room gallery docs architecture bench bench-plan
.PHONY: format soak soak-crowds soak-rests strings-report growth-report long-runs-report stage-report
.PHONY: optimal-peers rigs
.PHONY: reduction-report reports lint wheel clean
.NOTPARALLEL:

# Keep the bytecode cache: many processes import the same modules.
unexport PYTHONDONTWRITEBYTECODE

demo: $(VENV)/stamp-demo
	$(BIN)/fantoccini demo

show: $(VENV)/stamp-demo
	$(BIN)/fantoccini show stroll

# Tests marked neither medium nor slow. At -Og puppets compile fastest, and run slower. Idle
# workers take over tests of others, so that all finish at about the same time.
test: $(VENV)/stamp-test
	$(BIN)/python -m pytest -m "not medium and not slow" --puppet-flag=-Og --dist=worksteal

# The others, the medium ones first, with the default compiler flags (files marked own_puppets: -Og).
test-slow: $(VENV)/stamp-test
	$(BIN)/python -m pytest -m "medium or slow" $(PYTEST)

# All tests, likewise.
test-all: $(VENV)/stamp-test
	$(BIN)/python -m pytest

# Install the wheel without extras in a fresh environment, and test it from an empty folder.
clean-room: $(VENV)/stamp-test
	$(BIN)/python .ci/clean_room.py

# Install each extra alone in a fresh environment, and test its feature.
test-install: $(VENV)/stamp-test
	$(BIN)/python .ci/clean_room.py extras

# The tests with code for other processors, one after the other: an hour and more.
test-portable: $(VENV)/stamp-test
	sh .ci/portable $(BIN)/python all

gallery: $(VENV)/stamp-demo
	$(BIN)/python -m docs.gallery

# The site, in build/site; the examples run when they or the package have changed.
docs: $(VENV)/stamp-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

architecture: $(VENV)/stamp-demo
	$(BIN)/python -m docs.architecture

bench: $(VENV)/stamp-bench $(OLDER)/stamp
	$(BIN)/python -m benchmarks.speed

bench-plan: $(VENV)/stamp-bench
	$(BIN)/python -m benchmarks.planning

# A million runs of stages (floor, props, two puppets; some event-driven, some thrown about live), then
# a million of performances by all methods. Fewer: make soak CROWDS="--runs 20000" SOAK="--runs 900".
soak: $(VENV)/stamp-test
	failed=0; \
	PYTHONPATH=tests $(BIN)/python -m properties.crowds $(CROWDS) || failed=1; \
	PYTHONPATH=tests $(BIN)/python -m properties.soak $(SOAK) || failed=1; \
	exit $$failed

# The first half alone.
soak-crowds: $(VENV)/stamp-test
	PYTHONPATH=tests $(BIN)/python -m properties.crowds $(CROWDS)

# A thousand puppets that have a rest: is one found for each?
soak-rests: $(VENV)/stamp-test
	PYTHONPATH=tests $(BIN)/python -m properties.rests

# A hundred random puppets on two to six legs: their body maps, a walk of 1 m, a bow. Hours; fewer:
# make rigs RIGS="--count 10".
rigs: $(VENV)/stamp-test
	$(BIN)/python -m benchmarks.rigs $(RIGS)

strings-report: $(VENV)/stamp-test
	$(BIN)/python -m benchmarks.strings

# Contact beside MuJoCo. SICONOS="--problems FOLDER --siconos PYTHON" adds the problems of others.
stage-report: $(VENV)/stamp-bench
	$(BIN)/python -m benchmarks.contact $(SICONOS)

# Optimal control beside Crocoddyl, and derivatives of steps beside MuJoCo.
optimal-peers: $(VENV)/stamp-bench $(CROCODDYL)/stamp
	$(BIN)/python -m benchmarks.optimal.peers

growth-report: $(VENV)/stamp-bench
	$(BIN)/python -m benchmarks.growth

long-runs-report: $(VENV)/stamp-bench
	$(BIN)/python -m benchmarks.long_runs

reduction-report: $(VENV)/stamp-bench
	$(BIN)/python -m benchmarks.section_vi

reports: long-runs-report reduction-report

lint: $(VENV)/stamp-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python .ci/language.py
	find src tests benchmarks \( -name "*.hpp" -o -name "*.cpp" \) -exec $(BIN)/clang-format --dry-run --Werror {} +
	$(BIN)/deptry src
	$(BIN)/mypy
	cd tests && ../$(BIN)/mypy --config-file mypy.ini $$(git ls-files '*.py')

# Format Python and C++ in place.
format: $(VENV)/stamp-test
	$(BIN)/ruff format .
	find src tests benchmarks \( -name "*.hpp" -o -name "*.cpp" \) -exec $(BIN)/clang-format -i {} +

wheel: $(VENV)/stamp-test
	$(BIN)/python -m build --wheel --outdir dist

clean:
	rm -rf $(VENV) $(OLDER) $(CROCODDYL) build dist out .pytest_cache .ruff_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/stamp-venv:
	python=$$(sh .ci/prerequisites) && "$$python" -m venv --clear $(VENV)
	touch $@

$(VENV)/stamp-demo: pyproject.toml $(VENV)/stamp-venv
	$(PIP) --editable .
	touch $@

$(VENV)/stamp-test: pyproject.toml $(VENV)/stamp-venv
	$(PIP) --editable '.[test]'
	sh .ci/test-packages $(VENV)
	touch $@

$(VENV)/stamp-docs: pyproject.toml $(VENV)/stamp-venv
	$(PIP) --editable '.[docs]'
	touch $@

$(VENV)/stamp-bench: pyproject.toml $(VENV)/stamp-venv
	$(PIP) --editable '.[bench]'
	touch $@

# An older MuJoCo beside the newest: two versions cannot share an environment.
$(OLDER)/stamp: $(VENV)/stamp-venv
	$(BIN)/python -m venv --clear $(OLDER)
	$(OLDER)/bin/python -m pip install --quiet --disable-pip-version-check 'mujoco==3.17.*'
	touch $@

# Crocoddyl 3.2.1 is built for Pinocchio 4.0; with 4.1 it loads and computes nonsense.
$(CROCODDYL)/stamp: $(VENV)/stamp-venv
	$(BIN)/python -m venv --clear $(CROCODDYL)
	$(CROCODDYL)/bin/python -m pip install --quiet --disable-pip-version-check \
		'crocoddyl==3.2.1' 'pin==4.0.0' scipy
	touch $@
