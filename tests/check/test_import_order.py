"""Scripts import modules that exist, and a name of a class means one thing.

The order of the packages is a contract in gen/pyproject.toml, which `make check` holds the package against.
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "gen" / "gyrotc"


def _exists(module: str) -> bool:
    path = PACKAGE.joinpath(*module.split(".")[1:])
    return module == "gyrotc._core" or path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def test_what_stands_beside_the_package_imports_modules_that_are_there() -> None:
    """Much of it runs in an hour of `make bench` or `make blind` only: a module that moved must not wait for that."""
    root = PACKAGE.parents[1]
    for path in (p for folder in ("tests", "bench", "tools", "examples") for p in (root / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for module in (m for m in found if m.split(".")[0] == "gyrotc"):
                assert _exists(module), f"{path.relative_to(root)}:{node.lineno} imports {module}"


#: Classes that have one name on purpose, with the reason.
_SAME = {
    "Dataset": "api.py has that of recordings/records.py with what users of Python ask of it besides",
    "Points": "mirror/f32.py and mirror/q31.py say the same in either arithmetic",
    "Result": "what gyrotc.build gives users of Python, and a file of JSON",
}


def _classes() -> dict[str, list[str]]:
    """Modules by the name of every public class that they define."""
    found: dict[str, list[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(str(path.relative_to(PACKAGE)))
    return found


def test_a_name_of_a_class_means_one_thing() -> None:
    found = _classes()
    assert len(found) > 150
    twice = {name: where for name, where in found.items() if len(where) > 1 and name not in _SAME}
    assert twice == {}, "give one of them a name of its own"
    assert all(len(found[name]) > 1 for name in _SAME), "no longer there twice"
