#!/usr/bin/env bash
# A release, from a commit to archives in one command.
#
#   tools/release.sh prepare 0.2.0     the version in every file that carries it, the date in CHANGELOG.md, pictures of
#                                      pages; to be looked at, committed and tagged (it says how)
#   tools/release.sh archive           the last commit, from a clean tree, as archives in build/release/<version>: sdist,
#                                      wheel, C library, bills of materials, SHA256SUMS; then installed and tried
#   tools/release.sh archive v0.2.0    what this tag holds; refused if a record in docs/results was measured with other
#                                      sources in gen, libc or include, but for the version (without a tag: a warning)
#   tools/release.sh archive [TAG] --sdist    without the wheel, which takes a minute of compiling, and not tried
set -euo pipefail
cd "$(dirname "$0")/.."
fail() { echo "release: $*" >&2; exit 2; }
number='[0-9]+\.[0-9]+\.[0-9]+'
python=${PYTHON:-$PWD/.venv/bin/python}
[ -x "$python" ] || python=python3 # enough for all but the wheel and the bill of materials of the generator

prepare() {
  [[ ${1:-} =~ ^$number$ ]] || fail "'${1:-}' is no version; expected three numbers, as 0.2.0"
  [ -z "$(git status --porcelain)" ] || fail "there are changes that are not committed"
  ! git rev-parse -q --verify "refs/tags/v$1" >/dev/null || fail "there is a tag v$1 already"
  grep -qE "^## $number \(unreleased\)$" CHANGELOG.md || fail "CHANGELOG.md has nothing that is unreleased"
  "$python" tools/version.py --set "$1"
  sed -i -E "0,/^## $number \(unreleased\)$/s//## $1 ($(date -u +%F))/" CHANGELOG.md
  if [ "$python" != python3 ] && command -v chromium >/dev/null; then
    "$python" tools/pictures.py
  else
    echo "release: pictures of pages stay as they are; tools/setup.sh test brings what makes them" >&2
  fi
  git --no-pager diff --stat
  echo "release: look at it, run the tests, then: git commit -am 'Release $1' && git tag -a v$1 -m 'gyrotc $1' && make release TAG=v$1"
}

# outdated COMMIT FOLDER: the records of FOLDER that were measured with other sources than those of COMMIT, each with the
# commit that it states. A record without one is made again and compared by its own command.
outdated() {
  local record measured changes
  for record in "$2"/docs/results/*.json; do
    [ -e "$record" ] || continue
    measured=$(sed -n 's/.*"commit": "\([^"]*\)".*/\1/p' "$record" | head -n 1)
    [ -n "$measured" ] || continue
    # git fails on what is no commit here: one with a `+`, one that a clone without history does not have
    if ! changes=$(git diff -I'^version = "' -I'^__version__ = "' -I'^#define GTC_VERSION_' "$measured" "$1" -- gen libc include 2>/dev/null) ||
      [ -n "$changes" ]; then
      echo "$(basename "$record" .json) ($measured)"
    fi
  done
}

archive() {
  local commit=HEAD version out records
  if [ $# -gt 0 ] && [ "$1" != --sdist ]; then
    [[ $1 =~ ^v$number$ ]] || fail "'$1' is no tag of a release; expected v and three numbers, as v0.2.0"
    git rev-parse -q --verify "refs/tags/$1" >/dev/null || fail "there is no tag $1"
    commit=$1
    shift
  else
    [ -z "$(git status --porcelain)" ] || fail "there are changes that are not committed"
  fi
  [ "$python" != python3 ] || fail "there is no .venv here: make setup"
  sources=$(mktemp -d)
  trap 'rm -rf "$sources"' EXIT
  git archive "$commit" | tar -x -C "$sources"
  SOURCE_DATE_EPOCH=$(git log -1 --format=%ct "$commit")
  export SOURCE_DATE_EPOCH
  version=$(cd "$sources" && "$python" tools/version.py) || fail "$version"
  if [ "$commit" != HEAD ]; then
    [ "v$version" = "$commit" ] || fail "$commit holds another version, $version: tools/release.sh prepare ${commit#v}"
    grep -qE "^## ${version//./\\.} \([0-9]{4}-[0-9]{2}-[0-9]{2}\)$" "$sources/CHANGELOG.md" ||
      fail "CHANGELOG.md of $commit has no dated section $version"
  fi
  records=$(outdated "$commit" "$sources" | paste -sd, | sed 's/,/, /g')
  if [ -n "$records" ]; then
    records="records of other sources in gen, libc or include: $records; measure them again: make bench ONLY=NAME, make targets, make prove, make blind"
    [ "$commit" = HEAD ] || fail "$records"
    echo "release: $records" >&2
  fi
  out=$PWD/build/release/$version
  rm -rf "$out" && mkdir -p "$out"
  (cd "$sources" && "$python" tools/archives.py "$out" "$@")
  [ "${1:-}" = --sdist ] || tried "$out"
  echo "release: $out"
}

# tried FOLDER: a folder of wheels is collected with a network, then gyrotc is installed from it and does its main job in
# a namespace without one.
tried() {
  local work
  if ! unshare -n true 2>/dev/null; then
    echo "release: not tried without a network, which needs root rights (unshare -n)" >&2
    return
  fi
  work=$(mktemp -d -p build)
  "$python" -m pip download -q --disable-pip-version-check --dest "$work/wheels" "$1"/gyrotc-*.whl
  unshare -n bash -euc '
    if ip route get 192.0.2.1 >/dev/null 2>&1; then echo "release: there is a network" >&2; exit 2; fi
    cd "$2"
    "$1" -m venv gyro
    env -u PIP_FIND_LINKS gyro/bin/pip install -q --disable-pip-version-check --no-index --find-links wheels gyrotc
    gyro/bin/gyrotc -q simulate paper --seed 1 --out data
    gyro/bin/gyrotc build data --out result | tail -n 2
  ' tried "$python" "$work"
  echo "release: installed and run without a network from $(find "$work/wheels" -name '*.whl' | wc -l) wheels, $(du -sm "$work/wheels" | cut -f1) MB"
  rm -rf "$work"
}

case ${1:-} in
  prepare | archive) "$@" ;;
  *) fail "expected prepare or archive" ;;
esac
