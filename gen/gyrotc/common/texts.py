"""Make safe C, HTML, SVG, TOML, CSV, file names and terminal lines of the text of users and files.

Nothing else builds such text. Each kind has an allow-list; what is not on it is shown as `<U+00E4>`: visible,
recognisable, and without a meaning to whatever reads the result. Names of columns, entries of `[meta]`, warnings and
findings come from whoever made a recording, so all of them are foreign.

The templates for C take nothing but whole numbers, words and `CText`, so a forgotten filter stops the emission
instead of writing a foreign unit's code; those for HTML escape, and take as it is only what `checked_svg` returned.
"""

from __future__ import annotations

import hashlib
import json
import math
import operator
import re
from collections.abc import Callable, Iterable
from datetime import date, datetime, time
from typing import TYPE_CHECKING, Any, SupportsIndex
from xml.etree import ElementTree

if TYPE_CHECKING:
    import jinja2
    from markupsafe import Markup

_LINE = 1000  # characters of one line of a comment, once escaped
_TITLE = 80  # characters over one panel of a picture
_STEM = 180  # bytes of a file name made of foreign text; names end at 255


def _shown(text: str, allowed: Callable[[str, str], bool], limit: int | None = None) -> str:
    """The text with every character that is not `allowed` (after the one written before it) as <U+....>."""
    parts: list[str] = []
    room = math.inf if limit is None else limit - len("...")
    before = ""
    for char in text:
        part = char if allowed(char, before) else f"<U+{ord(char):04X}>"
        room -= len(part)
        if room < 0:
            return "".join(parts) + "..."
        parts.append(part)
        before = part[-1]
    return "".join(parts)


# ---- C ----


class CText(str):
    """Text that is safe in C where the templates put it. Only functions of this module make it."""

    __slots__ = ()


#: What a comment of an emitted file may hold: printable ASCII that cannot end it, open one or splice lines.
C_COMMENT = re.compile(r"(?:(?!\*/|/\*|\?\?|\\)[ -~])*")

_NUMBER = r"-?[0-9]{1,10}(?:\.[0-9]{1,12})?(?:e[+-][0-9]{1,3})?"
_CELL = (
    rf"(?:V\({_NUMBER}F\)|B\(0x[0-9a-f]{{1,8}}UL\)|0x[0-9a-f]{{8}}UL|{_NUMBER}(?:UL|L|F)?|\(-2147483647L - 1L\)"
    r"|NULL|(?:f32|q31)_[a-z]{1,10})"
)
#: What initialises a member or a row of a table: numbers, and the names that a table refers to.
C_INITIALISER = re.compile(rf"{_CELL}(?:, {_CELL})*|\{{ {_CELL}(?:, {_CELL})* \}}")
_WORD = re.compile(r"[A-Za-z0-9_]*")
_PAIRS = {"*/", "/*", "??"}


def c_comment(text: str, limit: int = _LINE) -> CText:
    """Text within a line of a C comment: printable ASCII without `*/`, `/*`, `??`, backslash or line breaks."""
    if len(text) <= limit - len("...") and C_COMMENT.fullmatch(text):
        return CText(text)

    def allowed(char: str, before: str) -> bool:
        return " " <= char <= "~" and char != "\\" and before + char not in _PAIRS

    return CText(_shown(text, allowed, limit))


def c_literal(text: str) -> CText:
    """Text between the quotes of a C string: as in a comment, without quotes, question marks and `%`."""
    return CText(_shown(text, lambda char, _: " " <= char <= "~" and char not in '\\"?%', 64))


def c_code(text: str) -> CText:
    """Numbers and names that initialise a member or a row of a table.

    Raises:
        ValueError: It is anything else: a fault of the caller.
    """
    if not C_INITIALISER.fullmatch(text):
        raise ValueError(f"not an initialiser of a table: {text[:80]!r}")
    return CText(text)


def c_environment(compiled: jinja2.BytecodeCache | None = None) -> jinja2.Environment:
    """Return the templates of C, with the filters `comment` for text, `hex32` and `tenths`.

    Args:
        compiled: Keeps the compiled templates.
    """
    import jinja2

    def only_c(value: Any) -> Any:
        return value if isinstance(value, jinja2.Undefined) else _only_c(value)  # jinja2 says which name it is

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("gyrotc", "tables/templates"),
        bytecode_cache=compiled,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # that is HTML's; here `finalize` lets nothing through
        finalize=only_c,
    )
    environment.filters.update(
        comment=lambda value: c_comment(str(value)),
        hex32=lambda value: CText(f"0x{int(value):08x}UL"),
        tenths=lambda value: CText(f"{float(value):.1f}"),
    )
    return environment


def _only_c(value: Any) -> Any:
    """Refuse values of a C template's expressions that are no C text.

    Raises:
        ValueError: Text that went through no function of this module.
    """
    if type(value) is int:  # most are, and what else is a whole number takes long to tell
        return value
    if isinstance(value, CText) or (isinstance(value, str) and _WORD.fullmatch(value)):
        return value
    if isinstance(value, SupportsIndex) and not isinstance(value, bool):
        return operator.index(value)
    raise ValueError(f"text that nothing made safe for C: {str(value)[:80]!r}")


# ---- HTML and SVG ----


def html_environment(
    compiled: jinja2.BytecodeCache | None = None, /, **filters: Callable[..., str]
) -> jinja2.Environment:
    """Return the templates of pages: everything is escaped but what `checked_svg` returned.

    Args:
        compiled: Keeps the compiled templates.
        filters: By name, besides those of jinja2.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("gyrotc", "pages/templates"),
        bytecode_cache=compiled,
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=_only_html,
    )
    environment.filters.update(filters)
    return environment


def _only_html(value: Any) -> Any:
    """Text without what no page can show; markup as it is."""
    return terminal_text(value) if isinstance(value, str) and not hasattr(value, "__html__") else value


def picture_text(text: str) -> str:
    """Text in a picture: one line, no control characters."""
    return _shown(text, lambda char, _: char.isprintable(), _TITLE)


_SVG = "{http://www.w3.org/2000/svg}"
_DRAWN = frozenset(
    _SVG + name
    for name in (
        "svg", "g", "defs", "metadata", "path", "rect", "clipPath", "pattern", "text", "title", "image", "style",
    )
)  # fmt: skip
_FACTS = (
    "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}",
    "{http://purl.org/dc/elements/1.1/}",
    "{http://creativecommons.org/ns#}",
)
_LINK = re.compile(r"#[\w.-]+|data:image/png;base64,[A-Za-z0-9+/=\s]*")
_REFERENCES = re.compile(r"url\((?!#[\w.-]+\))|@import|expression|javascript", re.IGNORECASE)


def checked_svg(text: str) -> Markup:
    """An `<svg>` element as markup for a page, once it is seen to do nothing but draw.

    Raises:
        ValueError: It is no SVG, or holds anything but shapes, text and pictures of its own.
    """
    from markupsafe import Markup

    if not text.startswith("<svg") or "<!" in text or "<?" in text:
        raise ValueError("is no plain svg element")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise ValueError(f"is no SVG ({error})") from error
    for element in root.iter():
        if element.tag not in _DRAWN and not element.tag.startswith(_FACTS):
            raise ValueError(f"holds the element {element.tag.rpartition('}')[2]!r}")
        for name, value in element.attrib.items():
            local = name.rpartition("}")[2].lower()
            if local.startswith("on") or (local == "href" and not _LINK.fullmatch(value)):
                raise ValueError(f"holds the attribute {local!r}")
            if _REFERENCES.search(value):
                raise ValueError(f"refers to something else in {local!r}")
        if element.tag == _SVG + "style" and _REFERENCES.search(element.text or ""):
            raise ValueError("refers to something else in its style")
    return Markup(text)


def pictures_in_rows(pictures: Iterable[str], kind: str) -> Markup:
    """Elements of `checked_svg` beside each other where there is room; `kind`: a class of the style sheet.

    Raises:
        ValueError: One is anything else.
    """
    from markupsafe import Markup

    checked = [checked_svg(str(picture)) for picture in pictures]
    return Markup('<div class="panels {}">').format(kind) + Markup("").join(checked) + Markup("</div>")


# ---- TOML, CSV, file names, terminals ----


def toml_key(key: str) -> str:
    """A key of TOML: bare where it can be."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _toml_text(key)


def toml_value(value: Any) -> str:
    """A value of TOML: text, numbers, truth values, dates, lists and tables of them.

    Raises:
        ValueError: TOML has no such value.
    """
    if isinstance(value, str):
        return _toml_text(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, float):
        return repr(float(value))  # nan and inf are TOML's own words
    if isinstance(value, SupportsIndex):
        return str(operator.index(value))
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_key(str(k))} = {toml_value(v)}" for k, v in value.items()) + "}"
    raise ValueError(f"TOML has no value for {type(value).__name__}")


def _toml_text(text: str) -> str:
    """A basic string: JSON's escapes are TOML's, but for DEL, and for surrogates, which TOML cannot say at all."""
    plain = "".join(f"<U+{ord(c):04X}>" if "\ud800" <= c <= "\udfff" else c for c in text)
    return json.dumps(plain, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_comment(text: str, limit: int = _LINE) -> str:
    """Text behind a `#`: one line."""
    return _shown(text, lambda char, _: char.isprintable(), limit)


def csv_cell(value: Any) -> Any:
    """A cell that a spreadsheet shows and does not compute: no formula, no control characters."""
    if not isinstance(value, str):
        return value
    text = terminal_text(value)
    return "'" + text if text[:1] in tuple("=+-@\t\n") else text


def file_stem(text: str) -> str:
    """Text as a file's name without its end: letters, digits, blanks and `._-@+`; else `_`, and its hash behind it."""
    plain = "".join(c if c.isalnum() or c in "._-@+ " else "_" for c in text)
    plain = "_" + plain[1:] if plain[:1] in ("", ".", "-", " ") else plain
    plain = plain.encode("utf-8")[:_STEM].decode("utf-8", "ignore")
    if plain == text:
        return plain
    return f"{plain}-{hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}"


def terminal_text(text: str) -> str:
    """Text that is shown as it is: nothing in it moves a cursor, colours, or turns the direction of writing."""
    return text if text.isprintable() else _shown(text, lambda char, _: char.isprintable() or char in "\n\t\xa0")


def terminal_line(text: str) -> str:
    """Return `terminal_text` in one line: a name with a line break in it cannot pass for a second message."""
    return text if text.isprintable() else _shown(text, lambda char, _: char.isprintable() or char == "\xa0")
