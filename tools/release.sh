#!/usr/bin/env bash
# A release, from tag to archives in one command.
#
#   tools/release.sh prepare 0.2.0    the version in every file that carries it, the date in CHANGELOG.md; to be looked at,
#                                     committed and tagged (it says how)
#   tools/release.sh archive v0.2.0   what the tag holds, whatever lies about here, as archives in build/release/0.2.0:
#                                     sdist, wheel, bills of materials, packages for firmware, SHA256SUMS
#   tools/release.sh archive v0.2.0 --sdist    without the wheel, which takes a minute of compiling
set -euo pipefail
cd "$(dirname "$0")/.."
fail() { echo "release: $*" >&2; exit 2; }
number='[0-9]+\.[0-9]+\.[0-9]+'
python=${PYTHON:-$PWD/.venv/bin/python}
[ -x "$python" ] || python=python3 # enough for all but the wheel and the bill of materials of the generator

prepare() {
  [[ $1 =~ ^$number$ ]] || fail "'$1' is no version; expected three numbers, as 0.2.0"
  [ -z "$(git status --porcelain)" ] || fail "there are changes that are not committed"
  ! git rev-parse -q --verify "refs/tags/v$1" >/dev/null || fail "there is a tag v$1 already"
  grep -qE "^## $number \(unreleased\)$" CHANGELOG.md || fail "CHANGELOG.md has nothing that is unreleased"
  "$python" tools/version.py --set "$1"
  sed -i -E "0,/^## $number \(unreleased\)$/s//## $1 ($(date -u +%F))/" CHANGELOG.md
  git --no-pager diff --stat
  echo "release: look at it, run the tests, then: git commit -am 'Release $1' && git tag -a v$1 -m 'gyrotc $1' && make release TAG=v$1"
}

archive() {
  local tag=$1 version=${1#v} out
  shift
  [[ $tag =~ ^v$number$ ]] || fail "'$tag' is no tag of a release; expected v and three numbers, as v0.2.0"
  git rev-parse -q --verify "refs/tags/$tag" >/dev/null || fail "there is no tag $tag"
  [ "$python" != python3 ] || fail "there is no .venv here: make setup"
  out=$PWD/build/release/$version
  sources=$(mktemp -d)
  trap 'rm -rf "$sources"' EXIT
  git archive "$tag" | tar -x -C "$sources"
  SOURCE_DATE_EPOCH=$(git log -1 --format=%ct "$tag")
  export SOURCE_DATE_EPOCH
  (
    cd "$sources"
    "$python" tools/version.py
    grep -qE "^#define GTC_VERSION_MINOR $(cut -d. -f2 <<<"$version")$" include/gtc.h && grep -qF "version = \"$version\"" gen/pyproject.toml ||
      fail "$tag holds another version: tools/release.sh prepare $version"
    grep -qE "^## ${version//./\\.} \([0-9]{4}-[0-9]{2}-[0-9]{2}\)$" CHANGELOG.md || fail "CHANGELOG.md of $tag has no dated section $version"
  )
  rm -rf "$out" && mkdir -p "$out"
  (cd "$sources" && "$python" tools/archives.py "$out" "$@" && "$python" tools/packages.py "$out/packages")
  find "$out/packages" -mindepth 1 -maxdepth 1 -type d -exec rm -r {} + # what the archives were made of
  (cd "$out" && find . -type f ! -name 'SHA256SUMS*' -printf '%P\n' | LC_ALL=C sort | xargs -d '\n' sha256sum >SHA256SUMS.all && mv SHA256SUMS.all SHA256SUMS)
  echo "release: $out"
}

case ${1:-} in
  prepare | archive) [ $# -ge 2 ] || fail "$1 what?"; "$@" ;;
  *) fail "expected prepare or archive" ;;
esac
