"""Pages made from the code: reference-{c,cli,schemas,python}.md.

    python tools/reference.py OUT

writes them into a folder. They are no part of the sources: the site (tools/site_pages.py) and the archives
(tools/archives.py) have them.

    python tools/reference.py --packages

writes the table of packages into docs/design.md.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: Results whose objects are reported in the tables of another result on the page.
REPORTED_BY = {"entry": "fleet", "verify-axes": "verify"}
#: Modules that may be imported by users' programs; they alone have an `__all__`.
PYTHON = (
    "model", "recordings.loading", "recordings.records", "train.methods", "train.fitting", "tables.quantisation",
    "tables.emission", "mirror.history", "verify.job", "assess.evaluation", "diagnose.diagnosis", "diagnose.series",
    "simulate.data_set", "common.metrics", "common.errors",
)  # fmt: skip
_C_PART = re.compile(
    r"/\* (?P<text>(?:(?!\*/).)*?) ?\*/\n(?P<code>(?:GTC_MUST_CHECK int gtc_\w+\([^;]*;\n)+)", re.DOTALL
)


def c_page() -> str:
    """Every function of gtc.h with its comment."""
    header = re.sub(r"^#.*\n", "", (ROOT / "include" / "gtc.h").read_text("ascii"), flags=re.MULTILINE)
    parts = [
        "# C reference\n",
        "Made from `include/gtc.h` by `tools/reference.py`; there stand the types, too.\n",
    ]
    for part in _C_PART.finditer(header):
        names = re.findall(r"int gtc_f32_(\w+)\(", part["code"])
        if not names:
            continue
        text = "\n".join(re.sub(r"^ \* ?", "", line) for line in part["text"].splitlines())
        parts += [f"## {', '.join(f'gtc_<n>_{name}' for name in names)}\n"]
        parts += [
            f"```c\n{part['code'].replace('GTC_MUST_CHECK ', '')}```\n",
            f"```text\n{text.strip()}\n```\n",
        ]
    return "\n".join(parts)


def cli_page() -> str:
    """Every command with its arguments and options."""
    from gyrotc.cli.main import application
    from typer.main import get_command

    parts = [
        "# Command line reference\n",
        "Made from the commands by `tools/reference.py`; `gyrotc COMMAND --help` says the same.\n",
    ]
    commands: dict[str, Any] = get_command(application()).commands  # type: ignore[attr-defined]
    for name, command in sorted(commands.items()):
        text = inspect.cleandoc(command.help or "")
        parts += [
            f"## gyrotc {name}\n",
            re.sub(r"\nExample: (.*)$", r"\n`\1`", text, flags=re.MULTILINE) + "\n",
        ]
        parts += ["| argument or option | default | meaning |", "| --- | --- | --- |"]
        parts += [_option(parameter) for parameter in command.params if parameter.name != "help"]
        parts.append("")
    return "\n".join(parts)


def _option(parameter: Any) -> str:
    shown = ", ".join(f"`{o}`" for o in parameter.opts if o.startswith("-")) or f"`{parameter.name}`"
    default = parameter.default
    said = (
        ""
        if default is None or isinstance(default, bool | tuple) or callable(default) or parameter.required
        else f"`{default}`"
    )
    return f"| {shown} | {said} | {_cell(getattr(parameter, 'help', None) or '')} |"


def _cell(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|").strip()


def schemas_page() -> str:
    """Every result with the tables of its fields."""
    from gyrotc.cli.schema import kinds, tables

    parts = [
        "# JSON reference\n",
        "Made from the schemas by `tools/reference.py`; `gyrotc schema NAME --table` prints the same.",
        "[Formats](FORMAT.md) has what a schema cannot state.\n",
    ]
    for name, kind in kinds().items():
        other = REPORTED_BY.get(name)
        parts += [f"## {name}\n", inspect.cleandoc(kind.__doc__ or "") + "\n"]
        parts.append(tables(kind, [kinds()[other]] if other else []))
    return "\n".join(parts)


def python_page() -> str:
    """Every public name of the modules above with its signature and documentation."""
    parts = ["# Python reference\n", "Made from the docstrings by `tools/reference.py`.\n"]
    for dotted in PYTHON:
        module = importlib.import_module(f"gyrotc.{dotted}")
        parts += [f"## gyrotc.{dotted}\n", inspect.cleandoc(module.__doc__ or "") + "\n"]
        for name in sorted(module.__all__):
            parts += _documented(name, getattr(module, name))
    return "\n".join(parts)


def _documented(name: str, thing: Any) -> Iterator[str]:
    """Heading, signature and docstring; constants are named."""
    yield f"### {name}\n"
    if inspect.isclass(thing) or inspect.isroutine(thing):
        if inspect.isroutine(thing):
            signature = re.sub(r"<(\w+) (?:<\w+>|[^<>])*>", r"<\1>", str(inspect.signature(thing)))
            yield f"```python\n{name}{signature}\n```\n"
        text = inspect.cleandoc(thing.__doc__ or "")
        if text and not text.startswith(f"{name}("):  # a dataclass without words of its own
            yield f"```text\n{text}\n```\n"
    else:
        yield "A constant or a type.\n"


#: Where docs/design.md has the table of packages.
PACKAGES = re.compile(r"(?<=<!-- packages -->\n).*?(?=<!-- /packages -->)", re.DOTALL)


def packages() -> str:
    """Return a table of the packages in the order of gen/pyproject.toml, with their docstrings."""
    (layers,) = re.findall(r"^layers = \[(.*?)^\]", (ROOT / "gen" / "pyproject.toml").read_text("utf-8"), re.M | re.S)
    lines = ["| package | contents |", "| --- | --- |"]
    for level in re.findall(r'"([^"]+)"', layers):
        for name in level.split(" | "):
            place = ROOT / "gen" / "gyrotc" / name
            file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            text = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n\n")[0]
            lines.append(f"| `{name}` | {_cell(text)} |")
    return "\n".join(lines) + "\n"


PAGES = {
    "reference-c.md": c_page,
    "reference-cli.md": cli_page,
    "reference-python.md": python_page,
    "reference-schemas.md": schemas_page,
}


def write(out: Path, python: str | Path = sys.executable) -> None:
    """All pages into a folder, by a Python that has what gyrotc needs."""
    subprocess.run([python, Path(__file__).resolve(), out], check=True)


def main() -> int:
    """Writes the pages from the sources beside this file, whichever are installed: of these only the core is taken."""
    parser = argparse.ArgumentParser(prog="tools/reference.py", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, nargs="?")
    parser.add_argument("--packages", action="store_true", help="write the table of packages into docs/design.md")
    given = parser.parse_args()
    if given.packages:
        page = ROOT / "docs" / "design.md"
        page.write_text(PACKAGES.sub(lambda _: packages(), page.read_text("utf-8")), "utf-8")
        return 0
    out = given.out or parser.error("a folder, or --packages")
    sys.path.insert(0, str(ROOT / "gen"))
    sys.meta_path.sort(key=lambda finder: "gyrotc" in type(finder).__module__)
    out.mkdir(parents=True, exist_ok=True)
    for name, made in PAGES.items():
        (out / name).write_text(made().rstrip() + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
