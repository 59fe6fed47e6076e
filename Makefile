# gyrotc - the one door. `make help` lists what there is.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
override PYTHON := .venv/bin/python
override GYROTC := .venv/bin/gyrotc
override FUZZERS := map check open image step restore
# What a user sets reaches programs as it is, through the environment and quoted: $(value) keeps make, the quotes keep
# the shell from reading it, and unexport keeps make from expanding it for the environment.
unexport DATA AXIS SECONDS SEED EACH STORM GYROTC_REAL_DATA SETS MEGABYTES TAG
override export SET_DATA := $(value DATA)
override export SET_AXIS := $(value AXIS)
override export SET_SECONDS := $(or $(value SECONDS),20)
override export SET_STORM := $(or $(value STORM),1000000)
override export SET_SEED := $(value SEED)
override export SET_EACH := $(or $(value EACH),36)
override export SET_SETS := $(or $(value SETS),2000)
override export SET_MEGABYTES := $(value MEGABYTES)
override export SET_TAG := $(value TAG)
override export SET_REAL := $(or $(value DATA),$(value GYROTC_REAL_DATA),../shared/data/real)
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

## show this list
help:
	@awk '/^## /{text=substr($$0,4);next} /^[a-z][a-z-]*:/{if(text!=""){split($$1,a,":");printf "  make %-10s %s\n",a[1],text;text=""}}' $(MAKEFILE_LIST)

## install what is missing (system packages, .venv with the C++ core)
setup:
	@tools/setup.sh

## the main job: data -> verified C and a report in build/demo (DATA=folder [AXIS=x] for your own recordings)
demo: setup
ifdef DATA
	@$(GYROTC) build --out build/demo --any-serial $${SET_AXIS:+"--axis=$$SET_AXIS"} -- "$$SET_DATA"
else
	@$(GYROTC) simulate paper --seed 1 --out build/demo-data
	@$(GYROTC) build build/demo-data --out build/demo --any-serial
endif

# The C library's tests and its fuzzers' saved inputs, built as far as something changed.
define c-tests
@tools/setup.sh test
@mkdir -p build
@cmake -S tests/c -B build/ctest -DCMAKE_BUILD_TYPE=Debug >build/ctest.log 2>&1 || { cat build/ctest.log; exit 1; }
@cmake --build build/ctest -j2 >>build/ctest.log 2>&1 || { cat build/ctest.log; exit 1; }
@ctest --test-dir build/ctest -j2 --output-on-failure
@cmake -S tests/fuzz -B build/fuzz -DCMAKE_C_COMPILER=clang >build/fuzz.log 2>&1 || { cat build/fuzz.log; exit 1; }
@cmake --build build/fuzz -j2 >>build/fuzz.log 2>&1 || { cat build/fuzz.log; exit 1; }
@ctest --test-dir build/fuzz -j2 --output-on-failure
endef

## what to run before a commit: C library, generator, one of each command; five minutes on two cores
test:
	$(c-tests)
	@$(PYTHON) -m pytest -q -rs -n 2 --dist loadfile -m "not slow" tests/py

## everything: `make test` with the slow tests, then `make check`, `make cov`, `make targets`; an hour on two cores
test-all:
	$(c-tests)
	@$(PYTHON) -m pytest -q -rs -n 2 --dist loadfile tests/py -k "not of_eighty"
	@$(MAKE) --no-print-directory check cov targets

## the emitted code on every target, negative controls, nav_loop: docs/results.md
targets:
	@tools/setup.sh targets
	@$(PYTHON) -m pytest -q -rs tests/targets tests/py/verify/test_negative_controls.py --results docs

## every input of a table, no run-time error, rounding bounds (Frama-C, Gappa, Z3; minutes): docs/results.md
prove:
	@tools/setup.sh prove
	@$(PYTHON) -m pytest -q -rs -n 2 --dist worksteal tests/prove --results docs

## style and promises: ruff, mypy; of the C library words, warnings, symbols, fused operations, MISRA, analysers; 80 diagnoses
check:
	@tools/setup.sh check
	@.venv/bin/ruff check --config gen/pyproject.toml gen tests tools
	@.venv/bin/ruff format --config gen/pyproject.toml --check gen tests tools
	@cd gen && ../.venv/bin/mypy gyrotc && ../.venv/bin/lint-imports --config pyproject.toml
	@$(PYTHON) tools/promises
	@$(PYTHON) -m pytest -q tests/py/repository/test_examples.py -k notebook
	@$(PYTHON) -m gyrotc.paper.page docs --check
	@GYROTC_PAPER_GYROS=10 $(PYTHON) -m pytest -q tests/py/paper/test_paper_reference.py
	@$(PYTHON) -m pytest -q -n 2 tests/py/diagnose/test_diagnose_fixed.py -k "eighty or fresh"

## branch coverage of libc/ by the C tests: 100 %, or it fails
cov:
	@tools/setup.sh test
	@tools/coverage.sh

## fuzzers of each function family, SECONDS=20 each, kept in build/corpus; STORM=1000000 images with a right CRC; 20,000 damaged files; SEED=1
fuzz:
	@for word in "SECONDS=$$SET_SECONDS" "STORM=$$SET_STORM" "SEED=$${SET_SEED:-1}"; do \
	  [[ $$word =~ ^[A-Z]+=[1-9][0-9]{0,9}$$ ]] || { echo "make fuzz: $$word is no number from 1 on" >&2; exit 2; }; \
	done
	@tools/setup.sh test
	@cmake -S tests/fuzz -B build/fuzz -DCMAKE_C_COMPILER=clang && cmake --build build/fuzz -j2
	@for target in $(addsuffix _f32,$(FUZZERS)) $(addsuffix _q31,$(FUZZERS)); do \
	  mkdir -p build/corpus/$$target && echo "fuzz_$$target" && \
	  build/fuzz/fuzz_$$target -max_total_time="$$SET_SECONDS" -max_len=4096 -artifact_prefix=build/ -verbosity=0 \
	    -print_final_stats=1 build/corpus/$$target $$(ls -d tests/fuzz/corpus/$$target 2>/dev/null) || exit 1; \
	done
	@for numeric in f32 q31; do build/fuzz/storm_image_$$numeric "$$SET_STORM" "$${SET_SEED:-1}" || exit 1; done
	@$(PYTHON) tests/py/mutants.py --count 20000 --seed "$${SET_SEED:-1}"

## the pictures of pages in README.md and docs/fleet.md, by a headless browser
picture: demo
	@tools/setup.sh picture
	@mkdir -p build/pictures
	@printf 'schema = 1\nproduct = "NAV"\n[at_most]\nrms_dph = 9.0e-4\ntable_bytes = 200\n[at_least]\nimprovement = 8.0\n' \
	  >build/pictures/product.toml
	@$(GYROTC) build build/demo-data --limits build/pictures/product.toml --out build/pictures/unit -q
	@$(GYROTC) simulate thermal-gradient --seed 3 --out build/pictures/data -q
	@$(GYROTC) diagnose build/pictures/data --out build/pictures/diagnosis -q
	@$(PYTHON) tools/pictures.py build/pictures

## the paper's table and figures again: docs/paper.md
paper:
	@tools/setup.sh test
	@$(PYTHON) -m gyrotc.paper.page docs

## measured recordings with runs or spans left out: docs/real.md (DATA=folder of the sets)
real: setup
	@$(PYTHON) -c "import matplotlib, sklearn" 2>/dev/null || $(PYTHON) -m pip install -q --disable-pip-version-check -e "./gen[bench,paper]"
	@$(PYTHON) tools/real.py "$$SET_REAL" docs build/real
	@$(PYTHON) tools/real_diagnosis.py "$$SET_REAL" docs build/real

## training beside its peers (in build/bench), cost of the runtime in emulators: docs/results.md
bench:
	@tools/setup.sh test
	@[ -x build/bench/bin/python ] || python3 -m venv build/bench
	@build/bench/bin/python -m pip install -q --disable-pip-version-check -e "./gen[bench]"
	@build/bench/bin/python -m bench docs

## a CSV file of 2 GB through gyrotc import, pandas, polars and pyarrow (in build/bench): docs/results.md
bench-import:
	@tools/setup.sh test
	@[ -x build/bench/bin/python ] || python3 -m venv build/bench
	@build/bench/bin/python -m pip install -q --disable-pip-version-check -e "./gen[bench]"
	@build/bench/bin/python -m bench.importing docs $${SET_MEGABYTES:+"$$SET_MEGABYTES"}

## faults planted in lots of 60 gyros, and which of them gyrotc fleet names: docs/results.md
lot: setup
	@$(PYTHON) -m bench docs --only lot

## does the uncertainty that the page states hold, on 200 simulated units: docs/results.md
uncertainty: setup
	@$(PYTHON) -m bench.budget docs

## is sigma true, and does the status say so, when a sensor, the clock or a re-zero fails: docs/results.md
faults: setup
	@$(PYTHON) -m bench docs --only faults

## every result of the generator as in tests/oracle/reference.json? minutes (GYROTC_REAL_DATA names measured recordings)
oracle: setup
	@$(PYTHON) -m tests.oracle --real "$$SET_REAL"

## what channels gain on simulated gyros, beside other methods (in build/bench, minutes a gyro): docs/results.md
signals:
	@tools/setup.sh test
	@[ -x build/bench/bin/python ] || python3 -m venv build/bench
	@build/bench/bin/python -m pip install -q --disable-pip-version-check -e "./gen[bench]"
	@build/bench/bin/python -m bench.signals docs

## new units from one run and their lot, beside simple ways (a quarter of an hour; SEED=n repeats a draw): docs/results.md
lot-prior: setup
	@$(PYTHON) -c "import sklearn" 2>/dev/null || $(PYTHON) -m pip install -q --disable-pip-version-check -e "./gen[bench]"
	@$(PYTHON) -m bench.lot_prior docs $${SET_SEED:+"$$SET_SEED"}

## a thousand gyros through gyrotc fleet: docs/results.md
fleet: setup
	@$(PYTHON) -m bench docs --only fleet

## a thousand gyros on a Dask cluster whose workers are killed three times: every table as without
fleet-kills: setup
	@GYROTC_SERIALS=$${GYROTC_SERIALS:-1000} GYROTC_DOCS=docs \
	  $(PYTHON) -m pytest -q tests/py/fleet/test_fleet_dask.py -k three_workers_killed

## jobs killed, signalled and let down by the disk at every call that changes a file: docs/results.md
kills: setup
	@$(PYTHON) -m tests.kills.run --docs docs $${SET_SEED:+"--seed=$$SET_SEED"}

## faults of timing, holding and pairing, and clean sets: which findings name them (20 minutes)
evidence: setup
	@$(PYTHON) -m tests.evidence.run --docs docs $${SET_SEED:+"--seed=$$SET_SEED"}

## faults planted in gyrotc, and which check or test sees each: docs/results.md
mutants: setup
	@$(PYTHON) -m tests.mutants.run --docs docs

## hidden effects found again, two fresh seeds of both worlds, an hour: docs/results.md (SEED="n m" goes on or repeats)
blind: setup
	@$(PYTHON) -m tests.blind --workers 2 --docs docs $${SET_SEED:+"--seed=$$SET_SEED"}

## events planted in recordings (steps, drifts, gains, a loose thermometer): found, named, placed (EACH=36, SEED=)
events: setup
	@$(PYTHON) -m tests.events --workers 2 --docs docs --each "$$SET_EACH" $${SET_SEED:+"--seed=$$SET_SEED"}

## the same recordings handed over in other ways (constant, clock, cuts, units, blocks, means): same diagnosis? (30 minutes)
invariance: setup
	@$(PYTHON) -m tests.invariance --real "$$SET_REAL" --docs docs

## training on 2,000 odd but valid data sets, minutes (SETS=2000; SEED=n begins with the n-th: shares)
odd: setup
	@GYROTC_ODD="$$SET_SETS" GYROTC_ODD_SEED="$${SET_SEED:-0}" $(PYTHON) -m pytest -q tests/py/train/test_train.py -k "survives_odd or asked_for_by_name"

## memory named from 100 clean single cycles at four levels of noise (CYCLES=100): at most 2 %
cycles: setup
	@GYROTC_CYCLES=$(or $(CYCLES),100) $(PYTHON) -m pytest -q -s tests/py/diagnose/test_diagnose_replay.py -k clean_cycles

## archives to install from, without sources: sdist, wheel, bills of materials, checksums in build/dist
dist: setup
	@$(PYTHON) tools/archives.py build/dist

## a release: archives and packages of what a tag holds (TAG=v0.2.0), in build/release
release: setup
	@tools/release.sh archive "$$SET_TAG"

## the lock file of the developers' environment, with hashes: gen/requirements.lock
lock:
	@tools/lock.sh

## the archives on a machine without a network: a folder of wheels, installed and run there (root rights)
offline: dist
	@tools/offline.sh

## all pages as a site, with search and the reference made from the code, in build/site
site: setup
	@[ -x build/site-tools/bin/mkdocs ] || { python3 -m venv build/site-tools && \
	  build/site-tools/bin/python -m pip install -q --disable-pip-version-check "mkdocs-material>=9.5,<10"; }
	@build/site-tools/bin/mkdocs build -q --strict -f docs/mkdocs.yml -d ../build/site && echo "build/site/index.html (opens from the disk, search included)"

## archives for ESP-IDF and Rust, sdist and wheel in build/packages; every way to install or use gyrotc, tried (minutes)
packages:
	@tools/setup.sh test
	@$(PYTHON) tools/ways.py build/packages

## remove what was built (not .venv)
clean:
	rm -rf build

.PHONY: help setup demo test test-all targets prove check cov fuzz picture paper real bench bench-import signals fleet fleet-kills lot lot-prior uncertainty faults kills mutants oracle blind events invariance odd cycles packages dist release lock offline site clean
