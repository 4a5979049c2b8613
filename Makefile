# Everything starts here. Needs git, make and Python 3.11 to 3.14; all else goes into .venv.
#
#   make jump    install what running needs, let BRUCE jump, write the recording
#   make test    install the rest, run the tests that take a few minutes in all
#   make test-all  the longer ones too
#
# PYTHON=/path/to/python chooses the interpreter; by default the first that will do is taken.

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
COMPLETE := $(VENV)/complete
# Python keeps the bytecode of what it imports; all of it at once, also of what is never imported, is two thirds of an
# installation's processor time. Where the environment forbids Python to keep any, all is compiled.
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check --no-compile
COMPILE := $(BIN)/python -c 'import sys; sys.exit(sys.dont_write_bytecode)' || \
	$(BIN)/python -m compileall -q -x '/(build|tests)/' . $(VENV)/lib || true
RECORDING := recordings/jump.rrd
# The far jumps, in whose thrust the controller misses some of the plan.
REHEARSED := in_situ_18cm forward_38cm forward_60cm backward_30cm sideways_35cm up_8cm up_12cm
# Those at the limit of the motors, which are rehearsed as far as their landing.
LANDINGS := in_situ_25cm in_situ_32cm sideways_50cm down_35cm turn_120deg turn_180deg
# One thread for each test process: the workers already take every core.
SINGLE := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# Each worker takes a part of the tests in their order, so that what many tests share is made once;
# tests/conftest.py makes one worker more than there are cores, as some tests wait.
WORKERS := --numprocesses auto --dist worksteal
# pytest keeps the tests whose assertions it has rewritten, also where the environment forbids bytecode
CACHED := PYTHONDONTWRITEBYTECODE=

.PHONY: setup jump test test-all lint format bench plans docs site demo notebooks release clean help

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*##/\1:/p' $(MAKEFILE_LIST)

setup: $(COMPLETE)  ## create .venv with everything

$(READY): pyproject.toml scripts/find_python.sh
	@python="$$(sh scripts/find_python.sh $(PYTHON))" && \
	echo "setting up $(VENV) with $$python; the first time this downloads about 450 MB" && \
	"$$python" -m venv $(VENV)
	@$(PIP) --upgrade 'pip>=25.1'
	@$(PIP) --editable .
	@$(COMPILE)
	@touch $@

$(COMPLETE): $(READY)
	@echo "installing what tests and development need besides"
	@$(PIP) --editable . --group dev
	@# the robots' files alone, for `aloft bench robot_files`: what it depends on would put another MuJoCo in place
	@$(PIP) --no-deps 'dm_control>=1.0.50'
	@$(COMPILE)
	@touch $@

jump: $(READY)  ## run graphs/jump.yaml and write recordings/jump.rrd
	@$(BIN)/aloft run graphs/jump.yaml --record $(RECORDING)

test: $(COMPLETE)  ## run the tests, without the long ones
	@$(CACHED) $(SINGLE) $(BIN)/python -m pytest $(WORKERS) -m "not long"

test-all: $(COMPLETE)  ## run all tests
	@$(CACHED) $(SINGLE) $(BIN)/python -m pytest $(WORKERS) --durations 40

lint: $(COMPLETE)  ## check style and types
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@sh scripts/check_types.sh

format: $(COMPLETE)  ## rewrite the files in the project's style
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: $(COMPLETE)  ## run all benchmarks
	@$(SINGLE) $(BIN)/aloft bench

plans: $(COMPLETE)  ## make the shipped plans anew, one for every file in graphs/tasks
	@$(SINGLE) $(BIN)/aloft plan graphs/tasks/*.yaml --anew --prune --keep graphs/plans --no-pictures
	@$(SINGLE) $(BIN)/aloft plan $(REHEARSED:%=graphs/tasks/%.yaml) --rehearse --keep graphs/plans --no-pictures
	@$(SINGLE) $(BIN)/aloft plan $(LANDINGS:%=graphs/tasks/%.yaml) --rehearse-landing --keep graphs/plans --no-pictures

docs: $(COMPLETE)  ## make what is generated under docs/
	@$(BIN)/aloft blocks --markdown docs/blocks
	@$(BIN)/python lab/pages/refresh.py
	@$(BIN)/python lab/pages/study_data.py mark
	@$(BIN)/python lab/pages/make_pictures.py

site: $(COMPLETE)  ## build the documentation as a site in site/, which any web server serves; other versions there stay
	@$(BIN)/python -m sphinx -q --fail-on-warning --keep-going -c docs -d build/doctrees . \
		site/$$($(BIN)/python -c "import aloft; print(aloft.__version__)")
	@echo "site/index.html"

demo: $(COMPLETE)  ## build the page on which BRUCE jumps in a browser in site/demo; needs npm and wasm-ld
	@$(BIN)/python extensions/export/demo/build.py site/demo

notebooks: $(COMPLETE)  ## write the notebooks of the gallery, with the files that they use, into site/notebooks
	@$(BIN)/python lab/pages/notebooks.py site/notebooks

release: $(COMPLETE)  ## build sdist and wheel into dist/, try the wheel alone, sign it (SIGN=KEY); publish nothing
	@sh scripts/release.sh

clean:  ## remove all that these targets made
	rm -rf $(VENV) build dist site *.egg-info recordings
	rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
