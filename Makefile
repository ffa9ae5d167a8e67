# Every target sets up what it needs. Only Python >= 3.11 with venv, and make, must be there.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# Installed packages wait in the environment; nothing is looked up on the network at run time.
UV := $(BIN)/python -m uv
PICTURES := .pictures
VERSION = $(shell $(UV) version --short)
# Where compiled modules may not be written, each of some hundred processes would compile them anew.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: dive test slow research explore mutants bench check format laws stops headings real soak soak-virtual faults arm64 wheels pythons picture film site docs release audit clean

dive: $(READY) ## fly the demo dive: every service, one command
	$(BIN)/lindy dive

test: $(READY) ## all tests; every run draws the same cases
	PYTHONHASHSEED=0 $(BIN)/pytest -n 4 --dist worksteal

slow: $(READY) ## what `make test` leaves out: flights by the dozen, the wheel, every law on all its cases
	PYTHONHASHSEED=0 $(BIN)/pytest -n 3 --dist worksteal --hypothesis-profile whole \
		-m "slow or (hypothesis and not system)"

research: $(READY) ## the tests of the package research/: papers, benchmarks
	PYTHONHASHSEED=0 $(BIN)/pytest -n 3 --dist worksteal -m "slow or not slow" research/tests

explore: $(READY) ## search for minutes for new cases that break a law; prints what to keep
	$(BIN)/python -m pytest -n 2 -p tests.long.explore --hypothesis-profile explore \
		-m "hypothesis and not system"
	$(BIN)/python -m pytest -n 2 tests/long/identify_fit.py research/long/figures_of_dives.py
	$(BIN)/python -m pytest -n 0 tests/long/fleet.py
	$(BIN)/python -m tests.long.fuzz

mutants: $(READY) ## how many small faults, put into a copy of the laws, the tests notice
	$(BIN)/python tests/long/mutants.py

bench: $(READY) ## every figure of `lindy bench` three times, judged beside the last, into docs/performance.md
	$(BIN)/python -m lindy_research.bench $(BENCH)

check: $(READY) ## format, lint, types, import contracts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright
	$(BIN)/pyright --pythonplatform Windows lindy messages services tools

format: $(READY) ## put the code in shape
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

picture: $(READY) ## the pictures in the README; Debian: mesa-vulkan-drivers libvulkan1
	rm -rf $(PICTURES)
	$(BIN)/lindy simulate --out $(PICTURES)/dive
	$(BIN)/lindy picture $(PICTURES)/dive/dive.rrd --at 60 --out $(PICTURES)/dive.png
	$(BIN)/python -m tests.support.docs.camera_picture
	$(BIN)/lindy figures --only andren-5.6 link-profiles --out $(PICTURES)
	cp $(PICTURES)/dive.png docs/dive.png
	cp $(PICTURES)/andren-5.6.png docs/retargeting.png
	cp $(PICTURES)/link-profiles.png docs/link-profiles.png

laws: $(READY) ## the laws of the reference over millions of states, into docs/laws.md
	$(BIN)/python research/long/laws.py

stops: $(READY) ## a hundred dives with random sticks: bounce-back and overshoot at every stop
	$(BIN)/python research/long/stops.py

headings: $(READY) ## a hundred dives: the heading at rest after a turn
	$(BIN)/python research/long/heading_rest.py

real: $(READY) ## the estimator over real dives on record, which LINDY_REAL= is the folder of
	LINDY_REAL="$(LINDY_REAL)" $(BIN)/python -m lindy_research.bench.reality_real

soak: $(READY) ## half an hour of faults, in a real dive and in a fleet of four. MINUTES=, SEED=
	$(BIN)/python -m tests.long.soak $(or $(MINUTES),30) $(or $(SEED),1)
	$(BIN)/python -m tests.long.fleet_soak $(or $(MINUTES),30) $(or $(SEED),1)

soak-virtual: $(READY) ## eight hours and a thousand faults on virtual time. HOURS=, FAULTS=, SEED=
	$(BIN)/python -m tests.long.virtual_soak $(or $(HOURS),8) $(or $(FAULTS),1000) $(or $(SEED),1)

faults: $(READY) ## every fault in every mode, and again in real processes, into docs/faults.md
	$(BIN)/python -m tests.support.faults

arm64: $(READY) ## a dive on emulated arm64, with the bits of this computer; Debian: qemu-user-static debootstrap
	nice -n 19 $(BIN)/python -m tests.long.arm64

wheels: $(READY) ## which wheels each platform gets, as a table; asks the package index
	$(BIN)/python -m tests.wheel.platforms

pythons: $(READY) ## the wheel, installed and flown with each Python from 3.11 to 3.14 that is found here
	$(BIN)/python -m tests.wheel.pythons

site: $(READY) ## docs/ as a site with search, in site/; a link that leads nowhere is an error
	$(BIN)/zensical build --clean --strict

film: $(READY) ## the moving picture of the README; needs Chromium, and Vulkan as `picture` does
	rm -rf $(PICTURES)
	$(BIN)/python -m tests.support.docs.film $(PICTURES) docs/dive.webp

docs: $(READY) ## pages and pictures written from the code
	$(BIN)/python -m tests.support.docs.topics_page
	$(BIN)/python -m tests.support.docs.failsafes_page
	$(BIN)/python -m tests.support.docs.report_page
	$(BIN)/python -m tests.support.docs.import_picture
	$(BIN)/python -m lindy_research.scale --write

release: $(READY) audit ## wheel, sdist and SBOM in dist/, notes, checked and flown; `uv publish` would upload the first two
	@tag=$$(git tag --points-at HEAD); test -n "$$tag" || echo "this commit has no tag: v$(VERSION) is to be its tag"; \
		case " $$tag " in *" v$(VERSION) "*|"  ") ;; *) echo "the tag is $$tag, and the version $(VERSION)"; exit 1;; esac
	$(UV) build --quiet --out-dir dist
	$(UV) export --quiet --frozen --no-dev --all-extras --no-emit-project --format cyclonedx1.5 \
		--output-file dist/sbom-$(VERSION).cdx.json
	$(UV) tool run twine check --strict dist/lindy-$(VERSION)*
	$(BIN)/python -m tests.wheel.pythons dist/lindy-$(VERSION)-py3-none-any.whl
	PYTHONHASHSEED=0 $(BIN)/pytest -n 2 -m slow tests/wheel
	$(BIN)/python -m tests.wheel.notes $(VERSION) > dist/notes-$(VERSION).md

# 1: something is known; 2: nobody could be asked.
audit: $(READY) ## is a vulnerability known of any locked package? asks osv.dev
	@$(UV) audit --quiet --frozen --preview-features audit-command 2> /dev/null || \
		{ test $$? -eq 2 && echo "not audited: uv could not ask osv.dev for known vulnerabilities"; }

$(READY): pyproject.toml research/pyproject.toml uv.lock
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(UV) sync --quiet --inexact --frozen --all-extras
	touch $(READY)

clean:
	rm -rf .venv .pytest_cache .ruff_cache .import_linter_cache .hypothesis
