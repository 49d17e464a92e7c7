# The verbs of szlib.  Everything lives in .venv; a second call does not install again.
PYTHON ?= python3
VENV := .venv
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif
INSTALLED := $(VENV)/installed

# Where Python is told to keep no bytecode, as in many containers, every process compiles every package anew.
unexport PYTHONDONTWRITEBYTECODE
# The notebooks show their figures in every verb, and their kernels are those of .venv.
unexport MPLBACKEND JUPYTER_PATH
# uv trusts the certificates that the machine trusts, as pip does.
export UV_SYSTEM_CERTS ?= 1

.PHONY: run report docs slides test slow lab bench lock lowest audit hostile notebooks dist clean

run: $(INSTALLED)  ## every notebook, headless, on the synthetic plaza; fails where a check does not hold
	$(BIN)/szlib run

report: $(INSTALLED)  ## open what the last run on the plaza wrote: one HTML file
	$(BIN)/python -m webbrowser "file://$(CURDIR)/results/synthetic/report.html"

docs: $(INSTALLED)  ## results/site: README, notebooks, which settings to choose, each public name, changes; no network
	mkdir -p .docs/pages
	$(BIN)/sphinx-build -q -c .docs -d .docs/pages/.doctrees .docs/pages results/site

slides: $(INSTALLED)  ## results/slides: a deck and a handout (PDF) of each notebook, and all figures; SLIDES_FLAGS="07 08": some
	$(BIN)/python notebooks/tools/slides.py $(SLIDES_FLAGS)

PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# Types are checked beside the tests; both must pass.  The notebooks are executed by `make run`, not here.
test: $(INSTALLED)  ## style, types, and every test that takes no more than a few seconds
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	@$(BIN)/mypy & types=$$!; \
	$(PYTEST) -m "not slow"; tests=$$?; \
	wait $$types && exit $$tests

slow: $(INSTALLED)  ## the other tests: whole systems, attacks, and statistics of many crowds
	$(PYTEST) -m slow

# root, as in most containers, must be allowed to; there too: make lab LAB_FLAGS="--allow-root --no-browser --ip=0.0.0.0"
LAB_FLAGS ?= $(if $(filter 0,$(shell id -u 2>/dev/null)),--allow-root)
lab: $(INSTALLED)  ## open the workbook in JupyterLab, with its results beside it; LAB_FLAGS for a container
	$(BIN)/jupyter lab --ServerApp.root_dir="$(CURDIR)" $(LAB_FLAGS) notebooks/00_start_here.ipynb

bench: $(INSTALLED)  ## speed and memory, as ratios within one run
	$(BIN)/python tests/benchmarks

notebooks: $(INSTALLED)  ## execute the committed copies anew, and renew the README's pictures
	$(BIN)/python notebooks/tools/refresh.py

lock: $(INSTALLED)  ## pin every dependency with hashes, for every platform, from pyproject.toml; and those of Binder
	$(BIN)/uv pip compile pyproject.toml --universal --all-extras --generate-hashes --upgrade --quiet \
	    --no-emit-index-url --custom-compile-command "make lock" --output-file environment.lock
	(echo '# The workbook and what it needs, as in environment.lock.  Made by `make lock`.'; \
	 $(BIN)/uv pip compile pyproject.toml --universal --extra workbook --constraint environment.lock \
	    --no-header --no-annotate --quiet) > .binder/requirements.txt

# Warnings are no errors here: old libraries warn of each other, which one test of a fresh process does not allow.
LOWEST ?= tests/tracks tests/encounters tests/zones tests/plaza tests/control tests/simulation
lowest: $(VENV)/lowest/installed  ## the suite without the workbook, with the oldest version of every dependency; LOWEST="FILE": some
	$(VENV)/lowest/$(notdir $(BIN))/python -m pytest -p no:cacheprovider -W default -n 2 --dist loadfile \
	    --deselect tests/simulation/test_crowds.py::test_social_force_leaves_no_file_and_restores_logging \
	    $(LOWEST)

$(VENV)/lowest/installed: $(INSTALLED)
	$(BIN)/uv venv --quiet --clear $(VENV)/lowest
	$(BIN)/uv pip install --quiet --python $(VENV)/lowest --resolution lowest-direct -e ".[cluster,crowds,test,workbook]"
	$(BIN)/python -c "open('$@', 'w').close()"

audit: $(INSTALLED)  ## fail where a pinned version has a published vulnerability, or where PyPI cannot be asked
	@$(BIN)/python -c "import urllib.request; urllib.request.urlopen('https://pypi.org/pypi/pip/json', timeout=20)" \
	    2> /dev/null || { echo "not audited: https://pypi.org/pypi cannot be reached; try again with a network"; exit 1; }
	$(BIN)/pip-audit --requirement environment.lock --disable-pip --strict --progress-spinner off

hostile: $(INSTALLED)  ## every attack in full, and their tally in tests/hostile/README.md
	$(BIN)/python tests/hostile --long

dist: $(INSTALLED)  ## sdist and wheel; HOME_URL says where the README's pictures are served
	$(BIN)/python .ci/dist.py "$(HOME_URL)"

clean:  ## remove the environment and what `szlib run` wrote to results/; your own files and extracted days stay
	$(PYTHON) .ci/clean.py

$(INSTALLED): environment.lock pyproject.toml  ## uv, of the lock as well, installs it several times faster than pip
	$(PYTHON) -m venv $(VENV)
	sed -n '/^uv==/,/[^\\]$$/p' environment.lock > $(VENV)/uv.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $(VENV)/uv.lock
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r environment.lock || \
	    $(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r environment.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	$(BIN)/python -c "open('$(INSTALLED)', 'w').close()"
