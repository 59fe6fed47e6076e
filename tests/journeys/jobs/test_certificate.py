"""A certificate: what is missing is reported first, and page and DCC say the same digits."""

from __future__ import annotations

import re
from datetime import date, timedelta
from pathlib import Path
from xml.etree import ElementTree

import pytest
from gyrotc.assess import load_limits
from gyrotc.common import InputError
from gyrotc.jobs import certificate, laboratory_facts, missing_facts
from gyrotc.pages import certificate as printing
from gyrotc.pages import digits_of, unit_in
from gyrotc.recordings import load
from gyrotc.results import Manifest, read_result
from jobs import built_for_fleet
from recordings import columns, toml, write_csv

REASON = "kept for a test bench"
NAMES = {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}
LIMITS = """schema = 1
product = "NAV"
[at_most]
rms_dph = 30.0
centers = 40
[at_least]
improvement = 1e6
[interval]
days = 365
drift_dph_per_year = 1e-4
[[instrument]]
name = "Pt100 SN 71"
certificate = "K-4711"
quantity = "temperature"
expanded_uncertainty = 0.04
"""
FACTS = """schema = 1
laboratory = "North <& Sons>"
city = "Bremen"
country = "DE"
operator = "A. \\u0007Berg"
customer = "Navigation GmbH"
customer_city = "Kiel"
customer_country = "DE"
manufacturer = "Maker"
type = "RLG 90"
procedure = "WI-7.3"
environment = "23 C"
calibrated_on = CALIBRATED
""".replace("CALIBRATED", (date.today() - timedelta(days=30)).isoformat())


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unit")
    data, out = folder / "RLG-1", folder / "out"
    write_csv(data / "run-01.csv", columns(720, seed=1))
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    (data / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    (folder / "limits.toml").write_text(LIMITS)
    (folder / "facts.toml").write_text(FACTS)
    built_for_fleet(out, load(data), limits=load_limits(folder / "limits.toml"))
    return out


@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch) -> None:
    """No browser: the PDF has a test of its own."""
    monkeypatch.setattr(printing, "_BROWSERS", ())


@pytest.fixture
def made(built: Path, tmp_path: Path, paper: None) -> Path:
    facts = built.parent / "facts.toml"
    certificate(built, tmp_path / "cert", facts=facts, number="2026-0042", accept_fail=REASON)
    return tmp_path / "cert"


def results(made: Path) -> list[ElementTree.Element]:
    root = ElementTree.parse(made / "dcc.xml").getroot()
    return root.findall(".//dcc:result", NAMES)


def test_what_is_missing_is_listed_and_nothing_is_written(built: Path, tmp_path: Path, paper: None) -> None:
    with pytest.raises(InputError) as reported:
        certificate(built, tmp_path / "cert", accept_fail=REASON)
    for name in ("number", "laboratory", "operator", "customer_country", "calibrated_on"):
        assert f"{name} (" in str(reported.value)
    assert not (tmp_path / "cert").exists()
    certificate(built, tmp_path / "cert", draft=True, accept_fail=REASON)
    assert "Draft, not a certificate" in (tmp_path / "cert" / "certificate.html").read_text("utf-8")
    assert not (tmp_path / "cert" / "dcc.xml").exists()


def test_page_and_dcc_say_the_same_digits(made: Path) -> None:
    page = (made / "certificate.html").read_text("utf-8")
    figures = 0
    for result in results(made):
        real = result.find(".//si:real", NAMES)
        if real is None:
            continue
        value = real.findtext("si:value", "", NAMES).partition("e")
        spread = real.findtext("si:expandedUnc/si:uncertainty", "", NAMES).partition("e")
        assert f"{value[0]} ± {spread[0]}" in page, result.findtext("dcc:name/dcc:content", "", NAMES)
        assert f'<td class="n">{real.findtext("si:expandedUnc/si:coverageFactor", "", NAMES)}</td>' in page
        figures += 1
    assert figures == 3  # bias, RMS, improvement; centers are counted


def test_conformity_numbers_and_hashes_are_in_both(made: Path, built: Path) -> None:
    page = (made / "certificate.html").read_text("utf-8")
    text = (made / "dcc.xml").read_text("utf-8")
    stated = [r.findtext(".//dcc:conformity", "", NAMES) for r in results(made)]
    assert "fail" in stated and "pass" in stated and "FAIL" in page
    manifest = read_result(built / "manifest.json", Manifest)
    assert re.fullmatch("[0-9a-f]{64}", manifest.program)
    for fact in (REASON, "2026-0042", "K-4711", "North &lt;&amp; Sons&gt;", "A. &lt;U+0007&gt;Berg", manifest.program,
                 manifest.model_hash):  # fmt: skip
        assert fact in page and fact in text, fact


def test_who_states_no_thermometer_is_sent_to_the_data_set(
    built: Path, tmp_path: Path, paper: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A facts file refuses instruments, so nobody is asked to put one there."""
    unit = unit_in(built)
    assert unit.budget is not None
    unit.budget = unit.budget.model_copy(update={"instruments": ()})
    (line,) = missing_facts(laboratory_facts({}, built.parent / "facts.toml", "1"), [unit])
    assert (
        "[[meta.instrument]] of dataset.toml or as [[instrument]] of the limits file" in line and "build again" in line
    )
    (tmp_path / "facts.toml").write_text("schema = 1\n[[instrument]]\nname = 'Pt100'\n")
    with pytest.raises(InputError, match="instrument"):
        laboratory_facts({}, tmp_path / "facts.toml", None)


def test_a_folder_that_was_changed_gets_no_certificate(built: Path, tmp_path: Path, paper: None) -> None:
    table = next((built / "c").glob("gtc_rlg_1.c"))
    before = table.read_bytes()
    try:
        table.write_bytes(before + b"\n")
        with pytest.raises(InputError, match="is not as gyrotc wrote it"):
            certificate(built, tmp_path / "cert", draft=True)
    finally:
        table.write_bytes(before)


def test_the_facts_file_comes_before_meta_and_the_command_line_before_both(tmp_path: Path) -> None:
    (tmp_path / "facts.toml").write_text("schema = 1\noperator = 'B'\nnumber = '2'")
    found = laboratory_facts({"operator": "A", "customer": "C", "chamber": 3}, tmp_path / "facts.toml", "3")
    assert (found.operator, found.customer, found.number) == ("B", "C", "3")


def test_digits_are_those_that_the_uncertainty_says_something_of() -> None:
    found = digits_of(7.2134e-4, 2.512e-5)
    assert (found.value, found.spread, found.exponent) == ("7.21", "0.26", -4)
    assert found.page == "(7.21 ± 0.26)·10⁻⁴"
    assert float(found.decimal(found.value)) == 7.21e-4
    assert digits_of(10.65, 0.4).page == "10.65 ± 0.40"


def test_the_certificate_prints_on_two_pages(built: Path, tmp_path: Path) -> None:
    facts = built.parent / "facts.toml"
    found = certificate(built, tmp_path / "cert", facts=facts, number="1", accept_fail=REASON)
    assert found.pdf
    pdf = (tmp_path / "cert" / "certificate.pdf").read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 2
