#!/usr/bin/env bash
# Installs what gyrotc needs: system packages (Debian, Ubuntu) that are missing, then the virtual environment .venv.
#
#   tools/setup.sh            for `make demo`: compiler, Python, Eigen; the ARM compiler and its emulator
#   tools/setup.sh test       besides, what `make test` uses, Chromium for the pages among it
#   tools/setup.sh check      besides, the cross compilers of `make check`
#   tools/setup.sh targets    besides, the cross compilers and emulators of `make targets`
#   tools/setup.sh prove      besides, the proof tools of `make prove`
#
# `locked` behind a level takes the versions of gen/requirements.lock, each file held against its SHA-256.
#
# No release's number stands in a package's name here: what belongs to one version of a compiler is asked of that compiler.
# Without the packages of `base` nothing works; any other that this release does not have is named, and what needs it does not run.
# A second call finds everything in place and does nothing. On a terminal it asks before it uses sudo.
set -euo pipefail
cd "$(dirname "$0")/.."
level=${1:-demo}
locked=${2:-}
[ -z "$locked" ] || [ "$locked" = locked ] || { echo "setup: unknown word '$locked' (locked)" >&2; exit 2; }

base=(g++ make python3 python3-dev python3-venv libeigen3-dev)
arm=(gcc-arm-none-eabi qemu-system-arm)
test=(clang cmake cppcheck gcc-s390x-linux-gnu libc6-dev-s390x-cross qemu-user
      clang-tidy pkg-config strace git chromium)
check=(gcc-aarch64-linux-gnu libc6-dev-arm64-cross gcc-avr avr-libc)
targets=(gcc-aarch64-linux-gnu libc6-dev-arm64-cross gcc-riscv64-linux-gnu libc6-dev-riscv64-cross
         gcc-powerpc-linux-gnu libc6-dev-powerpc-cross gcc-m68k-linux-gnu libc6-dev-m68k-cross libc6-dev-i386
         gcc-riscv64-unknown-elf qemu-system-misc gcc-avr avr-libc simavr)
prove=(frama-c-base gappa z3)

case $level in
  demo) packages=() ;;
  test) packages=("${test[@]}") ;;
  check) packages=("${test[@]}" "${check[@]}") ;;
  targets) packages=("${test[@]}" "${targets[@]}") ;;
  prove) packages=("${test[@]}" "${prove[@]}") ;;
  *) echo "setup: unknown level '$level' (demo, test, check, targets, prove)" >&2; exit 2 ;;
esac
packages=("${base[@]}" "${arm[@]}" "${packages[@]}")

installed() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q 'install ok installed'; }

# Names of the packages that belong to the compilers installed by now: the sanitizers of clang, the 32-bit part of gcc
# (gcc-multilib would bring it too, but is in conflict with the cross compilers).
belonging() {
  case $level in demo) return 0 ;; esac
  if command -v clang >/dev/null; then echo "libclang-rt-$(clang -dumpversion | cut -d. -f1)-dev"; fi
  if [ "$level" = targets ]; then echo "lib32gcc-$(gcc -dumpversion | cut -d. -f1)-dev"; fi
}

as=()
updated=""
become_root() {
  [ "$(id -u)" != 0 ] && [ ${#as[@]} -eq 0 ] || return 0
  command -v sudo >/dev/null || { echo "setup: not root and no sudo: install these packages by hand: $*" >&2; exit 2; }
  if [ -t 0 ]; then
    read -r -p "setup: use sudo apt-get for this? [y/N] " answer
    [ "$answer" = y ] || { echo "setup: stopped; install by hand: $*" >&2; exit 2; }
  fi
  as=(sudo)
}

# install_missing PACKAGE...: a package outside `base` that the release does not have is reported and left out.
install_missing() {
  local missing=() known=() p
  for p in "$@"; do installed "$p" || missing+=("$p"); done
  [ ${#missing[@]} -eq 0 ] && return 0
  if [ -z "$updated" ]; then
    become_root "${missing[@]}"
    "${as[@]}" apt-get update -qq
    updated=1
  fi
  for p in "${missing[@]}"; do
    if [[ " ${base[*]} " == *" $p "* ]] || apt-cache show "$p" >/dev/null 2>&1; then
      known+=("$p")
    else
      echo "setup: this release has no package $p: what needs it does not run" >&2
    fi
  done
  [ ${#known[@]} -eq 0 ] && return 0
  echo "setup: installing system packages: ${known[*]}"
  DEBIAN_FRONTEND=noninteractive "${as[@]}" apt-get install -y -qq --no-install-recommends "${known[@]}" >/dev/null
}

if command -v dpkg-query >/dev/null && command -v apt-get >/dev/null; then
  install_missing "${packages[@]}"
  mapfile -t more < <(belonging)
  install_missing "${more[@]}"
else
  echo "setup: no apt-get here; needed are: ${packages[*]} (or what your system calls them)" >&2
fi

# The environment is made again when what it is made of has changed.
extras=""
case $level in demo) ;; *) extras="[test]" ;; esac
stamp=.venv/.gyrotc$extras
fingerprint=$({ echo "$locked"; cat gen/pyproject.toml gen/CMakeLists.txt gen/core/* tools/setup.sh; find gen/gyrotc -name "*.py" | sort; } | sha256sum | cut -d" " -f1)
if [ "$(cat "$stamp" 2>/dev/null || true)" != "$fingerprint" ]; then
  [ -x .venv/bin/python ] || { echo "setup: making .venv"; python3 -m venv .venv; }
  echo "setup: installing gyrotc into .venv (builds the C++ core)"
  pip=(.venv/bin/python -m pip install -q --disable-pip-version-check)
  if [ -n "$locked" ]; then
    "${pip[@]}" --require-hashes --only-binary :all: -r gen/requirements.lock
    "${pip[@]}" --no-deps --no-build-isolation -e gen
  else
    "${pip[@]}" -e "gen$extras"
  fi
  echo "$fingerprint" >"$stamp"
  [ -z "$extras" ] || echo "$fingerprint" >.venv/.gyrotc
  case $PATH in *"$PWD/.venv/bin"*) ;; *) echo "setup: gyrotc is $PWD/.venv/bin/gyrotc; for this shell: export PATH=$PWD/.venv/bin:\$PATH" ;; esac
fi
