#!/usr/bin/env bash
# The way of a newcomer on this machine, timed step by step: README's first command, then every command of
# docs/tutorial.md (own files, firmware in QEMU). Prints a section for docs/install.md;
# what the commands say goes to build/walk.log. For a machine on which nothing is installed yet; exit status 1 if a
# step fails, with the end of the log.
set -euo pipefail
cd "$(dirname "$0")/.."
mkdir -p build
log=$PWD/build/walk.log
: >"$log"
TIMEFORMAT='%R %U %S'

# step TEXT COMMAND...: a row with seconds of clock and of processors.
step() {
  local text=$1 took
  shift
  if ! took=$({ time "$@" >>"$log" 2>&1; } 2>&1); then
    tail -n 30 "$log" >&2
    echo "walk: failed: $*" >&2
    exit 1
  fi
  read -r real user sys <<<"$took"
  awk -v text="$text" -v r="$real" -v u="$user" -v s="$sys" 'BEGIN {printf "| %s | %.0f | %.0f |\n", text, r, u + s}'
}

tutorial() { .venv/bin/python tools/documents.py --times docs/tutorial.md | tee build/walk-tutorial.txt; }

system=$(. /etc/os-release && echo "$PRETTY_NAME")
echo "## $system, $(uname -m), $(nproc) processors: $(date -u +%F), commit $(git rev-parse --short HEAD), load $(cut -d' ' -f1 /proc/loadavg) at the start"
echo
echo "| step | s | s of processor time |"
echo "| --- | ---: | ---: |"
step '`make setup`: packages of the system (ARM compiler and emulator among them), `.venv`, core' make setup
step '`make demo`: simulated recordings to verified C and a report' make demo
step '[tutorial.md](tutorial.md): own files to firmware in QEMU' tutorial
echo
echo "Commands of the tutorial that took a second or more:"
echo
echo "| command | s |"
echo "| --- | ---: |"
awk '$1 >= 1 && $2 == "s" {s = $1; $1 = $2 = ""; sub(/^ +/, ""); gsub(/\|/, "\\|"); printf "| `%s` | %.0f |\n", $0, s}' build/walk-tutorial.txt
