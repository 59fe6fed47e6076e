"""Templates that are compiled once, and again if what was kept is damaged or of other programs."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import jinja2
import pytest
from gyrotc.results import c_templates, cache


def _text() -> str:
    """Return what a template renders, loaded as a new process does."""
    c_templates.cache_clear()
    template = c_templates().get_template("footprint.c.j2")
    return template.render(id="a", symbol="a", n="f32", n_channels=1, period_us=10)


@pytest.fixture
def compilations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the templates that are compiled, with an empty cache to begin with."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    names: list[str] = []
    compiled = jinja2.Environment.compile

    def counted(self: jinja2.Environment, source: str, name: str, filename: str) -> object:
        names.append(name)
        return compiled(self, source, name, filename)

    monkeypatch.setattr(jinja2.Environment, "compile", counted)
    return names


def test_a_template_is_compiled_once(compilations: list[str]) -> None:
    first = _text()
    assert compilations == ["footprint.c.j2"]
    assert _text() == first
    assert compilations == ["footprint.c.j2"]


def test_a_damaged_template_is_compiled_again(compilations: list[str]) -> None:
    first = _text()
    (kept,) = cache.folder().glob("*.template")
    kept.write_bytes(kept.read_bytes()[:-1])
    assert _text() == first
    assert compilations == ["footprint.c.j2"] * 2


def test_a_template_of_another_python_is_compiled_again(compilations: list[str]) -> None:
    first = _text()
    (kept,) = cache.folder().glob("*.template")
    cache.keep(kept.name, b"another magic number, then code")
    assert _text() == first
    assert compilations == ["footprint.c.j2"] * 2


def test_a_template_of_another_jinja2_is_compiled_again(
    compilations: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = _text()
    monkeypatch.setattr(metadata, "version", lambda name: f"another {name}")
    assert _text() == first
    assert compilations == ["footprint.c.j2"] * 2
