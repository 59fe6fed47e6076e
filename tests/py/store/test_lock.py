"""The lock file of the developers' environment: whole, by hashes, and of what gen/pyproject.toml asks for."""

from __future__ import annotations

import re
import sys

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TEXT = (ROOT / "gen" / "requirements.lock").read_text("utf-8")
_ENTRY = re.compile(
    r"^(?P<pin>[\w.\[\]-]+==[^\\\n]+?) ?\\\n(?P<hashes>(?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)",
    re.MULTILINE,
)


def _pins() -> dict[str, list[Requirement]]:
    found: dict[str, list[Requirement]] = {}
    for entry in _ENTRY.finditer(TEXT):
        pin = Requirement(entry["pin"])
        found.setdefault(canonicalize_name(pin.name), []).append(pin)
    return found


def _asked() -> list[Requirement]:
    """What the project, its tests and its build ask for, extras of its own resolved."""
    with (ROOT / "gen" / "pyproject.toml").open("rb") as file:
        data = tomllib.load(file)
    extras = data["project"]["optional-dependencies"]
    words = [*data["project"]["dependencies"], *extras["test"], *data["build-system"]["requires"]]
    own = [Requirement(word) for word in words if word.startswith("gyrotc")]
    words += [word for requirement in own for extra in requirement.extras for word in extras[extra]]
    return [Requirement(word) for word in words if not word.startswith("gyrotc")]


def test_every_line_is_a_pin_with_hashes() -> None:
    rest = _ENTRY.sub("", TEXT)
    assert [line for line in rest.splitlines() if line and not line.startswith("#")] == []
    assert "://" not in TEXT, "no place that packages come from"


@pytest.mark.parametrize("python", ["3.10", "3.11", "3.12", "3.13"])
def test_every_python_has_one_version_of_what_is_asked_for(python: str) -> None:
    """`make lock` writes it anew after a change of gen/pyproject.toml."""
    machine = {"python_version": python, "python_full_version": f"{python}.0", "sys_platform": "linux"}
    pins = _pins()
    for asked in _asked():
        if asked.marker is not None and not asked.marker.evaluate(machine):
            continue
        found = [
            pin
            for pin in pins.get(canonicalize_name(asked.name), [])
            if pin.marker is None or pin.marker.evaluate(machine)
        ]
        assert len(found) == 1, f"{asked}: {found}"
        version = str(found[0].specifier).removeprefix("==")
        assert asked.specifier.contains(version), f"{asked}: the lock has {version}"
