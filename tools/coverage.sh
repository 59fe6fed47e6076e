#!/usr/bin/env bash
# Branch coverage of libc/ by the C tests: every line and branch of each arithmetic must be reached, or it fails.
#
# The tests run with gcov's counters once for each set of options; gcovr adds up what they reached, for each arithmetic
# by itself. The negative control, a runtime whose primitives expect what no arithmetic gives, is counted, too.
set -euo pipefail
cd "$(dirname "$0")/.."
gcovr=${GCOVR:-.venv/bin/gcovr}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# count NUMERIC ROOT TESTS [OPTION...]: builds and runs tests with the runtime in ROOT/libc, and keeps what they reached.
count() {
  local numeric=$1 root=$2 tests=$3 folder source counted test
  folder=$(mktemp -d -p "$out")
  shift 3
  local flags=(-std=c99 -O0 -ffp-contract=off -Iinclude -Itests/c -Itests/c/table "-DTEST_Q31=$([ "$numeric" = f32 ] && echo 0 || echo 1)")
  for source in "$root"/libc/*.c; do
    counted=--coverage
    case $source in *gtc_"$numeric".c) ;; *) counted= ;; esac
    # shellcheck disable=SC2086  # a word or none
    gcc "${flags[@]}" $counted "$@" -c "$source" -o "$folder/$(basename "$source").o"
  done
  for test in $tests; do
    gcc "${flags[@]}" "$@" "$test" tests/c/table/*.c "$folder"/*.o -lgcov -o "$folder/test"
    "$folder/test" >/dev/null
  done
  [ "$root" = "$PWD" ] || cp libc/* "$root/libc"  # gcovr tells lines by their text
  "$gcovr" --root "$root" --filter "$root/libc/" --json "$folder.$numeric.json" "$folder"
}

least="-DGTC_MAX_TERMS=0"
for part in UNCERTAINTY COVERAGE PROBES IMAGE SAVE TIME; do
  least+=" -DGTC_WITH_$part=0"
done
missed=0
for numeric in f32 q31; do
  options=("" "-DGTC_WITH_BANK=1")
  wrong=s/0xF33649C0UL/0xF33649C1UL/
  if [ $numeric = q31 ]; then
    options+=("-DGTC_HALF_MULTIPLY=1 -DGTC_WITH_BANK=1")
    wrong=s/0x7FFFFFFEUL/0x7FFFFFFFUL/
  fi
  for option in "${options[@]}"; do
    # shellcheck disable=SC2086  # words of options
    count $numeric "$PWD" "$(printf '%s\n' tests/c/test_*.c | grep -v -e test_broken.c -e test_unit.c -e test_least.c)" $option
  done
  # shellcheck disable=SC2086  # words of options
  count $numeric "$PWD" tests/c/test_least.c $least
  mkdir "$out/broken-$numeric"
  cp -r libc "$out/broken-$numeric"
  sed -i "$wrong" "$out/broken-$numeric/libc/gtc_selftest_$numeric.h"
  count $numeric "$out/broken-$numeric" tests/c/test_broken.c
  echo "$numeric:"
  "$gcovr" --root . --json-add-tracefile "$out/*.$numeric.json" --txt - --merge-mode-functions separate --txt-summary --txt-metric branch \
    --fail-under-branch 100 --fail-under-line 100 || missed=1
done
exit $missed
