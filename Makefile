# Two commands: `make demo` runs the main job, `make test` everything that CI runs.
# Either makes .venv first; nothing but python3 (3.11 or newer, with venv) and make is taken for granted.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := out/envisat

.PHONY: demo test check live site benchmark lock clean
.DELETE_ON_ERROR:

demo: $(VENV)/.ready
	$(BIN)/baryscope compare --scenario envisat -o $(DEMO)

# A worker for each core.
test: site
	$(BIN)/python -m pytest -n logical --dist worksteal

# Type checkers don't follow an editable install, so mypy reads a plain one, and with it the documents' examples. What it
# found of files that are as they were it keeps outside the install, which is made anew.
check: $(VENV)/.ready
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	rm -rf build/typed build/lib build/bdist.*
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --target build/typed .
	$(BIN)/python tests/documents.py build/typed/examples
	cd build/typed && $(CURDIR)/$(BIN)/python -m mypy --config-file $(CURDIR)/pyproject.toml \
	    --cache-dir $(CURDIR)/.mypy_cache -p baryscope -p examples

# The page in which the units run. -P: this folder is not searched for packages; while `check` makes the plain install, it
# holds a baryscope.egg-info that is still empty, whose version would go into the page.
live: $(VENV)/.ready
	$(BIN)/python -P -m baryscope.live docs/live/index.html

# The pages of docs/, that page, and the reference, from the docstrings of the plain install. A dead link or name is an
# error, and so is what griffe, which reads the docstrings, remarks: --strict does not count it. Before it, type checker
# and compiler each keep one core busy.
site: $(VENV)/.ready
	$(MAKE) -j2 check live
	$(BIN)/python -m zensical build --clean --strict --config-file mkdocs.yml >build/site.log 2>&1; \
	    code=$$?; cat build/site.log; test $$code = 0 && ! grep -q '^griffe:' build/site.log

benchmark: $(VENV)/.ready
	$(BIN)/python scripts/benchmarks/benchmark.py $(if $(PEERS),--peers $(PEERS))

$(VENV)/.ready: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys, venv; v = sys.version_info; sys.exit(v < (3, 11) and f"baryscope needs Python 3.11 or newer; $(PYTHON) is {v[0]}.{v[1]}. Try: make PYTHON=python3.12")'
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

# Renew the pins; needs uv, and only those who change dependencies need it.
lock:
	uv pip compile pyproject.toml --universal --extra cross --extra docs --extra report --extra test --generate-hashes --python-version 3.11 \
	    --no-emit-index-url --custom-compile-command 'make lock' -o requirements.lock

clean:
	rm -rf $(VENV) build docs/live out *.egg-info .cache .mypy_cache .ruff_cache .pytest_cache .hypothesis
