# gyrotc - the one door. `make help` lists what there is.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
override PYTHON := .venv/bin/python
override GYROTC := .venv/bin/gyrotc
# Of tests/check what takes minutes; the rest takes half an hour.
override QUICK_CHECKS := $(addprefix tests/check/test_,eighty_recordings.py import_order.py coverage.py check_libc.py)
override FUZZERS := map check open image step restore
# What a user sets reaches programs as it is, through the environment and quoted: $(value) keeps make, the quotes keep
# the shell from reading it, and unexport keeps make from expanding it for the environment.
unexport DATA AXIS SECONDS SEED STORM GYROTC_REAL_DATA TAG ONLY BASE SETS QUICK
override export SET_DATA := $(value DATA)
override export SET_AXIS := $(value AXIS)
override export SET_SECONDS := $(or $(value SECONDS),20)
override export SET_STORM := $(or $(value STORM),1000000)
override export SET_SEED := $(value SEED)
override export SET_TAG := $(value TAG)
override export SET_ONLY := $(value ONLY)
override export SET_BASE := $(value BASE)
override export SET_SETS := $(value SETS)
override export SET_QUICK := $(value QUICK)
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
	@rm -rf build/demo
	@$(GYROTC) build --out build/demo $${SET_AXIS:+"--axis=$$SET_AXIS"} -- "$$SET_DATA"
else
	@$(GYROTC) simulate paper --seed 1 --out build/demo-data
	@rm -rf build/demo
	@$(GYROTC) build build/demo-data --out build/demo
endif

## what to run before a commit: C library, generator, one of each command
test:
	@tools/setup.sh test
	@mkdir -p build
	@cmake -S tests/c -B build/ctest -DCMAKE_BUILD_TYPE=Debug >build/ctest.log 2>&1 || { cat build/ctest.log; exit 1; }
	@cmake --build build/ctest -j2 >>build/ctest.log 2>&1 || { cat build/ctest.log; exit 1; }
	@ctest --test-dir build/ctest -j2 --output-on-failure
	@cmake -S tests/fuzz -B build/fuzz -DCMAKE_C_COMPILER=clang >build/fuzz.log 2>&1 || { cat build/fuzz.log; exit 1; }
	@cmake --build build/fuzz -j2 >>build/fuzz.log 2>&1 || { cat build/fuzz.log; exit 1; }
	@ctest --test-dir build/fuzz -j2 --output-on-failure
	@$(PYTHON) -m pytest -q -rs -n 2 --dist loadfile --no-loadscope-reorder

## the emitted code on every target, negative controls, nav_loop: docs/results.md
targets:
	@tools/setup.sh targets
	@$(PYTHON) -m pytest -q -rs tests/targets --results docs

## every input of a table, no run-time error, rounding bounds (Frama-C, Gappa, Z3; minutes): docs/results.md
prove:
	@tools/setup.sh prove
	@$(PYTHON) -m pytest -q -rs -n 2 --dist worksteal tests/prove --results docs

## style and types (ruff, mypy), imports; the C library's warnings, symbols, fused operations, MISRA, analysers; eighty diagnoses
check:
	@tools/setup.sh check
	@.venv/bin/ruff check --config gen/pyproject.toml gen tests tools bench
	@.venv/bin/ruff format --config gen/pyproject.toml --check gen tests tools bench
	@cd gen && ../.venv/bin/mypy gyrotc && ../.venv/bin/lint-imports --config pyproject.toml
	@$(PYTHON) tools/check_libc
	@$(PYTHON) -m bench.paper.page docs --check
	@GYROTC_PAPER_GYROS=10 $(PYTHON) -m pytest -q tests/cases/paper/test_paper_reference.py
	@$(PYTHON) -m pytest -q -rs -n 2 --dist worksteal $(QUICK_CHECKS)

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
	@$(PYTHON) tests/support/mutants.py --count 20000 --seed "$${SET_SEED:-1}"

## the paper's table and figures again: docs/paper.md
paper:
	@tools/setup.sh test
	@$(PYTHON) -m bench.paper.page docs

## measured recordings with runs or spans left out: docs/real.md (DATA=folder of the sets)
real: setup
	@$(PYTHON) -c "import matplotlib, sklearn" 2>/dev/null || $(PYTHON) -m pip install -q --disable-pip-version-check -e "./gen[bench,paper]"
	@$(PYTHON) -m bench.real.page "$$SET_REAL" docs build/real
	@$(PYTHON) -m bench.real.diagnosis "$$SET_REAL" docs build/real

## measure: lists the campaigns; ONLY=name runs one, keeps its record and makes docs/results.md (QUICK=1 SEED= SETS=a,b BASE=commit)
bench:
	@tools/setup.sh test
	@$(PYTHON) -m bench --real="$$SET_REAL" $${SET_SEED:+"--seed=$$SET_SEED"} $${SET_SETS:+"--sets=$$SET_SETS"} \
	  $${SET_BASE:+"--base=$$SET_BASE"} $${SET_QUICK:+--quick} -- $${SET_ONLY:+"$$SET_ONLY"}

## tests of the tools and archives; hidden effects found again, two fresh seeds of both worlds: docs/results.md (SEED="n m" goes on or repeats)
blind:
	@tools/setup.sh check
	@$(PYTHON) -m pytest -q -rs -n 2 --dist worksteal tests/check $(addprefix --ignore=,$(QUICK_CHECKS))
	@$(PYTHON) -m tests.blind --workers 2 --docs docs $${SET_SEED:+"--seed=$$SET_SEED"}

## sdist, wheel, C archive, bills of materials and checksums of this commit, or of TAG=v0.2.0; tried without a network
release: setup
	@tools/release.sh archive $${SET_TAG:+"$$SET_TAG"}

## the lock file of the developers' environment, with hashes: gen/requirements.lock
lock:
	@tools/lock.sh

## all pages as a site, with search and the reference made from the code, in build/site
site:
	@tools/setup.sh test
	@.venv/bin/mkdocs build -q --strict -f docs/mkdocs.yml -d ../build/site && echo "build/site/index.html (opens from the disk, search included)"

## remove what was built (not .venv)
clean:
	rm -rf build

.PHONY: help setup demo test check cov fuzz prove targets bench blind paper real site release lock clean
