"""The analyses of Frama-C's Eva: what each is about, the text that it analyses, and its command."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from emitted import GOLDEN, emitted
from gyrotc.mirror import TableKind
from gyrotc.model import Model, load_model
from gyrotc.tables import needs_of, runtime_texts
from models import bank_with_channels, with_memories

SOURCES = Path(__file__).resolve().parents[1] / "prove" / "eva"
_OPTIONS = ("-eva", "-warn-signed-overflow", "-warn-signed-downcast", "-warn-special-float", "none")
#: Options of the runtime that holds the tables of a `shape`.
_SHAPE_NEEDS = {"GTC_MAX_TERMS": 4, "GTC_WITH_BANK": 1} | {f"GTC_WITH_{kind.name}": 1 for kind in TableKind}


@dataclass(frozen=True)
class Part:
    """An analysis: its C file, the table it is about, how precise, which functions by contract.

    `checks` are proved besides; `left` is the number of alarms in fixed point that docs/proof.md argues by hand.
    `shape`: instead of the emitted table any that `init` accepts, of so many networks and with such a last term.
    """

    file: str
    table: str = "golden"
    precision: int = 3
    options: tuple[str, ...] = ()
    contracts: dict[str, str] = field(default_factory=dict)
    checks: int = 0
    left: int = 0
    shape: tuple[int, str] | None = None


_MISSING = {"f32": "is_missing"}
_RELATED = {"f32": "is_missing,cell_of", "q31": "position_of"}
_TERMS = {"f32": "follow_memory,mean_of,is_missing", "q31": "follow_memory,mean_of"}
_HARMONIC = {"f32": "mean_of,is_missing", "q31": "mean_of"}
_FALLBACK_MODELS = {**_TERMS, "q31": f"{_TERMS['q31']},position_of"}
PARTS = {
    "map": Part("map", precision=7, contracts=_MISSING, checks=1),
    "map of a bank": Part("map", "bank", precision=7, contracts=_MISSING, checks=1, left=2),
    "mean": Part("mean"),
    "slope": Part("slope", options=("-eva-slevel-function", "window_slope:4000"), checks=2),
    "step": Part(
        "step",
        precision=4,
        options=("-eva-split-return-function", "check_start:0,check_state:0"),
        contracts={"f32": "mean_of,window_slope,is_missing", "q31": "mean_of,window_slope"},
        checks=14,
    ),
    "snapshot, re-zero": Part(
        "sigma",
        precision=7,
        contracts={"f32": f"{_RELATED['f32']},saturate,square_root,square_or", "q31": _RELATED["q31"]},
        checks=5,
        shape=(1, "auxiliary"),
    ),
    "memory": Part("follow", "terms", left=2),
    "memories, play, warm-up": Part("terms", "terms", precision=7, contracts=_TERMS, checks=2),
    "harmonic, channels": Part("terms", "bank", precision=7, contracts=_HARMONIC),
    "map of any table": Part("map", precision=7, contracts=_RELATED, checks=1, shape=(1, "warm_up")),
    "map of any bank": Part("map", precision=7, contracts=_RELATED, checks=1, left=3, shape=(2, "warm_up")),
    "terms of any table": Part("terms", precision=7, contracts=_TERMS, checks=1, shape=(1, "warm_up")),
    "channels of any table": Part("terms", precision=7, contracts=_FALLBACK_MODELS, checks=1, shape=(1, "auxiliary")),
    "curve of any table": Part("terms", precision=7, contracts=_FALLBACK_MODELS, checks=1, shape=(1, "curve")),
    "product of any table": Part("terms", precision=7, contracts=_FALLBACK_MODELS, checks=1, shape=(1, "product")),
}


def text_of(part: Part, folder: Path) -> Path:
    """Emit the table of a part and a runtime that holds it; return the folder of the C files."""
    change = {"golden": _same, "terms": with_memories, "bank": bank_with_channels}[part.table]
    model = change(load_model(GOLDEN))
    c = emitted(folder, model) / "c"
    if part.shape:
        for name, text in runtime_texts(needs_of(model) | _SHAPE_NEEDS, ("f32", "q31")).items():
            (c / name).write_bytes(text)
    return c


def _same(model: Model) -> Model:
    return model


def preprocessor_options(c: Path, part: Part, numeric: str) -> list[str]:
    """Return folders and names of one arithmetic; the options that the runtime was made with are in its header."""
    stated = re.findall(r"\bGTC_WITH_\w+=\d+", (c / "gtc.h").read_text("ascii"))
    names = [numeric.upper(), *stated]
    if part.shape:
        networks, term = part.shape
        names += ["ANY_TABLE", f"SHAPE_NETWORKS={networks}U", f"SHAPE_KIND=GTC_TERM_{term.upper()}"]
    return [f"-I{c}", f"-I{SOURCES}", *(f"-D{name}" for name in names)]


def command_of(c: Path, part: Part, numeric: str, machine: str) -> list[str]:
    """Return the command that analyses a part in one arithmetic on one machine."""
    options = ["-eva-precision", str(part.precision), *part.options]
    if numeric in part.contracts:
        options += ["-eva-use-spec", part.contracts[numeric]]
    extra = " ".join(preprocessor_options(c, part, numeric))
    files = [str(SOURCES / f"{part.file}.c"), str(c / "gtc_rlg_0042.c")]
    return ["frama-c", *_OPTIONS, *options, "-machdep", machine, f"-cpp-extra-args={extra}", *files]
