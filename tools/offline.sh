#!/usr/bin/env bash
# Tries what docs/install.md says of machines without a network: a folder of wheels is collected with one, then gyrotc is
# installed and does its main job in a namespace without any (`unshare -n`; needs root rights). The wheel is that of
# `make dist`. Exit status 0: it works.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$PWD/build/offline
rm -rf "$work" && mkdir -p "$work"
python=$PWD/.venv/bin/python
"$python" -m pip download -q --disable-pip-version-check --dest "$work/wheels" build/dist/gyrotc-*.whl
(cd "$work/wheels" && sha256sum -- *.whl >SHA256SUMS)
unshare -n bash -euc '
  if ip route get 192.0.2.1 >/dev/null 2>&1; then echo "offline: there is a network" >&2; exit 2; fi
  cd "$2"
  (cd wheels && sha256sum -c --quiet SHA256SUMS)
  "$1" -m venv gyro
  env -u PIP_FIND_LINKS gyro/bin/pip install -q --disable-pip-version-check --no-index --find-links wheels gyrotc
  gyro/bin/gyrotc -q simulate paper --seed 1 --out data
  gyro/bin/gyrotc build data --out result | tail -n 2
' offline "$python" "$work"
echo "installed and run without a network: $(find "$work/wheels" -name '*.whl' | wc -l) wheels, $(du -sm "$work/wheels" | cut -f1) MB"
