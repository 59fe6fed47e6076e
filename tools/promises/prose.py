"""Words and sentences of documents and sources: plain engineering English, lines that end at sentences.

`words.toml` lists words that a reader would have to learn first, each with what to write instead, and how many of them
still stand in each part of the tree: a number that may only fall. `python tools/promises/prose.py` breaks the lines of
pages at the ends of sentences, and prints lengths of sentences and counts of words.
"""

from __future__ import annotations

import re
import statistics
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LONGEST, MEDIAN = 45, 22  # words of a sentence: what a reader holds in mind at once
_SHORT = (
    "e.g.",
    "i.e.",
    " al.",
    "Opt.",
    "Eng.",
    " J.",
    "Electron.",
    "Proc.",
    "Rev.",
    "Phys.",
    "Trans.",
    "Appl.",
    "Fig.",
    "(J.",
)
_END = re.compile(
    r"(?<=[^\s.][.!?])"
    + "".join(f"(?<!{re.escape(s)})" for s in _SHORT)
    + r"([\"”)]*)\s+(?=[A-Z`\"“(\[*_0-9α-ω]|gyrotc\b)"
)
_LIST = re.compile(r"(\s*)([-*+]|\d+[.)])(\s+|$)")
_KEPT = re.compile(r"\s*($|[|#<>$]|!\[|---)")
_WORD = re.compile(r"[A-Za-z]+(?:-[A-Za-z]+)*")


def pages(root: Path) -> list[Path]:
    """Pages for readers; the change log and decisions are records."""
    return sorted([*root.glob("docs/*.md"), *(root / n for n in ("README.md", "CONTRIBUTING.md", "SECURITY.md"))])


def sources(root: Path) -> list[Path]:
    """Python of the generator and of its tools."""
    folders = ("gen/gyrotc", "tools", "bench")
    return sorted(p for folder in folders for p in (root / folder).rglob("*.py") if p.name != "prose.py")


def _blocks(text: str) -> Iterator[tuple[str, str]]:
    """Pieces of a page: ("prose", a paragraph or an item) and ("kept", a line that stays)."""
    code, made, held = False, False, ""
    for line in text.splitlines():
        if re.fullmatch(r"<!-- /?[\w-]+ -->", line):  # a block that a program writes
            made = not line.startswith("<!-- /")
        fence = line.lstrip().startswith("```")
        if code or fence or made or _KEPT.match(line) or _LIST.match(line):
            if held:
                yield "prose", held
                held = ""
            if fence:
                code = not code
            if not (code or fence or made) and _LIST.match(line):
                held = line
            else:
                yield "kept", line
        elif held:
            held += " " + line.strip()
        else:
            held = line
    if held:
        yield "prose", held


def sentences(paragraph: str) -> list[str]:
    """The sentences of a paragraph."""
    item = _LIST.match(paragraph)
    head = item[0] if item else ""
    first, *rest = _END.sub(lambda m: m[1] + "\n", paragraph[len(head) :]).split("\n")
    return [head + first, *rest]


def broken(text: str) -> str:
    """A page whose lines end at sentences."""
    out: list[str] = []
    for kind, block in _blocks(text):
        if kind == "kept":
            out.append(block)
            continue
        item = _LIST.match(block)
        indent = " " * len(item[0]) if item else re.match(r"\s*", block)[0]  # type: ignore[index]
        first, *rest = sentences(block)
        out += [first, *(indent + s for s in rest)]
    return "\n".join(out) + "\n"


def lengths(text: str) -> list[int]:
    """Words of each sentence of a page."""
    found = (s for kind, block in _blocks(text) if kind == "prose" for s in sentences(block))
    return [sum(1 for w in _plain(s).split() if re.search(r"\w", w)) for s in found]


def _plain(block: str) -> str:
    item = _LIST.match(block)
    text = re.sub(r"<!--.*?-->", "", block[item.end() :] if item else block)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"`[^`]*`", "X", text)


def long_sentences(root: Path) -> Iterator[str]:
    """Pages whose lines end elsewhere, and sentences of too many words."""
    every: list[int] = []
    for page in pages(root):
        text = page.read_text("utf-8")
        where = page.relative_to(root)
        for number, (is_, should) in enumerate(zip(text.splitlines(), broken(text).splitlines(), strict=False), 1):
            if is_ != should:
                yield f"{where}:{number}: the line does not end at a sentence (python tools/promises/prose.py)"
                break
        found = lengths(text)
        every += found
        yield from (f"{where}: a sentence of {n} words, more than {LONGEST}" for n in found if n > LONGEST)
    if every and statistics.median(every) > MEDIAN:
        yield f"the median sentence of all pages has {statistics.median(every):g} words, more than {MEDIAN}"


_SOURCE = re.compile(r"`([\w./-]+\.(?:py|cpp|hpp|inl|sh))`")
_FOLDERS = ("bench", "examples", "gen", "include", "libc", "packages", "tests", "tools")
_EXAMPLES = {"CONTRIBUTING.md"}  # names files that its reader writes


def missing_files(root: Path) -> Iterator[str]:
    """Source files that a page names and the tree does not have."""
    have = {path.relative_to(root).as_posix() for path in root.rglob("*") if _SOURCE.fullmatch(f"`{path.name}`")}
    for page in pages(root):
        where = page.relative_to(root).as_posix()
        for name in _SOURCE.findall(page.read_text("utf-8")) if where not in _EXAMPLES else ():
            if not any(f"/{path}".endswith(f"/{name}") for path in have):
                yield f"{where}: there is no {name}"


def listed(root: Path) -> dict[str, Any]:
    """The list of words."""
    return tomllib.loads((root / "tools" / "promises" / "words.toml").read_text("utf-8"))


def counted(root: Path) -> dict[str, Counter[str]]:
    """How often each listed word stands in pages and in sources."""
    words = set(listed(root)["instead"])
    parts = {"pages": pages(root), "sources": sources(root)}
    return {part: _count(files, words) for part, files in parts.items()}


def _count(files: list[Path], words: set[str]) -> Counter[str]:
    found: Counter[str] = Counter()
    for path in files:
        text = path.read_text("utf-8").replace("_", " ")
        if path.suffix == ".md":
            text = re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)
        found.update(w for w in map(str.lower, _WORD.findall(text)) if w in words)
    return found


def private_words(root: Path) -> Iterator[str]:
    """Words of the list that stand more often than they did."""
    table = listed(root)
    for part, found in counted(root).items():
        for word, instead in table["instead"].items():
            most = table["most"].get(part, {}).get(word, 0)
            if found[word] > most:
                yield f"{part}: {word!r} stands {found[word]} times, more than {most}; write {instead}"


def main(root: Path) -> None:
    """Breaks the lines of all pages, and prints figures."""
    every: list[int] = []
    for page in pages(root):
        text = page.read_text("utf-8")
        if broken(text) != text:
            page.write_text(broken(text), "utf-8")
        every += lengths(text)
    print(f"{len(every)} sentences, median {statistics.median(every):g} words, {max(every)} at most")
    for part, found in counted(root).items():
        print(f"{part}: {sum(found.values())}", *(f'"{w}" = {n}' for w, n in found.most_common()), sep="\n  ")


if __name__ == "__main__":
    main(Path(__file__).resolve().parents[2])
