"""Writes the golden files again from the example's `model.json`; read the difference before you commit it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from gyrotc.model import load_model
from gyrotc.tables import board_test_sources, emit_texts, quantise_all

GOLDEN = Path(__file__).resolve().parent
EXAMPLE = GOLDEN.parents[2] / "examples" / "minimal"

model = load_model(EXAMPLE / "model.json")
OF_RUNTIME = ("gtc.h", "gtc_f32.c", "gtc_q31.c", "emission.json")  # the last has the hashes of the others
emission = quantise_all(model, None)
written = emit_texts(model, emission) | board_test_sources(model, emission)
texts = {n: t for n, t in written.items() if n not in OF_RUNTIME}
for name in (f"gtc_{model.id}.c", f"gtc_{model.id}.h", "main.c"):
    (EXAMPLE / name).write_bytes(texts[name])
sums = "".join(f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(texts.items()))
(GOLDEN / "SHA256SUMS").write_text(sums)
