"""What gyrotc loads is what its plain installation brings; extras are loaded where they are used.

The lock file of the developers' environment is whole, by hashes, and of what gen/pyproject.toml asks for.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PACKAGE = ROOT / "gen" / "gyrotc"
PROJECT = tomllib.loads((ROOT / "gen" / "pyproject.toml").read_text("utf-8"))["project"]
#: Distributions by the name of what is imported; a part of pydantic with a name of its own comes with it.
DISTRIBUTIONS = packages_distributions() | {"pydantic_core": ["pydantic"]}
#: Modules that are one extra's, and are loaded where it is asked for.
OF_EXTRA = {"train/estimator.py": "sklearn", "paper/experiment.py": "paper"}


def _named(requirements: list[str]) -> set[str]:
    return {canonicalize_name(Requirement(word).name) for word in requirements}


def _loaded(path: Path) -> set[str]:
    """Distributions of other projects that a module imports when it is itself imported."""
    tree = ast.parse(path.read_text("utf-8"))
    nodes = [n for top in tree.body if not isinstance(top, ast.If) for n in _outside_functions(top)]
    roots = {a.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for a in n.names}
    roots |= {str(n.module).split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom) and not n.level}
    return {
        canonicalize_name(DISTRIBUTIONS[root][0])
        for root in roots - set(sys.stdlib_module_names)
        if root in DISTRIBUTIONS
    }


def _outside_functions(node: ast.AST) -> list[ast.AST]:
    if isinstance(node, ast.FunctionDef):
        return []
    return [node, *(n for child in ast.iter_child_nodes(node) for n in _outside_functions(child))]


def test_the_plain_installation_has_what_modules_import() -> None:
    plain = _named(PROJECT["dependencies"])
    for path in PACKAGE.rglob("*.py"):
        extra = OF_EXTRA.get(path.relative_to(PACKAGE).as_posix())
        more = _named(PROJECT["optional-dependencies"][extra]) if extra else set()
        assert _loaded(path) <= plain | more, path


def test_every_dependency_is_imported_somewhere() -> None:
    text = "\n".join(path.read_text("utf-8") for path in PACKAGE.rglob("*.py"))
    for name in _named(PROJECT["dependencies"]):
        module = name.replace("-", "_")
        assert re.search(rf"(?m)^\s*(?:from|import) {module}\b", text), name


def test_the_main_job_loads_no_extra() -> None:
    extras = {
        "matplotlib",
        "PIL",
        "sklearn",
        "distributed",
        "h5py",
        "nptdms",
    }
    program = (
        "import sys, gyrotc.jobs.calibration, gyrotc.jobs.diagnosis, gyrotc.fleet.run, gyrotc.pages.report\n"
        f"sys.exit(' '.join({extras} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "", done.stderr


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
