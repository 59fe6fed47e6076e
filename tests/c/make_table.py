"""Writes the table that the C tests use; run it again after a change of layout or rounding."""

from __future__ import annotations

from pathlib import Path

from gyrotc.emit import emit_texts, quantise_all
from gyrotc.model import load_model

HERE = Path(__file__).resolve().parent
FILES = ("gtc_test_1.h", "gtc_test_1.c")


if __name__ == "__main__":
    model = load_model(HERE / "model.json")
    texts = emit_texts(model, quantise_all(model, None))
    for name in FILES:
        (HERE / "table" / name).write_bytes(texts[name])
