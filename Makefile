# Every target sets up what it needs. Only Python >= 3.11 with venv, and make, must be there.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# Installed packages wait in the environment; nothing is looked up on the network at run time.
UV := $(BIN)/python -m uv
VERSION = $(shell $(UV) version --short)
# Where compiled modules may not be written, each of some hundred processes would compile them anew.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: dive test slow check format docs bench mutants stops real release clean

dive: $(READY) ## fly the demo dive: every service, one command
	$(BIN)/lindy dive

test: $(READY) ## all tests; every run draws the same cases
	PYTHONHASHSEED=0 $(BIN)/pytest -n 4 --dist worksteal

slow: $(READY) ## what `make test` leaves out: flights by the dozen, the wheel, every law on all its cases, research/
	PYTHONHASHSEED=0 $(BIN)/pytest -n 3 --dist worksteal --hypothesis-profile whole \
		-m "slow or (hypothesis and not system)"
	PYTHONHASHSEED=0 $(BIN)/pytest -n 3 --dist worksteal -m "slow or not slow" research/tests
	-$(BIN)/python tests/long/mutants.py --today --each 4  # printed, not judged: four are too few

mutants: $(READY) ## how many small faults, put into a copy of the laws, the tests notice
	$(BIN)/python tests/long/mutants.py

bench: $(READY) ## every figure of `lindy bench` three times, judged beside the last, into research/measurements
	$(BIN)/python -m lindy_research.bench $(BENCH)

check: $(READY) ## format, lint, types (and the page, where there is npx), import contracts, links of docs/
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright
	$(BIN)/pyright --pythonplatform Windows lindy messages services tools
	$(BIN)/python -m tests.support.page_types
	$(BIN)/zensical build --clean --strict

format: $(READY) ## put the code in shape
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

stops: $(READY) ## a hundred dives with random sticks: bounce-back and overshoot at every stop
	$(BIN)/python research/long/stops.py

real: $(READY) ## the estimator over real dives on record, which LINDY_REAL= is the folder of
	LINDY_REAL="$(LINDY_REAL)" $(BIN)/python -m lindy_research.bench.reality_real

docs: $(READY) ## pages and pictures written from the code
	$(BIN)/python -m tests.support.docs.written

release: $(READY) ## wheel, sdist and SBOM in dist/, notes, checked and flown; `uv publish` would upload the first two
	@tag=$$(git tag --points-at HEAD); test -n "$$tag" || echo "this commit has no tag: v$(VERSION) is to be its tag"; \
		case " $$tag " in *" v$(VERSION) "*|"  ") ;; *) echo "the tag is $$tag, and the version $(VERSION)"; exit 1;; esac
	$(BIN)/python -m tests.wheel.audit
	$(UV) build --quiet --out-dir dist
	$(UV) export --quiet --frozen --no-dev --all-extras --no-emit-project --format cyclonedx1.5 \
		--output-file dist/sbom-$(VERSION).cdx.json
	$(UV) tool run twine check --strict dist/lindy-$(VERSION)*
	$(BIN)/python -m tests.wheel.pythons dist/lindy-$(VERSION)-py3-none-any.whl
	PYTHONHASHSEED=0 $(BIN)/pytest -n 2 -m slow tests/wheel
	$(BIN)/python -m tests.wheel.notes $(VERSION) > dist/notes-$(VERSION).md

$(READY): pyproject.toml research/pyproject.toml uv.lock
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(UV) sync --quiet --inexact --frozen --all-extras --compile-bytecode
	$(BIN)/python -m compileall -q lindy messages services tools research tests
	touch $(READY)

clean:
	rm -rf .venv .pytest_cache .ruff_cache .import_linter_cache .hypothesis
