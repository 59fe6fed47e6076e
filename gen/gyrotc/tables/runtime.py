"""Write the runtime as plain C: one header, and one source for each arithmetic, without options.

`libc/` is one text for both arithmetics, in names of types that `gtc_names_<n>.h` defines, with conditions on the
options of `gtc_config.h`. Here the options are known: lines that belong to what is not asked for are left out, names
are replaced by what they stand for, and the files are put together in the order in which they include each other.
Nothing else is changed, so that a C preprocessor makes the same tokens of `libc/` with the same options
(tests/cases/tables/test_runtime.py).
"""

from __future__ import annotations

import functools
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..common.errors import CheckFailed
from ..common.inputs import runtime_folders
from ..mirror.kinds import TableKind
from ..mirror.table import PARTS
from ..model import Model, RuntimePart
from ..results.base import NUMERICS
from .q31 import DEFAULT_BITS
from .quantisation import quantise
from .rounding import channel_names

RUNTIME_FILES = ("gtc.h", "gtc_f32.c", "gtc_q31.c")
"""Files of the runtime, of which a folder has the header and the arithmetics of its tables."""
#: Options by the part that a product may leave out.
SWITCHES: dict[RuntimePart, str] = {
    "uncertainty": "GTC_WITH_UNCERTAINTY",
    "rezero": "GTC_WITH_REZERO",
    "coverage": "GTC_WITH_COVERAGE",
    "known_answers": "GTC_WITH_PROBES",
    "image": "GTC_WITH_IMAGE",
    "saved_state": "GTC_WITH_SAVE",
    "time": "GTC_WITH_TIME",
}
#: Options by the part that a table needs.
_OF_PARTS = {
    "bank": "GTC_WITH_BANK",
    **{kind.name.lower(): f"GTC_WITH_{kind.name}" for kind in TableKind},
    "coverage": "GTC_WITH_COVERAGE",
    "uncertainty": "GTC_WITH_UNCERTAINTY",
    "probes": "GTC_WITH_PROBES",
    "narrow": "GTC_WITH_NARROW",
    "rezero": "GTC_WITH_REZERO",
}
#: Options that decide which functions a header declares.
_OF_FUNCTIONS = (
    "GTC_WITH_F32",
    "GTC_WITH_Q31",
    "GTC_WITH_UNCERTAINTY",
    "GTC_WITH_REZERO",
    "GTC_WITH_IMAGE",
    "GTC_WITH_SAVE",
)
_LONGEST = 120  # characters of a line

Options = Mapping[str, int]


def needs_of(model: Model) -> dict[str, int]:
    """Return the options of the smallest runtime that holds the tables of a model and has what its product asks for."""
    kinds = {term.table.kind for term in model.terms}
    needs = {
        "GTC_MAX_SLOPE_BLOCKS": model.slope_blocks,
        "GTC_MAX_TERMS": max(len(model.terms), len(channel_names(model))),
        "GTC_BIAS_FRAC_BITS": DEFAULT_BITS if model.q31_bias_frac_bits is None else model.q31_bias_frac_bits,
        "GTC_WITH_BANK": int(len(model.networks) > 1),
        "GTC_WITH_NARROW": int(_is_narrow(model)),
    }
    needs |= {f"GTC_WITH_{kind.name}": int(kind in kinds) for kind in TableKind}
    return needs | {switch: int(part not in model.left_out) for part, switch in SWITCHES.items()}


def _is_narrow(model: Model) -> bool:
    """Test whether the fixed-point table of a model, if it has one, needs the code of narrow Gaussians."""
    try:
        return bool(quantise(model, "q31").parts & PARTS["narrow"])
    except CheckFailed:
        return False


def joint_needs(needs: Iterable[Options]) -> dict[str, int]:
    """Return the options that several tables need together: the larger number of each."""
    joint: dict[str, int] = {}
    for one in needs:
        joint |= {name: max(value, joint.get(name, 0)) for name, value in one.items()}
    return joint


def stated_needs(header: str) -> dict[str, int]:
    """Return the options that a `gtc.h` states."""
    return {name: int(value) for name, value in _STATED.findall(header)}


def _derived(options: Options) -> dict[str, int]:
    """Return the settings that gtc_config.h derives from the options."""
    terms = options["GTC_MAX_TERMS"]
    channels = max(options[f"GTC_WITH_{kind.name}"] for kind in TableKind if kind.description.reads_channel)
    retained = max(options[f"GTC_WITH_{kind.name}"] for kind in TableKind if kind.description.has_state)
    derived = {
        "GTC_WITH_TERMS": int(terms > 0),
        "GTC_WITH_CHANNELS": channels,
        "GTC_WITH_RETAINED": retained,
        "GTC_MAX_CHANNELS": 1 + terms * channels,
        "GTC_PARTS": sum(PARTS[part] * options[option] for part, option in _OF_PARTS.items()),
    }
    uncertainty = options["GTC_WITH_UNCERTAINTY"]
    derived["GTC_SAVE_OPTIONS"] = (
        64 * channels
        + 128 * uncertainty
        + 256 * terms
        + 4096 * retained
        + 8192 * options["GTC_WITH_REZERO"]
        + 65536 * options["GTC_MAX_SLOPE_BLOCKS"]
    )
    derived["GTC_SAVE_WORDS"] = (
        10
        + 2 * derived["GTC_WITH_TERMS"]
        + options["GTC_MAX_SLOPE_BLOCKS"]
        + derived["GTC_MAX_CHANNELS"] * (13 + channels)
        + 2 * terms * retained
        + uncertainty * (6 + 5 * derived["GTC_WITH_TERMS"])
        + 3 * options["GTC_WITH_REZERO"]
    )
    return derived


def runtime_texts(needs: Options, numerics: Collection[str]) -> dict[str, bytes]:
    """Return the files of the runtime by name.

    Args:
        needs: Options by name, as of `needs_of`.
        numerics: The arithmetics that it has.
    """
    options = {**needs, **{f"GTC_WITH_{n.upper()}": int(n in numerics) for n in NUMERICS}}
    options["GTC_WITH_REZERO"] &= options["GTC_WITH_UNCERTAINTY"]
    texts = _texts(runtime_folders(), tuple(sorted((options | _derived(options)).items())))
    return {name: text.encode("ascii") for name, text in texts.items()}


@functools.lru_cache(maxsize=8)
def _texts(folders: tuple[Path, Path], items: tuple[tuple[str, int], ...]) -> dict[str, str]:
    include_dir, libc_dir = folders
    options = dict(items)
    places = {path.name: path for folder in (libc_dir, include_dir) for path in folder.iterdir()}
    texts = {"gtc.h": _plain(_joined(places, "gtc.h", _constants(options)), options, {})}
    for arithmetic in NUMERICS:
        if options[f"GTC_WITH_{arithmetic.upper()}"]:
            names = _macros(places[f"gtc_names_{arithmetic}.h"].read_text(encoding="ascii"))
            own = {"HAS_SUM_LIMITS": int(names.pop("HAS_SUM_LIMITS").body)}
            name = f"gtc_{arithmetic}.c"
            text = _plain(_joined(places, name, '#include "gtc.h"\n'), options | own, names)
            texts[name] = _with_ranges_of(arithmetic, text)
    return texts


_RANGE = re.compile(r"^    (?P<range>\{[^{}]*\},) +/\* (?P<f32>.*?)(?:; q31: (?P<q31>.*?))? \*/$", re.MULTILINE)
_HEADING_OF_RANGES = re.compile(r"^    /\* +float32: least, most +fixed point: least, most \*/\n", re.MULTILINE)


def _with_ranges_of(arithmetic: str, text: str) -> str:
    """A text whose table of legal ranges speaks of one arithmetic alone, with its comments in a column."""

    def row(match: re.Match[str]) -> str:
        return f"    {match['range']:<42} /* {match[arithmetic] or match['f32']} */"

    return _RANGE.sub(row, _HEADING_OF_RANGES.sub("", text))


_PART_TEXTS = {"probes": "known answers", "narrow": "narrow Gaussians", "warm_up": "warm-up"}


def _constants(options: Options) -> str:
    """The sizes of this runtime, in place of the options of gtc_config.h."""
    held = [_PART_TEXTS.get(part, part) for part, option in _OF_PARTS.items() if options[option]]
    stated = " ".join(f"{name}={value}" for name, value in sorted(options.items()) if name in stated_names())
    lines = [
        "/* The sizes of this runtime, which gyrotc made for its tables from the sources with",
        *(f" * {line}" for line in textwrap.wrap(stated, 110)),
        " * and which has no options itself. */",
        f"#define GTC_MAX_SLOPE_BLOCKS {options['GTC_MAX_SLOPE_BLOCKS']}",
        f"#define GTC_MAX_TERMS {options['GTC_MAX_TERMS']}",
        f"#define GTC_MAX_CHANNELS {options['GTC_MAX_CHANNELS']}U",
        *_comment(f"Parts: {', '.join(held) or 'the map alone'}."),
        f"#define GTC_PARTS 0x{options['GTC_PARTS']:x}UL",
        "/* Which functions are declared below, for a program that has to know: 1, or 0. */",
        *(f"#define {name} {options[name]}" for name in _OF_FUNCTIONS),
    ]
    if options["GTC_WITH_Q31"]:
        lines.append(
            f"#define GTC_BIAS_FRAC_BITS {options['GTC_BIAS_FRAC_BITS']} /* fixed point: bias in 2^-this deg/h */"
        )
    if options["GTC_WITH_SAVE"]:
        lines.append(f"#define GTC_SAVE_WORDS {options['GTC_SAVE_WORDS']}")
        lines.append(f"#define GTC_SAVE_OPTIONS 0x{options['GTC_SAVE_OPTIONS']:x}UL /* layout of a saved state */")
    config = (runtime_folders()[0] / "gtc_config.h").read_text(encoding="ascii")
    if options["GTC_WITH_Q31"]:
        lines.append("\n" + _block(config, "GTC_HALF_MULTIPLY"))
    lines += ["\n" + _block(config, "GTC_ASSERT"), "\n" + _block(config, "GTC_MUST_CHECK")]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> list[str]:
    """Lines of a comment."""
    first, *more = textwrap.wrap(text, _LONGEST - 8)
    lines = [f"/* {first}", *(f" * {line}" for line in more)]
    return [*lines[:-1], f"{lines[-1]} */"]


def stated_names() -> set[str]:
    """Options from which a runtime can be made again."""
    return {"GTC_MAX_SLOPE_BLOCKS", "GTC_MAX_TERMS", "GTC_BIAS_FRAC_BITS", *_OF_PARTS.values(), *SWITCHES.values()}


_STATED = re.compile(r"\b(GTC_[A-Z0-9_]+)=([0-9]+)")


def _block(config: str, name: str) -> str:
    """The comment and the condition that define a name in gtc_config.h."""
    at = config.index(f"#define {name}")
    start = config.rindex("\n/*", 0, at) + 1
    end = config.index("\n\n", at)
    return config[start:end]


_INCLUDE = re.compile(r'^#include "(?P<name>gtc[a-z0-9_.]*)"$')


def _joined(places: Mapping[str, Path], name: str, first: str) -> list[str]:
    """Lines of a file and of those that it includes; `first` is in place of the options or of the header."""
    seen = {"gtc.h", "gtc_names_f32.h", "gtc_names_q31.h"}

    def lines_of(file: str, top: bool) -> Iterator[str]:
        text = places[file].read_text(encoding="ascii")
        yield from (_without_file_name(text, keep_licence=top)).splitlines()

    def expanded(file: str, top: bool) -> Iterator[str]:
        for line in lines_of(file, top):
            match = _INCLUDE.match(line)
            if match is None:
                yield line
            elif match["name"] == "gtc_config.h" or (match["name"] == "gtc.h" and file == "gtc_private.h"):
                yield from first.splitlines()
            elif match["name"] not in seen:
                seen.add(match["name"])
                yield from expanded(match["name"], False)

    return list(expanded(name, True))


_HEAD = re.compile(r"\A/\* (gtc[a-z0-9_.]*) - (.*?)\*/\n", re.DOTALL)
_OWN = re.compile(r"^ \* In the repository:.*?(?=^ \*$|^ \*/|\Z)", re.DOTALL | re.MULTILINE)
# REUSE-IgnoreStart
_LICENCE = " *\n * SPDX-License-Identifier: MIT\n"
# REUSE-IgnoreEnd


def _without_file_name(text: str, *, keep_licence: bool) -> str:
    """A file whose head does not speak of files that are not emitted."""
    match = _HEAD.match(text)
    if match is None:
        return text
    head = _OWN.sub("", match[2] if keep_licence else match[2].replace(_LICENCE, ""))
    head = re.sub(r" \*\n(?= \*\n| ?\Z)", "", head)
    rest = text[match.end() :]
    if keep_licence:
        return f"/* {match[1]} - {head}*/\n{rest}"
    return f"\n/* ==== {head[0].upper()}{head[1:].rstrip()} */\n{rest}"


_GUARD = "GTC_H_INCLUDED"  # of the one header that is emitted
_CONDITION = re.compile(r"^#\s*(if|ifdef|ifndef|elif|else|endif)\b(.*)$")
_WORD = re.compile(r"[A-Za-z_]\w*")


@dataclass(slots=True)
class _Level:
    """A conditional group: known when its condition consists of options, else it is written as it is."""

    known: bool
    active: bool  # its current branch is written
    taken: bool  # one of its branches was
    parent: bool


def _plain(lines: Sequence[str], options: Options, names: Mapping[str, _Macro]) -> str:
    text = "\n".join(_chosen(lines, options)) + "\n"
    text = _HEAD_OF_FUNCTION.sub(lambda match: re.sub(r"\n +", " ", match[0]), _expanded(text, names))
    text = re.sub(r"\n{3,}", "\n\n", text)
    text = re.sub(r"\{\n\n", "{\n", text)
    text = re.sub(r"\n\n(\s*\})", r"\n\1", text)
    return "".join(_wrapped(line) for line in text.splitlines())


def _chosen(lines: Iterable[str], options: Options) -> Iterator[str]:
    """Lines that the options leave; conditions on anything else stay."""
    levels: list[_Level] = []
    for line in lines:
        match = _CONDITION.match(line)
        active = levels[-1].active if levels else True
        if match is None:
            if (active and not re.match(r"^#define GTC_\w+_INCLUDED$", line)) or _GUARD in line:
                yield line
            continue
        word, condition = match[1], match[2].split("/*")[0].strip()
        if word in ("if", "ifdef", "ifndef"):
            holds = _holds(word, condition, options)
            levels.append(_Level(holds is not None, active and holds is not False, bool(holds), active))
        elif word in ("elif", "else"):
            level = levels[-1]
            if level.known:
                holds = True if word == "else" else _holds("if", condition, options)
                level.active = level.parent and not level.taken and bool(holds)
                level.taken = level.taken or bool(holds)
                continue
        else:
            level = levels.pop()
            if level.known or not level.parent:
                continue
            yield line
            continue
        if not levels[-1].known and levels[-1].parent:
            yield line


def _holds(word: str, condition: str, options: Options) -> bool | None:
    """Test a condition; None if it is not one on options alone."""
    if word in ("ifdef", "ifndef"):
        if not condition.endswith("_INCLUDED") or condition == _GUARD:
            return None
        return word == "ifndef"
    found = set(_WORD.findall(condition))
    if not found or not found <= set(options):
        return None
    text = _WORD.sub(lambda match: str(options[match[0]]), condition)
    text = text.replace("&&", " and ").replace("||", " or ")
    return bool(eval(re.sub(r"!(?!=)", " not ", text), {"__builtins__": {}}))  # numbers and operators only


@dataclass(frozen=True, slots=True)
class _Macro:
    parameters: tuple[str, ...] | None  # None: not a function
    body: str

    def expand(self, arguments: Sequence[str]) -> str:
        if self.parameters is None:
            return self.body
        values = dict(zip(self.parameters, arguments, strict=True))
        text = re.sub(r"(\w+)##(\w+)", lambda m: values.get(m[1], m[1]) + values.get(m[2], m[2]), self.body)
        return _WORD.sub(lambda match: values.get(match[0], match[0]), text)


# The parameters of a function are broken into lines anew, as other names have other lengths.
_HEAD_OF_FUNCTION = re.compile(
    r"^(?:static |int |const |GTC_MUST_CHECK )[^(){};=#/]*\([^(){};#/]*\)(?=;?$)", re.MULTILINE
)
_MACRO = re.compile(r"^#define (\w+)(?:\(([\w, ]*)\))?\s+(.*?)\s*(?:/\*.*)?$", re.MULTILINE)


def _macros(text: str) -> dict[str, _Macro]:
    """The names that a gtc_names_<n>.h defines."""
    return {
        name: _Macro(tuple(p.strip() for p in parameters.split(",")) if parameters else None, body)
        for name, parameters, body in _MACRO.findall(text)
    }


_COMMENT = re.compile(r'(/\*.*?\*/|"[^"\n]*")', re.DOTALL)


def _expanded(text: str, names: Mapping[str, _Macro]) -> str:
    """Text with these names replaced, but for comments."""
    if not names:
        return text
    parts = _COMMENT.split(text)
    parts[::2] = [_replaced(code, names) for code in parts[::2]]
    return "".join(parts)


def _replaced(code: str, names: Mapping[str, _Macro]) -> str:
    word = re.compile(r"\b(" + "|".join(names) + r")\b")
    done, rest = [], code
    while match := word.search(rest):
        macro = names[match[1]]
        done.append(rest[: match.start()])
        rest = rest[match.end() :]
        arguments: list[str] = []
        if macro.parameters is not None:
            arguments, rest = _arguments(rest)
        rest = macro.expand(arguments) + rest
    return "".join([*done, rest])


def _arguments(text: str) -> tuple[list[str], str]:
    """Arguments of a macro whose opening parenthesis begins the text, and what follows the closing one."""
    depth, start = 0, 1
    found = []
    for k, char in enumerate(text):
        depth += (char in "([{") - (char in ")]}")
        if depth == 0 or (depth == 1 and char == ","):
            found.append(text[start:k].strip())
            start = k + 1
        if depth == 0:
            return found, text[k + 1 :]
    raise ValueError(text[:80])


def _wrapped(line: str) -> str:
    """A line of code that became too long is broken behind a comma or before an operator."""
    indent: Callable[[str], int] = lambda text: len(text) - len(text.lstrip())  # noqa: E731
    if len(line) <= _LONGEST or line.lstrip().startswith(("/*", "*", "#")) or "/*" in line:
        return line + "\n"
    breaks = [m.end() for m in re.finditer(r", | (?=\|\| |&& |\? )", line[: _LONGEST + 1])]
    if not breaks:
        return line + "\n"
    first, rest = line[: breaks[-1]].rstrip(), line[breaks[-1] :].lstrip()
    stack: list[int] = []
    for k, char in enumerate(first):
        if char in "({":
            stack.append(k + 1)
        elif char in ")}" and stack:
            stack.pop()
    column = stack[-1] if stack else indent(line) + 4
    return first + "\n" + _wrapped(" " * column + rest)
