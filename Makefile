# Every target sets up what it needs. Only Python >= 3.11 with venv, and make, must be there.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# Installed packages wait in the environment; nothing is looked up on the network at run time.
UV := $(BIN)/python -m uv
PICTURES := .pictures

.PHONY: dive test slow explore mutants check format laws stops headings soak faults picture docs clean

dive: $(READY) ## fly the demo dive: every service, one command
	$(BIN)/lindy dive

test: $(READY) ## all tests; every run draws the same cases
	PYTHONHASHSEED=0 $(BIN)/pytest -n 3 --dist worksteal

slow: $(READY) ## the tests that `make test` leaves out: fault cells, papers, sweeps, many flights
	PYTHONHASHSEED=0 $(BIN)/pytest -n 3 --dist worksteal -m slow

explore: $(READY) ## search for minutes for new cases that break a law; prints what to keep
	$(BIN)/python -m pytest -n 2 -p tests.long.explore --hypothesis-profile explore \
		-m "hypothesis and not system"
	$(BIN)/python -m pytest -n 2 tests/long/identify_fit.py tests/long/figures_of_dives.py
	$(BIN)/python -m pytest -n 0 tests/long/fleet.py

mutants: $(READY) ## how many small faults, put into a copy of the laws, the tests notice
	$(BIN)/python tests/long/mutants.py

check: $(READY) ## format, lint, types, import contracts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright

format: $(READY) ## put the code in shape
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

picture: $(READY) ## the pictures in the README; Debian: mesa-vulkan-drivers libvulkan1
	rm -rf $(PICTURES)
	$(BIN)/lindy simulate --out $(PICTURES)/dive
	$(BIN)/lindy picture $(PICTURES)/dive/dive.rrd --at 60 --out $(PICTURES)/dive.png
	$(BIN)/python -m tools.docs.camera_picture
	$(BIN)/lindy figures --only andren-5.6 link-profiles --out $(PICTURES)
	cp $(PICTURES)/dive.png docs/dive.png
	cp $(PICTURES)/andren-5.6.png docs/retargeting.png
	cp $(PICTURES)/link-profiles.png docs/link-profiles.png

laws: $(READY) ## the laws of the reference over millions of states, into docs/laws.md
	$(BIN)/python tests/long/laws.py

stops: $(READY) ## a hundred dives with random sticks: bounce-back and overshoot at every stop
	$(BIN)/python tests/long/stops.py

headings: $(READY) ## a hundred dives: the heading at rest after a turn
	$(BIN)/python tests/long/heading_rest.py

soak: $(READY) ## half an hour of faults, in a real dive and in a fleet of four. MINUTES=, SEED=
	$(BIN)/python -m tests.long.soak $(or $(MINUTES),30) $(or $(SEED),1)
	$(BIN)/python -m tests.long.fleet_soak $(or $(MINUTES),30) $(or $(SEED),1)

faults: $(READY) ## every fault in every mode, and again in real processes, into docs/faults.md
	$(BIN)/python -m tools.research.faults

docs: $(READY) ## pages and pictures written from the code
	$(BIN)/python -m tools.docs.topics_page
	$(BIN)/python -m tools.docs.failsafes_page
	$(BIN)/python -m tools.docs.import_picture
	$(BIN)/python -m tools.research.scale --write

$(READY): pyproject.toml uv.lock
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(UV) sync --quiet --inexact --frozen --all-extras
	touch $(READY)

clean:
	rm -rf .venv .pytest_cache .ruff_cache .import_linter_cache .hypothesis
