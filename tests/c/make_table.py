"""Writes the tables that the C tests use; run it again after a change of layout or rounding."""

from __future__ import annotations

from pathlib import Path

from gyrotc.model import load_model
from gyrotc.tables import emit_texts, quantise_all

HERE = Path(__file__).resolve().parent

if __name__ == "__main__":
    for path in sorted(HERE.glob("model*.json")):
        model = load_model(path)
        texts = emit_texts(model, quantise_all(model, None))
        for ending in ("h", "c"):
            name = f"gtc_{model.id}.{ending}"
            (HERE / "table" / name).write_bytes(texts[name])
