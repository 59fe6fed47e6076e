"""What a result file holds is read back as it is or refused; a changed byte of a delivery is seen."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import run_gyrotc
from drawn import examples
from emitted import emitted
from gyrotc.cli.schema import kinds
from gyrotc.common import InputError
from gyrotc.results import checked_result
from hypothesis import assume, given
from hypothesis import strategies as st

_RESULTS = {"training.json": "training", "evaluate.json": "evaluate", "verify.json": "verify", "budget.json": "budget"}
_VALUES = (
    st.none()
    | st.booleans()
    | st.integers(-(2**62), 2**62)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=20)
    | st.just([])
    | st.just({})
)
_JSON = st.recursive(_VALUES, lambda inner: st.lists(inner, max_size=3), max_leaves=4)


def _leaves(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all values within lists and objects, those of two entries of a list at most."""
    if isinstance(node, dict | list) and node:
        entries = node.items() if isinstance(node, dict) else enumerate(node[:2])
        for key, value in entries:
            yield from _leaves(value, (*path, key))
    elif path:
        yield path


@pytest.mark.parametrize("file", _RESULTS)
@examples(150)
@given(data=st.data())
def test_a_result_is_read_back_as_it_is_written_or_refused(file: str, data: st.DataObject, demo: Path) -> None:
    """With any value at any place of a real result: none is changed, rounded or left out in silence."""
    text = (demo / "result" / file).read_text("utf-8")
    content, kind = json.loads(text), kinds()[_RESULTS[file]]
    assert checked_result(json.loads(text), kind, file).content() == content  # type: ignore[type-var,attr-defined]
    path = data.draw(st.sampled_from(list(_leaves(content))))
    changed = copy.deepcopy(content)
    node = changed
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = data.draw(_JSON)
    try:
        again = checked_result(json.loads(json.dumps(changed)), kind, file)  # type: ignore[type-var]
    except InputError as refusal:
        assert file in str(refusal) and "\n" not in str(refusal)
    else:
        assert json.loads(json.dumps(again.content())) == changed  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return emitted(tmp_path_factory.mktemp("delivery"))


@examples(25, shrink=False)
@given(data=st.data())
def test_verify_refuses_any_changed_byte_of_what_is_delivered(data: st.DataObject, delivery: Path) -> None:
    """Every file of c/ but the example, and model.json; white space in place of white space may stay. It is named."""
    files = sorted(path for path in (delivery / "c").iterdir() if path.suffix in (".c", ".h", ".bin", ".json"))
    files = [path for path in files if path.name != "main.c"]
    path = data.draw(st.sampled_from([delivery / "model.json", *files]))
    content = path.read_bytes()
    at, bits = data.draw(st.integers(0, len(content) - 1)), data.draw(st.integers(1, 255))
    changed = bytearray(content)
    changed[at] ^= bits
    assume(bytes(changed).split() != content.split())
    path.write_bytes(changed)
    try:
        done = run_gyrotc("verify", delivery, "--target", "host-gcc-O2")
    finally:
        path.write_bytes(content)
    assert done.returncode in (1, 2), (path.name, at, bits, done.stdout)
    assert path.name in done.stdout + done.stderr


def test_verify_takes_what_is_delivered(delivery: Path, tmp_path: Path) -> None:
    shutil.copytree(delivery, tmp_path / "copy")
    done = run_gyrotc("verify", tmp_path / "copy", "--target", "host-gcc-O2")
    assert done.returncode == 0, done.stderr
