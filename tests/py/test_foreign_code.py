"""Nobody's recordings, models or folders run code on the machine that builds or verifies them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from emitted import emitted
from gyrotc.model import Model
from gyrotc.verify import verify

FAST = "host-gcc-O2"


def touching(path: Path) -> str:
    """C that closes a comment, declares `system` and calls it before `main`; then opens a comment again."""
    run = f'static void f(void){{(void)!system("touch {path}");}}'
    return f"*/int system(const char*); __attribute__((constructor)) {run}/*"


FIELDS = {
    "a warning of the recordings": lambda code: {
        "warnings": [f"channel {code} is left out: b.csv has no such column"]
    },
    "a value of [meta]": lambda code: {"operator": code},
    "a key of [meta]": lambda code: {code: "x"},
    "keys of [meta] one after another": lambda code: {
        f"k{i}*/": part for i, part in enumerate(code.split(";"))
    },
}


@pytest.mark.parametrize("field", FIELDS)
def test_text_of_a_recording_does_not_become_code(
    field: str, model_dict: dict[str, Any], tmp_path: Path
) -> None:
    for name in ("a", "aaaaaaaaaaaaaaaaaaaa"):
        target = Path("/tmp") / f"gyrotc-test-{name}"
        target.unlink(missing_ok=True)
        model = Model.from_dict(model_dict | {"meta": FIELDS[field](touching(target))})
        result = verify(emitted(tmp_path / name, model), targets=[FAST])
        assert not target.exists(), "the recording's code was run"
        assert result["failed"] == 0, result["targets"]
