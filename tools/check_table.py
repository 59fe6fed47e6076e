#!/usr/bin/env python3
"""Checks emitted tables against model.json without a line of gyrotc: standard library only.

    tools/check_table.py DIR [BOARD]   DIR holds model.json and c/, as `gyrotc emit` or `gyrotc build` leave them;
                                       BOARD is the folder that `gyrotc emit --board` wrote

Reads the tables from the C source and from the image, computes the equation of docs/FORMAT.md with the words
of the table and with the numbers of the model, and compares the two within the bound that the emitted header
prints; banks of networks with their hand-over. Known answers, and those of BOARD, are judged by the model, too. The
bound leaves out extension terms: their records are compared word by word with what the model's parameters give.
The checksum of the model and the hashes in `c/emission.json` must hold.
Exit status: 0 all agrees, 1 something differs (each is printed), 2 a file cannot be read.
"""

from __future__ import annotations

import hashlib
import json
import math
import random
import re
import struct
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MAGIC = 0x47544331
ARITHMETIC = {1: "f32", 2: "q31"}
HEAD = [
    "quantity", "unit", "id", "calibrated", "block_us", "slope_blocks", "lead_blocks", "bias_frac_bits",
    "parts", "fallback", "authority:2", "effect:2", "rezero", "scale:3", "envelope:4", "n_networks", "n_centers",
    "n_channels", "n_terms", "coverage_cells:2", "sigma_cells:2", "n_sigma", "n_probes",
]  # fmt: skip
NUMBERS = {"fallback", "authority", "effect", "rezero", "scale", "envelope"}
ARRAYS = ("serial", "networks", "centers", "guards", "terms", "coverage", "sigma", "probes")
CLAMPED, UNCOVERED = 2, 4
MARGIN = 0.25  # of the range of corrections, granted at either end: the header says so
LARGEST_BOUND = 0.01  # of the noise floor, beyond which a format is refused: docs/numerics.md, section 4
TAKEN_ID = re.compile(r"e|angle|crc|config|table|private|(f32|q31)(_\w+)?|(num|save|selftest)_(f32|q31)")

Pair = tuple[float, float]


class Unreadable(Exception):
    """A file is missing or not of the form that docs/FORMAT.md gives."""


def as_float(word: int) -> float:
    return float(struct.unpack("<f", struct.pack("<I", word))[0])


def as_integer(word: int) -> int:
    return word - 2**32 if word >= 2**31 else word


def nearest_float(x: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", x))[0])


class Model:
    """The equation of model.json in float64."""

    def __init__(self, path: Path) -> None:
        self.raw = json.loads(path.read_text(encoding="utf-8"))
        self.checksum = self.raw.pop("checksum", None)  # of all other fields: the hash
        canonical = json.dumps(self.raw, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
        self.hash = hashlib.sha256(canonical.encode("ascii")).hexdigest()
        left_out = set(self.raw.get("left_out", ()))
        for part, field in (("coverage", "coverage"), ("uncertainty", "uncertainty_dph")):
            if part in left_out:
                self.raw[field] = None
        if left_out & {"rezero", "uncertainty"}:
            self.raw["rezero_dph"] = 0.0
        self.per_block = self.raw["block_s"] / 60.0
        self.t_range = self.raw["envelope"]["temperature_c"]
        self.r_range = self.raw["envelope"]["slope_c_per_min"]
        self.shift = 0.0  # of --zero-at
        self.known_biases: list[float] = []

    def id(self) -> str:
        serial, axis = self.raw["serial"], self.raw["axis"] or ""
        plain = re.sub(r"[^a-z0-9]", "_", serial.lower()) + (f"_{axis}" if axis else "")
        short = len(plain) <= 31 - len("gtc_") - len("_f32")
        if re.fullmatch(r"[A-Za-z0-9_-]+", serial) and short and not TAKEN_ID.fullmatch(plain):
            return plain
        return f"{plain[:18]}_{hashlib.sha256((serial + axis).encode('ascii')).hexdigest()[:8]}"

    def bias(self, temperature: float, slope_per_block: float) -> float:
        t = min(max(temperature, self.t_range[0]), self.t_range[1])
        r = min(max(slope_per_block / self.per_block, self.r_range[0]), self.r_range[1])
        parts = [(self.share(n, t, r), n) for n in self.raw["networks"]]
        total = math.fsum(share for share, _ in parts)
        sums = (share * self.of_network(n, t, r) for share, n in parts if share > 0.0)
        return math.fsum(sums) / total - self.shift

    def biases(self) -> list[float]:
        """At every one of `places`; computed once."""
        if not self.known_biases:
            self.known_biases = [self.bias(t, slope) for t, slope in places(self)]
        return self.known_biases

    def share(self, n: dict[str, Any], t: float, r: float) -> float:
        """Return the weight of a network of a bank, before it is divided by the sum of all."""
        if n["region"] is None or len(self.raw["networks"]) == 1:
            return 1.0
        edges = (
            (t, n["region"]["temperature_c"], self.t_range),
            (r, n["region"]["slope_c_per_min"], self.r_range),
        )
        return min(share_in(*edge) for edge in edges)

    def of_network(self, n: dict[str, Any], t: float, r: float) -> float:
        center, half = self.raw["scale"]["temperature_c"]
        half_r = self.raw["scale"]["slope_c_per_min"]
        z = ((t - center) / half, r / half_r)
        total = [n["w0"], n["linear"][0] * z[0], n["linear"][1] * z[1]]
        for (c_t, c_r), widths, weight in zip(n["centers"], n["widths"], n["weights"], strict=True):
            c = ((c_t - center) / half, c_r / half_r)
            u = sum(((z[k] - c[k]) / widths[k]) ** 2 for k in (0, 1) if widths[k] is not None)
            total.append(weight * math.exp(-u))
        return math.fsum(total)

    def channels(self) -> list[str]:
        return sorted({term["channel"] for term in self.raw["terms"] if term.get("channel")})

    def fallback_models(self) -> list[dict[str, Any]]:
        """Networks that stand for terms whose channels are lost."""
        return [term["stand_in"] for term in self.raw["terms"] if term.get("stand_in")]

    def temperature_guard(self) -> dict[str, float]:
        raw = self.raw
        return {
            "low": -90.0, "high": 200.0, "max_step": raw["max_step_c"], "agree_s": raw["agree_s"],
            "max_rate_per_min": raw["max_rate_c_per_min"], "stuck_s": raw["stuck_s"],
            "missing_s": raw["hold_blocks"] * raw["block_s"], "fallback": 0.0,
        }  # fmt: skip

    def guard(self, channel: str) -> dict[str, float]:
        if channel in self.raw["guards"]:
            return dict(self.raw["guards"][channel])
        reference = next(t["parameters"]["reference"] for t in self.raw["terms"] if t.get("channel") == channel)
        return {
            "low": -1e9, "high": 1e9, "max_step": 1e9, "max_rate_per_min": 0.0, "agree_s": 0.0, "stuck_s": 0.0,
            "missing_s": self.raw["hold_blocks"] * self.raw["block_s"], "fallback": reference,
        }  # fmt: skip

    def term(self, term: dict[str, Any]) -> tuple[int, int, list[float]]:
        """Kind, channel and parameters of a term's record, in the units of docs/FORMAT.md."""
        p, block = term["parameters"], self.raw["block_s"]
        channel = 1 + self.channels().index(term["channel"]) if term.get("channel") else 0
        gain = -math.expm1(-block / p["tau_s"]) if "tau_s" in p else 0.0
        # Amplitudes belong to the middle of a block, records to its start or end: what fades was so much larger before.
        half = math.exp(0.5 * block / p["tau_s"]) if "tau_s" in p else 1.0
        if term["id"] == "cavity_lag":
            return 1, channel, [gain, 0.0, block / p["tau_s"]]
        if term["id"] == "thermal_gradient":
            return 1, channel, [gain, p["amplitude_dph_per_c"] * half, 0.0]
        if term["id"] == "hysteresis":
            growth, middle = (p.get(name, 0.0) for name in ("amplitude_dph_per_c_per_c", "reference_c"))
            return 2, channel, [p["width_c"], p["amplitude_dph_per_c"], growth, middle]
        if term["id"] == "warm_up":
            return 3, channel, [block / p["tau_s"] * math.log2(math.e), p["amplitude_dph"] / half]
        if term["id"] == "path_length_periodicity":
            return 4, channel, [1.0 / p["period_c"], p["phase_rad"] / math.tau, p["amplitude_dph"]]
        slope, reference = p["slope_dph_per_unit"], p["reference"]
        if "width" in p:
            root = math.sqrt(math.log2(math.e)) / p["width"]
            bells = [reference, p["first_dph"], p["second_center"], p["second_dph"]]
            return 6, channel, [slope, root, *bells]
        if "reference_c" in p:
            return 7, channel, [slope, reference, p["slope_dph_per_unit_per_c"], p["reference_c"]]
        return 5, channel, [slope, reference]


def share_in(x: float, region: Pair, envelope: Pair) -> float:
    """Share of the way from the nearest edge of a region that is no edge of the envelope; 0 outside."""
    low, high = region
    from_low = (x - low) / (high - low) if low > envelope[0] else 1.0
    from_high = (high - x) / (high - low) if high < envelope[1] else 1.0
    return max(min(1.0, from_low, from_high), 0.0)


class Image:
    """A table: its words, and the equation that they stand for, in float64."""

    def __init__(self, words: list[int], where: str) -> None:
        if len(words) < 30 or words[0] != MAGIC or words[2] != len(words) or words[1] & 0xFFFF != 3:
            raise Unreadable(f"{where}: not an image of layout 3")
        self.where, self.words = where, words
        self.numeric = ARITHMETIC[words[1] >> 16]
        rest = iter(words[3:-1])
        self.member: dict[str, list[Any]] = {}
        for entry in HEAD:
            name, _, n = entry.partition(":")
            group = [next(rest) for _ in range(int(n or 1))]
            self.member[name] = [self.number(w) for w in group] if name in NUMBERS else group
        cells = self.member["coverage_cells"]
        sizes = {"serial": 16, "networks": 8 * self.one("n_networks"), "centers": 5 * self.one("n_centers"),
                 "guards": 8 * self.one("n_channels"), "terms": 8 * self.one("n_terms"),
                 "coverage": (cells[0] * cells[1] + 31) // 32,
                 "sigma": self.one("n_sigma"), "probes": 4 * self.one("n_probes")}  # fmt: skip
        self.array = {name: [next(rest) for _ in range(n)] for name, n in sizes.items()}
        if next(rest, None) is not None:
            raise Unreadable(f"{where}: more words than its counts say")

    def one(self, name: str) -> int:
        return int(self.member[name][0])

    def number(self, word: int) -> float:
        return as_float(word) if self.numeric == "f32" else as_integer(word)

    def crc(self) -> int:
        return zlib.crc32(struct.pack(f"<{len(self.words) - 2}I", *self.words[1:-1]))

    def to_dph(self, number: float) -> float:
        return number if self.numeric == "f32" else number * 2.0 ** -self.one("bias_frac_bits")

    def input(self, value: float) -> float:
        """An input (C or C per block) as the arithmetic takes it, in C."""
        return nearest_float(value) if self.numeric == "f32" else round(value * 65536.0) / 65536.0

    def bias(self, temperature: float, slope: float) -> float:
        """The equation of docs/numerics.md with the table's words, without the target's rounding."""
        point, limits = self.point(temperature, slope)
        shares, parts = [], []
        fallback_models = sum(word >> 16 != 0 for word in self.array["terms"][1::8])
        for head, centers in list(self.networks())[: self.one("n_networks") - fallback_models]:
            regions = ((head[4], head[5]), (head[6], head[7]))
            share = min(share_in(*edge) for edge in zip(point, regions, limits, strict=True))
            if share > 0.0:
                shares.append(share)
                parts.append(share * self.of_network(head, centers, point))
        return self.to_dph(math.fsum(parts) / math.fsum(shares))

    def point(self, temperature: float, slope: float) -> tuple[Any, Any]:
        """Inputs as the networks see them, and the envelope's edges."""
        e, s = self.member["envelope"], self.member["scale"]
        if self.numeric == "f32":
            point = (min(max(temperature, e[0]), e[1]), min(max(slope, e[2]), e[3]))
            limits = ((e[0], e[1]), (e[2], e[3]))
        else:
            t, r = (min(max(round(v * 65536.0), e[k]), e[k + 1]) for v, k in ((temperature, 0), (slope, 2)))
            point = (((t - e[0]) * s[0]) >> 27, ((r - e[2]) * s[1]) >> 27)
            limits = ((0, 65535), (0, 65535))
        return point, limits

    def networks(self) -> Iterator[tuple[list[float], list[list[float]]]]:
        """Record and centers of every network."""
        words, first = self.array["networks"], 0
        records = [self.number(w) for w in self.array["centers"]]
        for k in range(0, len(words), 8):
            n = words[k]
            rows = [records[5 * i : 5 * i + 5] for i in range(first, first + n)]
            yield [n, *(self.number(w) for w in words[k + 1 : k + 8])], rows
            first += n

    def of_network(self, head: list[float], centers: list[list[float]], point: tuple[Any, Any]) -> float:
        """One network at a point of the envelope: T and slope in float32, positions in fixed point."""
        s = self.member["scale"]
        if self.numeric == "f32":
            z = ((point[0] - s[0]) * s[1], point[1] * s[2])
            total = [head[1], head[2] * z[0], head[3] * z[1]]
            for c_t, g_t, c_r, g_r, weight in centers:
                u = ((z[0] - c_t) * g_t) ** 2 + ((z[1] - c_r) * g_r) ** 2
                total.append(weight * 2.0 ** (-u / 64.0) if u < 64 * 1000 else 0.0)
            return math.fsum(total)
        total = [head[1], head[2] * point[0] / 65536.0, head[3] * point[1] / 65536.0]
        for s_t, k_t, s_r, k_r, weight in centers:
            u = ((s_t * point[0] + k_t) ** 2 + (s_r * point[1] + k_r) ** 2) / 2.0 ** (56 - s[2])
            total.append(weight * 2.0**-u if u < 1000 else 0.0)
        return math.fsum(total)


# ---- the files ----


def images_of(folder: Path, name: str) -> list[Image]:
    paths = [p for p in (folder / f"gtc_{name}.bin", folder / f"gtc_{name}_q31.bin") if p.is_file()]
    if not paths:
        raise Unreadable(f"{folder}: no image gtc_{name}.bin")
    found = []
    for path in paths:
        data = path.read_bytes()
        if len(data) % 4:
            raise Unreadable(f"{path}: not whole words")
        found.append(Image(list(struct.unpack(f"<{len(data) // 4}I", data)), path.name))
    return found


def hex_bytes(text: str) -> bytes:
    data = bytearray()
    for line in text.split():
        record = bytes.fromhex(line[1:])
        if line[0] != ":" or sum(record) & 255:
            raise Unreadable(f"Intel HEX: bad record {line}")
        if record[3] == 0:
            data += record[4:-1]
    return bytes(data)


def constants(text: str) -> list[int]:
    """Words of the constants in a piece of emitted C: V(float), B(integer), plain integers."""
    words = []
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = text.replace("(-2147483647L - 1L)", "-2147483648L")
    for value, bits, plain in re.findall(r"V\(([^)]*)F\)|B\(([^)]*?)U?L?\)|(?<![\w.])(-?\d\w*?)U?L?(?![\w.])", text):
        if value:
            words.append(struct.unpack("<I", struct.pack("<f", float(value)))[0])
        else:
            words.append(int(bits or plain, 0) & 0xFFFFFFFF)
    return words


def source_words(text: str, numeric: str) -> list[int]:
    """The image that a table in C source stands for."""
    struct_text = re.search(rf"const gtc_{numeric}_table_t \w+ = \{{(.*?)\n\}};", text, re.S)
    if struct_text is None:
        raise Unreadable(f"no {numeric} table in the C source")
    members = dict(re.findall(r"^\s*\.(\w+) = (.*?),?$", struct_text[1], re.M))
    found = {entry: constants(members[entry.partition(":")[0]]) for entry in HEAD}
    found["n_networks"][0] += constants(members["n_fallback_models"])[0]
    words = [word for entry in HEAD for word in found[entry]]
    for name in ARRAYS:
        if members[name] != "NULL":
            array = re.search(rf"gtc_word_t {members[name]}\[(\d+)\] = \{{(.*?)\n\}};", text, re.S)
            if array is None or len(constants(array[2])) != int(array[1]):
                raise Unreadable(f"array {members[name]} is not there, or not of its size")
            words += constants(array[2])
    layout = int(members["layout"]) + 65536 * {v: k for k, v in ARITHMETIC.items()}[numeric]
    return [MAGIC, layout, len(words) + 4, *words, *constants(members["crc"])]


# ---- the checks: each yields what is wrong ----


def check_files(folder: Path, name: str, image: Image) -> Iterator[str]:
    if image.crc() != image.words[-1]:
        yield "the CRC-32 is not that of the words"
    text = (folder / f"gtc_{name}.c").read_text(encoding="ascii")
    kinds = set(image.array["terms"][::8])
    parts = sum(1 << kind for kind in kinds)
    parts |= 0x1 * (image.one("n_networks") - len({w >> 16 for w in image.array["terms"][1::8]} - {0}) > 1)
    parts |= (
        0x100 * bool(image.array["coverage"]) + 0x200 * bool(image.array["sigma"]) + 0x400 * bool(image.array["probes"])
    )
    parts |= 0x800 * (image.numeric == "q31" and image.member["scale"][2] != 0)
    parts |= 0x1000 * (image.member["rezero"][0] != 0)
    if parts != image.one("parts"):
        yield f"the parts are {image.one('parts'):#x}, what the table holds makes {parts:#x}"
    source = source_words(text, image.numeric)
    if source != image.words:
        wrong = [k for k, pair in enumerate(zip(source, image.words, strict=False)) if pair[0] != pair[1]]
        yield f"the C source is not the image (words {wrong[:5]}, {len(source)} of {len(image.words)})"
    if hex_bytes((folder / image.where).with_suffix(".hex").read_text()) != (folder / image.where).read_bytes():
        yield "the Intel HEX file is not the image"


def calibrated(meta: dict[str, Any]) -> int:
    found = re.match(r"(\d{4})-(\d\d)-(\d\d)", str(meta.get("calibrated_on", "")))
    return int("".join(found.groups())) if found else 0


def check_members(model: Model, image: Image, name: str) -> Iterator[str]:
    raw, unit = model.raw, 1.0 if image.numeric == "f32" else 65536.0
    result_unit = 1.0 if image.numeric == "f32" else 2.0 ** image.one("bias_frac_bits")
    expected = {
        "quantity": [0], "unit": [0], "id": [zlib.crc32(name.encode("ascii"))],
        "calibrated": [calibrated(raw["meta"])], "block_us": [round(raw["block_s"] * 1e6)],
        "slope_blocks": [raw["slope_blocks"]], "lead_blocks": [raw["lead_blocks"]],
        "n_networks": [len(raw["networks"]) + len(model.fallback_models())],
        "n_channels": [1 + len(model.channels())], "n_terms": [len(raw["terms"])],
        "coverage_cells": (raw["coverage"] or {"cells": [0, 0]})["cells"],
        "sigma_cells": (raw["uncertainty_dph"] or {"cells": [0, 0]})["cells"],
    }  # fmt: skip
    for key, value in expected.items():
        if image.member[key] != list(value):
            yield f"{key} is {image.member[key]}, the model says {list(value)}"
    numbers = {
        "fallback": [(raw["fallback_dph"] - model.shift) * result_unit],
        "rezero": [raw["rezero_dph"] * result_unit],
        "envelope": [
            *(t * unit for t in model.t_range),
            *(r * model.per_block * unit for r in model.r_range),
        ],
    }
    for key, value in numbers.items():
        for got, want in zip(image.member[key], value, strict=True):
            room = 0.5000001 if image.numeric == "q31" else abs(want) * 2.0**-24 * 1.000001
            if abs(got - min(want, 2**31 - 1)) > room:
                yield f"{key} is {got}, the model says {want}"
    if struct.pack("<16I", *image.array["serial"]).rstrip(b"\0").decode("latin-1") != raw["serial"]:
        yield "the serial is not the model's"
    yield from check_guards(model, image)
    cells = "".join((raw["coverage"] or {"rows": []})["rows"])
    bits = "".join(f"{word:032b}"[::-1] for word in image.array["coverage"])
    if bits[: len(cells)] != cells or "1" in bits[len(cells) :]:
        yield "the coverage bits are not the model's"


def sigma_of(model: Model) -> tuple[list[float], int]:
    """Return the numbers of the uncertainty, deg/h but for one that is a time in s, and the place of that one."""
    known = model.raw["uncertainty_dph"]
    if known is None or known.get("rules") is None:
        return [], -1
    r, per_block = known["rules"], model.per_block
    covered = [s for row in known["rows"] for s in row]
    uncovered = [s for row in known.get("uncovered") or known["rows"] for s in row] if model.raw["coverage"] else []
    grids = [math.sqrt(max(s * s - r["between_dph"] ** 2, 0.0)) for s in covered + uncovered]
    rules = [
        r["hold_dph_per_c"], r["rest_dph_per_min"] * per_block, r["slope_dph_per_c_per_min"] / per_block,
        r["start_dph"], r.get("turn_dph", r["start_dph"]), r["beyond_dph_per_c"],
        r["beyond_dph_per_c_per_min"] / per_block, r["fallback_dph"],
        r["none_dph"], r["between_dph"], r["noise_deg_per_sqrt_h"] * 60.0, r["correlation_s"],
    ]  # fmt: skip
    return grids + rules + list(r["terms"]), len(grids) + len(rules) - 1


def check_sigma(model: Model, image: Image) -> Iterator[str]:
    """The uncertainty: its grids, rules, a number for each term."""
    wanted, time_at = sigma_of(model)
    if len(wanted) != image.one("n_sigma"):
        yield f"n_sigma is {image.one('n_sigma')}, the model says {len(wanted)}"
        return
    for k, (word, want) in enumerate(zip(image.array["sigma"], wanted, strict=True)):
        scale = 1.0 if image.numeric == "f32" or k == time_at else 2.0 ** image.one("bias_frac_bits")
        scaled = want * scale if image.numeric == "f32" else min(want * scale, 2**31 - 1)
        room = abs(want) * 2.0**-23 if image.numeric == "f32" else 0.5000001 + abs(scaled) * 2.0**-50
        if abs(image.number(word) - scaled) > room:
            yield f"word {k} of the uncertainty is {image.number(word)}, the model says {scaled}"


def wider(low: float, high: float, least: float = 0.0) -> Pair:
    """A range with the margin that the header names at either end."""
    margin = max(MARGIN * (high - low), least)
    return low - margin, high + margin


def effect_of(model: Model) -> Pair:
    """Smallest and largest that the terms may add, deg/h."""
    if not model.raw["terms"]:
        return 0.0, 0.0
    if model.raw.get("effects_dph") is not None:
        return wider(*model.raw["effects_dph"])
    span, low, high = model.t_range[1] - model.t_range[0], 0.0, 0.0
    for term in model.raw["terms"]:
        kind, _, values = model.term(term)
        if kind >= 5:
            guard, p = model.guard(term["channel"]), term["parameters"]
            growth, middle = p.get("slope_dph_per_unit_per_c", 0.0), p.get("reference_c", 0.0)
            slopes = [p["slope_dph_per_unit"] + growth * (t - middle) for t in model.t_range]
            ends = [s * (guard[edge] - p["reference"]) for s in slopes for edge in ("low", "high")]
            bells = [p.get("first_dph", 0.0), p.get("second_dph", 0.0)]
            low += min(0.0, *ends) + sum(min(0.0, b) for b in bells)
            high += max(0.0, *ends) + sum(max(0.0, b) for b in bells)
        else:
            scale = {1: span, 2: values[0], 3: 1.0, 4: 1.0}[kind]
            size = abs(values[2 if kind == 4 else 1]) * scale
            if kind == 2:
                size = scale * max(abs(values[1] + values[2] * (t - values[3])) for t in model.t_range)
            low, high = low - size, high + size
    return wider(low, high)


def check_authority(model: Model, image: Image, bound: float) -> Iterator[str]:
    """The range of corrections: that of the model's map on a grid and at its centers, and of its terms."""
    raw, effect = model.raw, effect_of(model)
    biases = model.biases()
    low, high = wider(min(biases), max(biases), raw["noise_floor_dph"] or 0.0)
    fallback = raw["fallback_dph"] - model.shift
    least = min(low + effect[0], fallback, 0.0) - raw["rezero_dph"]
    most = max(high + effect[1], fallback, 0.0) + raw["rezero_dph"]
    room = 0.02 * (max(biases) - min(biases)) + 2.0 * bound  # other points of the map are looked at
    held = 1.5e7 if image.numeric == "f32" else image.to_dph(2**31 - 1)
    for name, wanted, off in (("effect", effect, 0.0), ("authority", (least, most), room)):
        for number, want in zip(image.member[name], wanted, strict=True):
            got = image.to_dph(number)
            within = max(min(want, held), -held)
            if abs(got - within) > off + abs(within) * 2.0**-22 + image.to_dph(2) * (image.numeric == "q31"):
                yield f"{name} is {got}, the model says {within}"


def check_header(model: Model, image: Image, name: str, header: str) -> Iterator[str]:
    """What a program reads from the emitted header before it runs."""
    macros = dict(re.findall(rf"^#define GTC_{name.upper()}_(\w+) (\S+|\"[^\"]*\")(?: /\*.*)?$", header, re.M))
    block = round(model.raw["block_s"] * 1e6)
    whole = {
        "ID": zlib.crc32(name.encode("ascii")), "BLOCK_US": block, "PERIOD_MIN_US": max(1, -(-block // 2**20)),
        "PERIOD_MAX_US": block + block // 1000, "STUCK_US": round(model.raw["stuck_s"] * 1e6),
        "N_CHANNELS": 1 + len(model.channels()),
        # 8 pointers and the number of fallback models; neither magic nor length
        f"{image.numeric.upper()}_TABLE_BYTES": 4 * (len(image.words) + 7),
    }  # fmt: skip
    if image.numeric == "q31":
        whole["Q31_BIAS_FRAC_BITS"] = image.one("bias_frac_bits")
    for key, want in whole.items():
        if int(macros[key].rstrip("UL"), 0) != want:
            yield f"the header's {key} is {macros[key]}, not {want}"
    edges = {"T_MIN_C": model.t_range[0], "T_MAX_C": model.t_range[1],
             "SLOPE_MIN_C_PER_MIN": model.r_range[0], "SLOPE_MAX_C_PER_MIN": model.r_range[1]}  # fmt: skip
    for key, edge in edges.items():
        if abs(float(macros[key].strip("()F")) - edge) > abs(edge) * 1e-6:
            yield f"the header's {key} is {macros[key]}, the model says {edge}"
    ends = [float(macros[f"AUTHORITY_{end}_DPH"].strip("()F")) for end in ("MIN", "MAX")]
    low, high = (image.to_dph(number) for number in image.member["authority"])
    if not (ends[0] <= low + abs(low) * 1e-6 and high - abs(high) * 1e-6 <= ends[1]):
        yield f"the header's authority {ends} is narrower than the table's, {low} ... {high}"
    for k, channel in enumerate(["temperature_c", *model.channels()]):
        if macros[f"CHANNEL_{k}"] != f'"{channel}"':
            yield f"the header's channel {k} is {macros[f'CHANNEL_{k}']}, the model says {channel}"


def check_guards(model: Model, image: Image) -> Iterator[str]:
    """Records of the channels, the temperature first; in fixed point what 32 bits do not hold is the most they do."""
    f32, block_us = image.numeric == "f32", model.raw["block_s"] * 1e6
    scales = (1.0, 1.0, 1.0, 1.0, 1.0) if f32 else (2.0**16, 2.0**16, 2.0**16, 2.0**40, 2.0**16)
    for k, guard in enumerate([model.temperature_guard(), *map(model.guard, model.channels())]):
        record = image.array["guards"][8 * k : 8 * k + 8]
        wanted = [guard[n] for n in ("low", "high", "max_step", "max_rate_per_min", "fallback")]
        wanted[3] /= 60e6
        for word, want, scale in zip((*record[:4], record[7]), wanted, scales, strict=True):
            got, most = image.number(word), (math.inf if f32 else 2**31 - 1)
            room = abs(want) * 2.0**-24 * 1.000001 if f32 else 0.5000001
            if abs(got - min(max(want * scale, -most), most)) > room:
                yield f"guard of channel {k}: {got}, the model says {want}"
        times = [guard["agree_s"] * 1e6, guard["stuck_s"] * 1e6, guard["missing_s"] * 1e6 / block_us]
        if any(abs(w - t) > 0.5000001 for w, t in zip(record[4:7], times, strict=True)):
            yield f"guard of channel {k}: times {record[4:7]}, the model says {times}"


def check_regions(model: Model, image: Image) -> Iterator[str]:
    """Where the networks of a bank hold."""
    e, s = image.member["envelope"], image.member["scale"]
    whole = {"temperature_c": model.t_range, "slope_c_per_min": model.r_range}
    for network, (head, _) in zip([*model.raw["networks"], *model.fallback_models()], image.networks(), strict=True):
        region = network["region"] or whole
        edges = [*region["temperature_c"], *(r * model.per_block for r in region["slope_c_per_min"])]
        for k, (got, edge) in enumerate(zip(head[4:], edges, strict=True)):
            want, room = edge, abs(edge) * 2.0**-24 * 1.000001
            if image.numeric == "q31":
                position = (edge * 65536.0 - e[k // 2 * 2]) * s[k // 2] / 2.0**27 - 0.5
                want, room = min(max(position, 0.0), 65535.0), 0.5000001
            if abs(got - want) > room:
                yield f"an edge of a region is {got}, the model says {want}"


def check_terms(model: Model, image: Image) -> Iterator[str]:
    """The records of the extension terms against the model's parameters."""
    unit = 2.0 ** image.one("bias_frac_bits")
    scales = {1: (2.0**31, unit, 2.0**24), 2: (2.0**16, unit, unit, 2.0**16), 3: (2.0**28, unit),
              4: (2.0**32, 2.0**32, unit), 5: (unit, 2.0**16),
              6: (unit, 2.0**24, 2.0**16, unit, 2.0**16, unit),
              7: (unit, 2.0**16, unit, 2.0**16)}  # fmt: skip
    last = len(model.raw["networks"])
    for k, term in enumerate(model.raw["terms"]):
        words = image.array["terms"][8 * k : 8 * k + 8]
        kind, channel, values = model.term(term)
        if term.get("stand_in"):
            last += 1
            channel += 65536 * last
        if words[:2] != [kind, channel]:
            yield f"term {term['id']}: kind and channel are {words[:2]}, the model says {[kind, channel]}"
            continue
        if image.numeric == "f32":
            octaves = {(3, 0): 64.0, (6, 1): 8.0}
            values = [octaves.get((kind, i), 1.0) * v for i, v in enumerate(values)]
        else:
            values = [v * scale for v, scale in zip(values, scales[kind], strict=True)]
        for i, word in enumerate(words[2:]):
            want = values[i] if i < len(values) else 0.0
            error = image.number(word) - min(want, 2.0**31 - 1.0 if image.numeric == "q31" else want)
            if (kind, i) == (4, 1):  # a phase in turns
                turn = 1.0 if image.numeric == "f32" else 2.0**32
                error -= turn * round(error / turn)
            if abs(error) > (abs(want) * 2.0**-24 * 1.000001 if image.numeric == "f32" else 0.5000001):
                yield f"term {term['id']}: parameter {i} is {image.number(word)}, the model says {want}"


def places(model: Model) -> Iterator[tuple[float, float]]:
    """A grid over the envelope and beyond its edges, every center, and random places (always the same ones)."""
    t0, t1 = model.t_range
    r0, r1 = (r * model.per_block for r in model.r_range)
    for i in range(-1, 42):
        for j in range(-1, 22):
            yield t0 + (t1 - t0) * i / 40, r0 + (r1 - r0) * j / 20
    for network in model.raw["networks"]:
        for c_t, c_r in network["centers"]:
            yield c_t, c_r * model.per_block
    draw = random.Random(20140801)
    for _ in range(4000):
        yield draw.uniform(t0, t1), draw.uniform(r0, r1)


def check_map(model: Model, image: Image, bound: float) -> Iterator[str]:
    worst, where = 0.0, (0.0, 0.0)
    for t, slope in places(model):
        error = abs(image.bias(image.input(t), image.input(slope)) - model.bias(t, slope))
        if error > worst:
            worst, where = error, (t, slope)
    print(f"{image.where}: largest departure of the table from the model {worst:.3e} deg/h, bound {bound:.2e}")
    if worst > bound:
        yield f"at T = {where[0]:.4f} C, slope = {where[1]:.6f} C per block the table departs by {worst:.3e} deg/h"


def check_fallback_models(model: Model, image: Image, header: str) -> Iterator[str]:
    """What stands for the terms of lost channels against the model's networks."""
    if not model.fallback_models():
        return
    printed = re.search(rf"\* {image.numeric} fallback models: .*\|error\| <= (\S+) deg/h", header)
    if printed is None:
        raise Unreadable(f"the header prints no bound of the fallback models of {image.numeric}")
    (t0, t1), (r0, r1) = model.t_range, model.r_range
    own = list(image.networks())[-len(model.fallback_models()) :]
    for network, (head, centers) in zip(model.fallback_models(), own, strict=True):
        for t, slope in places(model):
            point, _ = image.point(image.input(t), image.input(slope))
            want = model.of_network(network, min(max(t, t0), t1), min(max(slope / model.per_block, r0), r1))
            error = abs(image.to_dph(image.of_network(head, centers, point)) - want)
            if error > float(printed[1]):
                yield f"a fallback model departs by {error:.3e} deg/h at T = {t:.4f} C, more than {printed[1]}"
                break


def check_bound(model: Model, bound: float) -> Iterator[str]:
    """A bound that a wrong table would keep, too, shows nothing: at most 1 % of the noise, else of the map's range."""
    biases = model.biases()
    against = model.raw["noise_floor_dph"] or max(biases) - min(biases)
    if not bound <= LARGEST_BOUND * against:
        yield f"the printed bound {bound:.2e} deg/h is more than 1 % of {against:.2e}: it proves nothing"


def check_answer(model: Model, image: Image, words: list[int], bound: float) -> Iterator[str]:
    """One known answer: temperature, slope, bias, status."""
    t, slope = (image.number(w) / (1.0 if image.numeric == "f32" else 65536.0) for w in words[:2])
    if not (math.isfinite(t) and math.isfinite(slope)) or (image.numeric == "q31" and 0x80000000 in words[:2]):
        if words[3] < 2**31:
            yield f"a missing input is answered with status {words[3]}"
        return
    error = abs(image.to_dph(image.number(words[2])) - model.bias(t, slope))
    if error > bound:
        yield f"answer at T = {t:.4f}, slope = {slope:.6f} departs from the model by {error:.3e} deg/h"
    outside = [(v - low) / (high - low or 1.0) for v, low, high in
               ((t, *model.t_range), (slope, *(r * model.per_block for r in model.r_range)))]  # fmt: skip
    if min(abs(o - edge) for o in outside for edge in (0.0, 1.0)) > 1e-4:  # at an edge rounding decides
        if bool(words[3] & CLAMPED) != any(not 0.0 <= o <= 1.0 for o in outside):
            yield f"answer at T = {t:.4f}, slope = {slope:.6f} has status {words[3]}"
        cells, rows = (model.raw["coverage"] or {"cells": [1, 1], "rows": ["1"]}).values()
        place = [min(max(o, 0.0), 0.999999) * n for o, n in zip(outside, cells, strict=True)]
        certain = all(1e-3 < p % 1.0 < 0.999 for p in place)
        if certain and bool(words[3] & UNCOVERED) == (rows[int(place[1])][int(place[0])] == "1"):
            yield f"answer at T = {t:.4f}, slope = {slope:.6f} has status {words[3]}, coverage says otherwise"


def known_answers(board: Path | None, name: str, image: Image) -> Iterator[list[int]]:
    """Known answers of the table, and of the board test's map if given: temperature, slope, bias, status."""
    probes = image.array["probes"]
    yield from (probes[k : k + 4] for k in range(0, len(probes), 4))
    if board is None:
        return
    header = (board / f"vectors_{name}.h").read_text(encoding="ascii")
    number = {k: int(v, 0) for k, v in re.findall(r"#define VECTORS_(\w+) \(?(-?\w+?)U?L\)?(?:\s|$)", header)}
    direct = re.search(rf"vectors_{image.numeric}_direct.*?= \{{(.*?)\n\}};", header, re.S)
    text = (board / "answers.txt").read_text(encoding="ascii")
    lines = re.search(rf"begin {image.numeric} \w+\n((?:\w{{8}} \w{{8}}\n)+)", text)
    if direct is None or lines is None:
        raise Unreadable(f"{board}: no {image.numeric} answers")
    inputs = [[int(w, 16) for w in pair] for pair in re.findall(r"0x(\w{8})UL, 0x(\w{8})UL", direct[1])]
    x = number["SEED"]
    for _ in range(number["RANDOM"]):
        pair = []
        for low, span, fraction in (("T_LOW", "T_SPAN", 12), ("S_LOW", "S_SPAN", 16)):
            x ^= x << 13 & 0xFFFFFFFF
            x ^= x >> 17
            x ^= x << 5 & 0xFFFFFFFF
            n = number[low] + (x * number[span] >> 32)
            as_bits = struct.pack("<f", n * 2.0**-fraction) if image.numeric == "f32" else None
            pair.append(struct.unpack("<I", as_bits)[0] if as_bits else n << 16 - fraction & 0xFFFFFFFF)
        inputs.append(pair)
    results = [[int(w, 16) for w in line.split()] for line in lines[1].splitlines()]
    yield from ([*pair, bits, status] for pair, (status, bits) in zip(inputs, results[1:], strict=False))


def check_record(c: Path, model: Model, record: dict[str, Any]) -> Iterator[str]:
    """The record of the emission: of this model, and of files with these hashes."""
    if record["model_hash"] != model.hash:
        yield "emission.json names another model's hash"
    for name, digest in record["files"].items():
        if hashlib.sha256((c / name).read_bytes()).hexdigest() != digest:
            yield f"{name} is not the file that emission.json names"


def check(folder: Path, board: Path | None) -> list[str]:
    """Everything that is wrong with an emitted folder, and with the answers of its board test if given."""
    model = Model(folder / "model.json")
    name = model.id()
    c = folder / "c"
    header = (c / f"gtc_{name}.h").read_text(encoding="ascii")
    wrong = [] if model.hash in header else ["the header names another model's hash"]
    if model.checksum != model.hash:
        wrong.append("the checksum of model.json is not that of its other fields")
    record = json.loads((c / "emission.json").read_text(encoding="ascii"))
    wrong += check_record(c, model, record)
    zero_at = record["zero_at_c"]
    model.shift = 0.0 if zero_at is None else model.bias(zero_at, 0.0)
    for image in images_of(c, name):
        printed = re.search(rf"\* {image.numeric}: .*\|error\| <= (\S+) deg/h", header)
        if printed is None:
            raise Unreadable(f"the header prints no bound of {image.numeric}")
        bound = float(printed[1])
        found = [
            *check_files(c, name, image),
            *check_members(model, image, name),
            *check_regions(model, image),
            *check_terms(model, image),
            *check_fallback_models(model, image, header),
            *check_sigma(model, image),
            *check_authority(model, image, bound),
            *check_header(model, image, name, header),
            *check_bound(model, bound),
            *check_map(model, image, bound),
        ]
        for words in known_answers(board, name, image):
            found += check_answer(model, image, words, bound)
        wrong += [f"{image.where}: {text}" for text in found]
    return wrong


def main() -> int:
    if len(sys.argv) not in (2, 3):
        print(__doc__, file=sys.stderr)
        return 2
    try:
        wrong = check(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) == 3 else None)
    except (OSError, Unreadable, ArithmeticError, ValueError, KeyError, TypeError, StopIteration) as error:
        print(f"check_table: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    for text in wrong[:20]:
        print(text)
    print(f"{len(wrong)} differences" if wrong else "the tables are the model")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
