# `make` alone lists the targets. Each creates the environment first, if it is not there.
SHELL := bash
PYTHON ?= python3
BIN := .venv/bin
IN_ENVIRONMENT := PATH="$(CURDIR)/$(BIN):$$PATH"
INSTALLED := .venv/installed
DATA ?= data/public
# The caller's Python must not decide which packages run here: `setup.bash` of ROS sets PYTHONPATH.
unexport PYTHONPATH PYTHONHOME

.PHONY: help repro test docs lint recorded own-example bench profile studies studies-check verdicts faults kills upsets view plot-page clean

help:
	@grep -hE '^[a-z -]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z -]+):.*## /\1\t/' | expand -t 18

# The tables of findings and of timings are also in the README.
TABLE_OF_README = sed -i -e '/^<!-- $1 -->/,/^<!-- end of $1 -->/{/^<!--/!d}' -e '/^<!-- $1 -->/r $2' README.md

# The testbeds share no stage, so a first run makes three at a time, the longest first: one or two fill the cores while
# another waits for DVC or for its slowest training. `dvc repro` does what is left.
TESTBEDS := dynamics scraping servoing obstacles
repro: $(INSTALLED)  ## run the whole pipeline, write reports/index.html
ifeq ($(wildcard data/raw/scraping/nominal),)
	@$(MAKE) --no-print-directory --jobs=3 $(TESTBEDS:%=stages-of-%)
endif
	$(IN_ENVIRONMENT) dvc repro
	@$(BIN)/python -m structlearn.core.stage
	@$(call TABLE_OF_README,findings,reports/findings.md)
	@$(BIN)/python -m dissertation.evidence.committed || true
	@echo "reports/index.html is up to date"

stages-of-%:
	@set -o pipefail; $(IN_ENVIRONMENT) dvc --wait-for-lock repro --single-item \
	  $$(sed -n 's/^  \($*_[a-z_]*\):$$/\1/p' dvc.yaml) 2>&1 | sed -u '/^$$/d; s/^/$*: /'

test: lint  ## lint, run all tests
	OMP_NUM_THREADS=1 $(BIN)/pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

lint: $(INSTALLED)  ## check style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The methods on public recordings, in a project of their own, data/recorded; DATA holds some of the folders that the
# README names. The sets share no stage, so two run side by side. Pages are copied here,
# and results that other pages quote: the front page shows them at once, testbed pages when they are next made.
RECORDED := data/recorded
QUOTED := reports/quoted/recorded
recorded: $(INSTALLED)  ## run the pipeline on recorded data: make recorded DATA=FOLDER
	$(IN_ENVIRONMENT) dvc repro --quiet scraping_expected_traces
	export RECORDED_DATA="$(abspath $(DATA))" $(IN_ENVIRONMENT) && python -m dissertation.recorded.sets_project && cd $(RECORDED) && \
	  set -o pipefail && python -c "from structlearn.tasks.task_entry import read_entries, targets; [print(*targets(name)) for name in read_entries()]" | \
	  xargs --max-procs=2 --max-lines=1 dvc --wait-for-lock repro --keep-going --single-item
	cd $(RECORDED) && $(IN_ENVIRONMENT) dvc repro --single-item recorded_people recorded_report
	mkdir -p $(QUOTED) reports/tasks
	cp -r $(RECORDED)/reports/recorded reports
	cd $(RECORDED)/reports/tasks && tar -c --exclude=rerun . | tar -x -C $(CURDIR)/reports/tasks
	cd reports/recorded && cp tables/claims.csv tables/people.csv metrics.json findings.csv $(CURDIR)/$(QUOTED)
	$(IN_ENVIRONMENT) dvc repro --single-item report
	@$(call TABLE_OF_README,findings,reports/findings.md)
	@$(BIN)/python -m structlearn.core.stage
	@echo "reports/recorded/index.html is up to date; 3-D: cd $(RECORDED) && structlearn view reaches"

# Six bags each of an invented pick-and-place task and of wiping, to try a task of your own on.
own-example: $(INSTALLED)  ## write example bags of two simulated tasks
	$(BIN)/python -m dissertation.simulation.pick_and_place data/example/pick
	$(BIN)/python -m dissertation.simulation.wiping data/example/wipe data/example/wiped

# Timings against public libraries, which are installed first; latency, growth and workers. Needs an idle machine.
BENCH := reports/benchmarks
bench: $(INSTALLED) .venv/installed-bench  ## time inner loops against public libraries
	mkdir -p $(BENCH)
	bash -e -o pipefail -c '{ \
	  $(BIN)/python benchmarks/run.py --output $(BENCH)/table.csv; \
	  $(BIN)/python benchmarks/controller.py; \
	  $(BIN)/python benchmarks/growth.py --output $(BENCH); \
	  $(BIN)/python benchmarks/workers.py --output $(BENCH)/workers.csv; \
	  $(BIN)/python benchmarks/share_coverage.py --output $(BENCH)/share_coverage.csv; } | tee $(BENCH)/bench.txt'
	$(BIN)/python benchmarks/readme_table.py | $(call TABLE_OF_README,timings,/dev/stdin)

# Where a stage and its processes spend their time: a flame graph, e.g. `make profile STAGE=stages/dynamics/online.py`.
STAGE ?= stages/scraping/segment.py
PROFILE = reports/profiles/$(subst /,-,$(STAGE:stages/%.py=%)).svg
profile: $(INSTALLED)  ## draw a flame graph of a stage: make profile STAGE=stages/dynamics/online.py
	$(BIN)/pip install --quiet py-spy==0.4.3
	mkdir -p $(dir $(PROFILE))
	$(BIN)/py-spy record --subprocesses --output $(PROFILE) -- $(BIN)/python $(STAGE)

# More people, seeds and robots than the pipeline has time for, cell by cell (stages/studies), as many at once as there
# are cores, or on a cluster (docs/parameters.md). Says first how long it takes; goes on where it was stopped.
STUDY_TABLES := python -m dissertation.evidence.study_tables
studies: $(INSTALLED)  ## run all studies (takes hours), or one: make studies NAME=servoing/people
	$(IN_ENVIRONMENT) $(STUDY_TABLES) $(NAME)

# Whether the current code reproduces the studies; if so, DVC accepts the existing cells.
studies-check: $(INSTALLED)  ## repeat one cell of each study and compare it with the table
	$(IN_ENVIRONMENT) $(STUDY_TABLES) --check $(NAME)

# Verdicts and files of the pipeline that differ from the last commit.
verdicts: $(INSTALLED)  ## list verdicts and files that differ from the last commit
	$(BIN)/python -m dissertation.evidence.committed

# Damage N files of every kind and read them: the same data, or one line. Tests do some hundred.
faults: N ?= 10000
faults: $(INSTALLED)  ## damage N files of every kind and read them
	PYTHONPATH=tests $(BIN)/python -m faults.many --count $(N)

# Stop processes at every disk operation and kill N stages of a reduced pipeline: a repeated run gives the same results.
kills: N ?= 50
kills: $(INSTALLED)  ## kill N stages and run them again
	PYTHONPATH=tests $(BIN)/python -m faults.kills --count $(N)

# N ticks of the controller with faults of sensor and caller: finite, within bounds, and the goal is reached.
upsets: N ?= 1000000
upsets: $(INSTALLED)  ## run N ticks of the controller under faults
	PYTHONPATH=tests $(BIN)/python -m faults.controller_faults --ticks $(N)

# Open the recordings of a testbed, e.g. `make view TESTBED=obstacles`; WEB=1 serves them to a browser instead.
TESTBED ?= scraping
view: export FOLDER = reports/rerun/$(TESTBED)
view: $(INSTALLED)  ## open 3-D recordings: make view TESTBED=obstacles; WEB=1 for a browser
	@ls "$$FOLDER"/*.rrd > /dev/null 2>&1 || { echo "error: $$FOLDER: no recordings; make them first: dvc repro, or dvc checkout where it was run" >&2; exit 1; }
ifdef WEB
	@echo "http://localhost:9090/?url=rerun%2Bhttp%3A%2F%2Flocalhost%3A9876%2Fproxy&theme=dark"
	$(BIN)/rerun --serve-web --bind 127.0.0.1 "$$FOLDER"/*.rrd
else
	@[ "$$(uname)" != Linux ] || [ "$$DISPLAY$$WAYLAND_DISPLAY$$WAYLAND_SOCKET" ] || { \
	  echo "error: there is no display to show $$FOLDER on; in a browser: make view WEB=1" >&2; exit 1; }
	$(BIN)/rerun "$$FOLDER"/*.rrd
endif

# The documentation as a site that needs no network: open site/index.html. Its notebook is run, which takes two minutes.
docs: $(INSTALLED) .venv/installed-docs  ## build the documentation into site/
	$(BIN)/python docs/notebook.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --site-dir site

# The page of `dvc plots show` with its scripts inside, so that it needs no network; the file is kept in git.
plot-page: $(INSTALLED)  ## make the offline page of dvc plots
	$(BIN)/pip install --quiet vl-convert-python==1.9.0.post1
	$(BIN)/python .dvc/plots/make_page.py

clean:  ## remove the environment and caches
	rm -rf .venv .pytest_cache .ruff_cache .mypy_cache .hypothesis

# pip would compile thousands of files one by one, for most of a minute; here on all cores, and not others' tests.
$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --no-compile --constraint constraints.txt --editable ".[dev]"
	$(BIN)/python -m compileall -qq -j 0 -x /tests/ .venv/lib || true  # some are for other versions of Python
	touch $@

.venv/installed-bench: $(INSTALLED)
	$(BIN)/pip install --quiet --constraint constraints.txt --editable ".[dev,bench]"
	touch $@

.venv/installed-docs: $(INSTALLED)
	$(BIN)/pip install --quiet --constraint constraints.txt --editable ".[dev,docs]"
	touch $@
