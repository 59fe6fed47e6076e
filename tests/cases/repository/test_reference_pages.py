"""Reference pages made from the code are whole and the same every time, and the site has every page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import reference
from conftest import ROOT
from gyrotc.cli.main import application
from gyrotc.cli.schema import kinds, tables
from gyrotc.verify import PUBLIC
from typer.main import get_command


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reference")
    reference.write(folder)
    return folder


def _headings(page: Path, level: int = 2) -> list[str]:
    return re.findall(rf"^{'#' * level} (.+)$", page.read_text("utf-8"), re.MULTILINE)


def test_pages_are_the_same_every_time(made: Path) -> None:
    """In another process, where hashes of texts and places of objects in memory differ."""
    assert {page.name for page in made.iterdir()} == set(reference.PAGES)
    for name, page in reference.PAGES.items():
        assert (made / name).read_text("utf-8") == page().rstrip() + "\n", name


def test_every_public_function_of_c_has_its_heading(made: Path) -> None:
    named = [name for heading in _headings(made / "reference-c.md") for name in re.findall(r"gtc_<n>_(\w+)", heading)]
    assert sorted([*named, "map"]) == sorted(PUBLIC), "the map is for tests"


def test_every_command_has_its_heading(made: Path) -> None:
    commands = get_command(application()).commands  # type: ignore[attr-defined]
    assert _headings(made / "reference-cli.md") == [f"gyrotc {name}" for name in sorted(commands)]


def test_every_result_has_its_heading_and_its_table(made: Path) -> None:
    assert _headings(made / "reference-schemas.md") == list(kinds())
    text = (made / "reference-schemas.md").read_text("utf-8")
    for name, kind in kinds().items():
        assert tables(kind).split("\n\n")[0].strip() in text, name


def test_every_public_name_of_python_has_its_heading(made: Path) -> None:
    """Of the modules that programs may import; `__all__` of each."""
    assert _headings(made / "reference-python.md") == [f"gyrotc.{name}" for name in reference.PYTHON]
    names = set(_headings(made / "reference-python.md", 3))
    assert {"Model", "load_model", "emit", "InputError"} <= names


def test_the_formats_list_every_result_with_its_schema() -> None:
    text = (ROOT / "docs" / "FORMAT.md").read_text("utf-8")
    listed: dict[str, str] = {}
    for names, schemas in re.findall(
        r"^\| (`[\w-]+`(?:, `[\w-]+`)*) \| ((?:`gyrotc[^|]+|none)) \|", text, re.MULTILINE
    ):
        numbers = re.findall(r"`([^`]+)`", schemas) or [""]
        ids = re.findall(r"`([^`]+)`", names)
        listed |= dict(zip(ids, numbers if len(numbers) > 1 else numbers * len(ids), strict=True))
    fields = {name: kind.model_json_schema(by_alias=True)["properties"] for name, kind in kinds().items()}
    assert listed == {name: field.get("schema", {"const": ""})["const"] for name, field in fields.items()}


def test_the_packages_of_the_design_are_those_of_the_sources() -> None:
    """`python tools/reference.py --packages` writes them."""
    found = reference.PACKAGES.search((ROOT / "docs" / "design.md").read_text("utf-8"))
    assert found is not None and found[0] == reference.packages()


def test_the_site_has_every_page() -> None:
    """A page that stands in no list of the site is found by nobody."""
    text = (ROOT / "docs" / "mkdocs.yml").read_text("utf-8")
    listed = set(re.findall(r": ([\w/-]+\.md)$", text, re.MULTILINE))
    pages = {p.relative_to(ROOT / "docs").as_posix() for p in (ROOT / "docs").rglob("*.md")}
    decisions = {p for p in pages if re.match(r"adr/\d", p)}  # listed by adr/README.md
    assert listed == (pages | set(reference.PAGES)) - decisions
