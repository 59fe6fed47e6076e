"""The section `bench` of docs/results.md, and what the project wants to reach (none of it depends on peers)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

_DEFAULT = """The default method on {gyros} simulated gyros of each scenario: trained on set 1 of the paper's six
environments, everything chosen from it; judged on set 2. RMS of compensated 100-s means ÷ RMS of the noise that
was really added.
"""
_SELECTION = """CPU seconds of one process and its peak memory, interpreter and libraries included. Selection by
orthogonal least squares among equal Gaussians: 30 centers, least BIC over sizes and widths, weights. Peers get the
same candidates as a matrix, which they have to build. RMS: what is left (noise: 0.5). A time in brackets is no
reference: more than 5 % worse than the best in accuracy.
"""
_SAME = """The same samples in rad/s, shuffled, and every one twice: numbers of centers of {gyros} gyros, and how many
of the gyros kept their centers.
"""
_RAW = """Twelve recordings of 2.88 million rows (100 Hz, Parquet) simulated: {simulated[seconds]:.1f} CPU s,
{simulated[elapsed_s]:.1f} s by the clock, {simulated[peak_gib]:.2f} GiB.

Six recordings of 2.88 million rows (100 Hz, Parquet) to a C file proven on the host: {seconds:.1f} CPU s
({steps}), {elapsed_s:.1f} s by the clock, at most {peak_gib:.2f} GiB.
"""

_DEFAULT_HEAD = (
    "scenario",
    "median",
    "worst",
    "centers",
    "bytes",
    "CPU s, median / worst",
    "found − predicted",
    "withheld",
    "largest Σ\\|w\\|, deg/h",
)

_ACCURACY = ("rms", "ratio", "rms_distance")
_REFERENCE = 1.05

Column = tuple[str, str, str]  # title, key, format


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    versions = ", ".join(f"{name} {v}" for name, v in result["versions"].items())
    parts = [
        "## Training beside its peers (`make bench`)\n",
        f"{result['machine']}, one thread. {versions}.\n",
        _table(["aim", "at most", "measured"], [_aim_row(result, *aim) for aim in AIMS]),
        *_accuracy(result["accuracy"]),
        _SAME.format(**result["invariance"]),
        _invariance(result["invariance"]["rows"]),
        *_speed(result["speed"]),
    ]
    return "\n".join(parts) + "\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _aim_row(
    result: dict[str, Any], what: str, limit: float, form: str, figure: Callable[[dict[str, Any]], float]
) -> list[str]:
    value = figure(result)
    return [what, f"{limit:g}", format(value, form) if value <= limit else f"**{value:{form}}** (missed)"]


def _ratio(spread: dict[str, float]) -> list[str]:
    return [f"{spread['median']:.4f}", f"{spread['worst']:.4f}"]


def _span(spread: dict[str, float]) -> str:
    low, high = spread["best"], spread["worst"]
    return f"{low:.0f}" if low == high else f"{low:.0f}-{high:.0f}"


def _accuracy(a: dict[str, Any]) -> list[str]:
    ramps = list(a["left_out"][0]["ramps"])
    numbers = list(a["more_centers"][0]["largest"])
    return [
        "### Accuracy and size\n",
        _DEFAULT.format(gyros=a["default"][0]["gyros"]),
        _table(_DEFAULT_HEAD, [_default_row(d) for d in a["default"]]),
        "Every method, scenario `paper` (bytes: the numbers of the map as 32-bit words):\n",
        _table(
            ["method", "gyros", "median", "worst", "bytes", "CPU s"],
            [_method_row(m) for m in sorted(a["methods"], key=lambda m: float(m["ratio"]["median"]))],
        ),
        "More centers than it would choose, five gyros: the largest change of the ratio.\n",
        _table(
            ["scenario", *(f"{n} centers" for n in numbers)],
            [[m["scenario"], *(f"{v:+.4f}" for v in m["largest"].values())] for m in a["more_centers"]],
        ),
        "A ramp rate that training never saw: ratio on it, median / worst; in brackets the median with it.\n",
        _table(["scenario", *ramps, "median of medians"], [_left_out_row(x) for x in a["left_out"]]),
        "Noise other than the paper's, the same maps:\n",
        _table(
            ["noise", "median", "worst", "centers"],
            [[f"× {n['factor']:.2g}", *_ratio(n["ratio"]), _span(n["centers"])] for n in a["noise"]],
        ),
    ]


def _default_row(d: dict[str, Any]) -> list[str]:
    surplus = d["found_minus_predicted"]
    return [
        d["scenario"],
        *_ratio(d["ratio"]),
        _span(d["centers"]),
        _span(d["bytes"]),
        f"{d['seconds']['median']:.3f} / {d['seconds']['worst']:.3f}",
        "-" if surplus is None else f"{round(surplus, 4) + 0.0:+.4f}",  # + 0.0: not "-0.0000"
        str(d["withheld"]),
        f"{d['sum_abs_weights_dph']:.3f}",
    ]


def _method_row(m: dict[str, Any]) -> list[str]:
    return [m["name"], str(m["gyros"]), *_ratio(m["ratio"]), f"{m['bytes']:.0f}", f"{m['seconds']:.3f}"]


def _left_out_row(x: dict[str, Any]) -> list[str]:
    cells = [
        f"{' / '.join(_ratio(ramp['without']))} ({ramp['with']['median']:.4f})"
        for ramp in x["ramps"].values()
    ]
    return [x["scenario"], *cells, f"{x['median']:.4f}"]


def _invariance(rows: Sequence[dict[str, Any]]) -> str:
    changes = list(rows[0]["changes"])
    body = [
        [row["name"], _range(row["centers"]), *(_kept(row["changes"][change]) for change in changes)]
        for row in rows
    ]
    return _table(["method", "centers", *changes], body)


def _kept(change: dict[str, Any]) -> str:
    return f"{_range(change['centers'])}, {change['same']} the same"


def _range(limits: Sequence[int]) -> str:
    return "-".join(str(n) for n in dict.fromkeys(limits))


def _speed(s: dict[str, Any]) -> list[str]:
    time: Column = ("CPU s", "seconds", ".3f")
    memory: Column = ("peak GiB", "peak_gib", ".2f")
    blocks = ["### Speed\n", _SELECTION]
    for x in s["selection"]:
        widths = f"{x['widths']} width" + "s" * (x["widths"] > 1)
        blocks.append(f"{x['samples']} samples, {x['candidates']} candidates, {widths}:\n")
        blocks.append(_rows(x["rows"], [time, memory, ("RMS", "rms", ".4f")]))
    for x in s["learning"]:
        blocks.append(
            f"Whole methods, one gyro of scenario `{x['scenario']}`, from block means to the map:\n"
        )
        blocks.append(
            _rows(x["rows"], [time, memory, ("RMS ÷ floor", "ratio", ".4f"), ("bytes", "bytes", "d")])
        )
    blocks.append("Kohonen network, 300 nodes, 172800 samples, one epoch:\n")
    blocks.append(_rows(s["kohonen"], [time, ("RMS distance", "rms_distance", ".4f")]))
    blocks.append("Six anisotropic Gaussians through 500 points by variable projection, one start:\n")
    blocks.append(_rows(s["varpro"], [("CPU s", "seconds", ".4f"), ("RMS", "rms", ".4f")]))
    raw = s["raw"]
    steps = ", ".join(f"{x['step']} {x['seconds']:.1f} s" for x in raw["steps"])
    blocks.append(_RAW.format(**(raw | {"steps": steps})))
    return blocks


def _rows(rows: Sequence[dict[str, Any]], columns: Sequence[Column]) -> str:
    measure = next(key for _, key, _ in columns if key in _ACCURACY)
    limit = _REFERENCE * min(float(row[measure]) for row in rows if measure in row)
    body = [
        [row["name"], *(_figure(row, key, form, row.get(measure, 0.0) <= limit) for _, key, form in columns)]
        for row in rows
    ]
    return _table(["", *(title for title, _, _ in columns)], body)


def _figure(row: dict[str, Any], key: str, form: str, is_reference: bool) -> str:
    if "over_s" in row:
        return f"> {row['over_s']:.0f}" if key == "seconds" else "-"
    if "failed" in row:
        return "failed"
    figure = format(row[key], form)
    return figure if is_reference or key != "seconds" else f"({figure})"


Result = dict[str, Any]
Aim = tuple[str, float, str, Callable[[Result], float]]  # what, at most, format, figure of a result


def _default(r: Result, key: str, of: str) -> list[float]:
    """A figure of the default method for the smooth scenario and for those with ripple."""
    return [float(d[key][of]) for d in r["accuracy"]["default"]]


def _contestant(r: Result, table: str, name: str, **where: Any) -> dict[str, Any]:
    """The row of a contestant in a table of the section on speed."""
    rows = r["speed"][table]
    if where:
        rows = next(x["rows"] for x in rows if all(x[key] == value for key, value in where.items()))
    return next(row for row in rows if row["name"] == name)


def _large(r: Result, name: str) -> dict[str, Any]:
    return _contestant(r, "selection", name, samples=172800)


_GRID, _ANY = "gyrotc, grid", "gyrotc, any candidates"

AIMS: tuple[Aim, ...] = (
    ("RMS ÷ floor, smooth maps: median", 1.006, ".4f", lambda r: _default(r, "ratio", "median")[0]),
    ("RMS ÷ floor, smooth maps: worst", 1.015, ".4f", lambda r: _default(r, "ratio", "worst")[0]),
    ("RMS ÷ floor, with ripple: worst", 1.02, ".4f", lambda r: max(_default(r, "ratio", "worst")[1:])),
    ("bytes of float32, smooth maps: most", 144, ".0f", lambda r: _default(r, "bytes", "worst")[0]),
    ("bytes of float32, with ripple: most", 264, ".0f", lambda r: max(_default(r, "bytes", "worst")[1:])),
    (
        "predicted against found RMS ÷ floor: median difference",
        0.002,
        ".4f",
        lambda r: max(abs(d["found_minus_predicted"] or 0.0) for d in r["accuracy"]["default"]),
    ),
    (
        "up to 60 centers asked for: largest change of the ratio",
        0.005,
        ".4f",
        lambda r: max(abs(v) for x in r["accuracy"]["more_centers"] for v in x["largest"].values()),
    ),
    (
        "RMS ÷ floor on a ramp rate left out: median",
        1.03,
        ".4f",
        lambda r: max(x["median"] for x in r["accuracy"]["left_out"]),
    ),
    (
        "CPU s, orthogonal least squares of paper size",
        0.010,
        ".4f",
        lambda r: float(_contestant(r, "selection", _GRID, samples=1728, widths=7)["seconds"]),
    ),
    ("CPU s, `mrbf`, smooth maps: median", 0.06, ".3f", lambda r: _default(r, "seconds", "median")[0]),
    ("CPU s, `mrbf`, with ripple: median", 0.25, ".3f", lambda r: max(_default(r, "seconds", "median")[1:])),
    (
        "CPU s, variable projection of six Gaussians",
        0.007,
        ".4f",
        lambda r: float(_contestant(r, "varpro", "gyrotc")["seconds"]),
    ),
    (
        "CPU s, 2000 candidates on a grid × 172800 samples",
        0.3,
        ".2f",
        lambda r: float(_large(r, _GRID)["seconds"]),
    ),
    (
        "CPU s, 2000 candidates anywhere × 172800 samples",
        18.0,
        ".2f",
        lambda r: float(_large(r, _ANY)["seconds"]),
    ),
    (
        "peak GiB of these two",
        0.5,
        ".2f",
        lambda r: max(float(_large(r, name)["peak_gib"]) for name in (_GRID, _ANY)),
    ),
    ("CPU s, Kohonen network", 0.1, ".3f", lambda r: float(_contestant(r, "kohonen", "gyrotc")["seconds"])),
    (
        "CPU s, six recordings of 2.88 million rows to proven C",
        10.0,
        ".1f",
        lambda r: r["speed"]["raw"]["seconds"],
    ),
    ("peak GiB of this", 0.5, ".2f", lambda r: r["speed"]["raw"]["peak_gib"]),
)
