#!/usr/bin/env bash
# Writes gen/requirements.lock: every package of the developers' environment (gen/pyproject.toml with its tests, and what
# builds the core) with one version for each Python from 3.10 on and the SHA-256 of each of its files. No place that
# packages come from stands in it. `tools/setup.sh test locked` installs from it.
set -euo pipefail
cd "$(dirname "$0")/.."
tools=build/lock-tools
[ -x $tools/bin/uv ] || { python3 -m venv $tools && $tools/bin/python -m pip install -q --disable-pip-version-check "uv>=0.5"; }
# cmake and ninja are asked for by scikit-build-core where the system has none.
build=$(sed -n '/^\[build-system\]/,/^$/s/^requires = \[\(.*\)\]/\1/p' gen/pyproject.toml | tr -d '" ' | tr ',' '\n')
printf '%s\ncmake\nninja\n' "$build" >build/lock.in
$tools/bin/uv pip compile --quiet --universal --python-version 3.10 --upgrade --generate-hashes --no-emit-index-url \
  --no-emit-find-links --no-header --no-annotate --extra test gen/pyproject.toml build/lock.in -o build/lock.part
sed -i '1i # Written by tools/lock.sh (make lock); every file by its SHA-256.' build/lock.part
mv build/lock.part gen/requirements.lock
grep -c == gen/requirements.lock | sed 's/$/ pinned versions in gen\/requirements.lock/'
