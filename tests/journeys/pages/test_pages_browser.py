"""Pages in a real browser: nothing complains, phones, dark rooms, paper, and readers of screens are served."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import Browser, browser
from conftest import HOST, Command
from recordings import columns, toml, write_csv

PAGES = ("unit", "axes", "fleet", "diagnosis")

_CONTRAST = """(() => {
  const channel = v => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4 };
  const parse = c => { const m = c.match(/[\\d.]+/g).map(Number); return {r: m[0], g: m[1], b: m[2], a: m[3] ?? 1} };
  const light = c => 0.2126 * channel(c.r) + 0.7152 * channel(c.g) + 0.0722 * channel(c.b);
  const ground = e => {
    for (; e; e = e.parentElement) {
      const c = parse(getComputedStyle(e).backgroundColor);
      if (c.a === 1) return c;
    }
    return {r: 255, g: 255, b: 255};
  };
  const poor = [];
  for (const e of document.querySelectorAll('body *')) {
    const own = [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
    if (e.closest('svg, script, style') || !own || !e.getClientRects().length) continue;
    const style = getComputedStyle(e), a = light(parse(style.color)), b = light(ground(e));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), size = parseFloat(style.fontSize);
    const least = size >= 24 || (size >= 18.66 && style.fontWeight >= 700) ? 3 : 4.5;
    if (ratio < least) poor.push(e.tagName + ' ' + e.textContent.trim().slice(0, 30) + ' ' + ratio.toFixed(2));
  }
  return poor;
})()"""  # WCAG 2.2, 1.4.3, level AA

_HEADINGS = "[...document.querySelectorAll('h1,h2,h3,h4')].map(e => Number(e.tagName[1]))"


def _axis(folder: Path, names: str, seed: int, shift: float = 0.0) -> None:
    rows = columns(720, seed=seed)
    table = {name: rows[name] for name in ("time_s", "temperature_c")}
    rates = dict.fromkeys(names.split(), rows["rate_dph"] - 20.0 + shift)
    write_csv(folder / "run-01.csv", table | rates)
    serial = f'schema = 1\nserial = "{folder.name}"\nearth_rate = "none"'
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=serial))


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory, gyrotc: Command) -> dict[str, Path]:
    """A unit that fails and was calibrated before, one with axes of which one fails, and a fleet."""
    folder = tmp_path_factory.mktemp("pages")
    limits = folder / "product.toml"
    limits.write_text('schema = 1\nproduct = "NAV"\n[at_most]\nrms_dph = 1.0\ntable_bytes = 20\n')
    build = ("build", *HOST, "--limits", limits)
    _axis(folder / "a" / "RLG-1", "rate_dph", 1)
    gyrotc(*build, folder / "a" / "RLG-1", "--out", folder / "before")
    _axis(folder / "b" / "RLG-1", "rate_dph", 2, shift=0.01)
    gyrotc(*build, folder / "b" / "RLG-1", "--out", folder / "unit", "--previous", folder / "before")
    _axis(folder / "c" / "IMU-1", "rate_x_dph rate_y_dph", 3)
    gyrotc(*build, folder / "c" / "IMU-1", "--axis", "all", "--out", folder / "axes")
    for k in range(3):
        _axis(folder / "d" / f"RLG-{k}", "rate_dph", 4 + k)
    gyrotc("fleet", folder / "d", "--out", folder / "fleet")
    found = {"unit": folder / "unit" / "report.html", "axes": folder / "axes" / "report.html"}
    gyrotc("diagnose", folder / "d" / "RLG-0", "--out", folder / "diagnosis")
    found |= {"diagnosis": folder / "diagnosis" / "report.html", "fleet": folder / "fleet" / "fleet.html"}
    assert [name for name, page in found.items() if not page.is_file()] == []
    return found


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("dark", [False, True])
def test_nothing_complains_and_text_can_be_read(name: str, dark: bool, pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages[name], dark=dark)
    assert tab.console == []
    assert tab.value(_CONTRAST) == []
    page = tab.value("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", page)[:3])) < 150) == dark


def test_the_contrast_check_can_fail(pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages["unit"])
    tab.value("document.querySelector('h1').style.color = '#bbb'")
    assert len(tab.value(_CONTRAST)) == 1


@pytest.mark.parametrize("name", PAGES)
def test_a_phone_scrolls_down_only(name: str, pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages[name], width=390, height=800)
    assert tab.value("document.documentElement.scrollWidth") == 390


_CUT = """[...document.querySelectorAll('svg text')].filter(t => {
  const box = t.getBoundingClientRect(), whole = t.ownerSVGElement.getBoundingClientRect();
  return box.width && (box.left < whole.left - 1 || box.right > whole.right + 1 || box.top < whole.top - 1 ||
    box.bottom > whole.bottom + 1);
}).map(t => t.textContent)"""  # words of pictures that do not lie within them


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [390, 1200])
def test_no_word_of_a_picture_is_cut_off(name: str, width: int, pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages[name], width=width)
    assert tab.value("document.querySelectorAll('svg text').length") > 10
    assert tab.value(_CUT) == []


@pytest.mark.parametrize("name", ["unit", "fleet"])
def test_on_a_phone_verdicts_and_reasons_are_whole(name: str, pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages[name], width=390, height=800)
    cells = "[...document.querySelectorAll('.stack td')].filter(e => e.getClientRects().length)"
    assert tab.value(cells + ".length") > 10
    assert tab.value(cells + ".filter(e => e.getBoundingClientRect().right > 390).length") == 0


def test_lines_of_pictures_are_seen_on_a_dark_screen(pages: dict[str, Path], tab: Browser) -> None:
    strokes = "[...document.querySelectorAll('svg .s-accent')].map(e => getComputedStyle(e).stroke)"
    found = {}
    for dark in (False, True):
        tab.open(pages["unit"], dark=dark)
        found[dark] = {sum(map(int, re.findall(r"\d+", one)[:3])) for one in tab.value(strokes)}
    assert max(found[False]) < 200 and min(found[True]) > 600


def test_a_part_of_a_fleets_picture_is_enlarged_and_comes_back(pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages["fleet"])
    svg = "document.querySelector('svg:has(.zoom)')"
    texts = f"[...{svg}.querySelectorAll('.numbers text')].filter(e => e.getClientRects().length)"
    numbers = texts + ".map(e => e.textContent)"
    tab.value(f"{svg}.scrollIntoView()")
    whole = tab.value(numbers)
    box = tab.value(
        f"(() => {{ const b = {svg}.getBoundingClientRect(); return [b.left, b.top, b.width, b.height] }})()"
    )
    x, y, w, h = box
    for kind, px, py in (("mousePressed", 0.4, 0.4), ("mouseMoved", 0.6, 0.6), ("mouseReleased", 0.6, 0.6)):
        tab.call(
            "Input.dispatchMouseEvent", type=kind, x=x + px * w, y=y + py * h, button="left", buttons=1, clickCount=1
        )
    near = tab.value(numbers)
    span = [float(t.replace("−", "-")) for t in near]
    assert near != whole and len(near) >= 4 and span == [float(f"{v:g}") for v in span]
    tab.value(f"{svg}.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Escape'}}))")
    assert tab.value(numbers) == whole and tab.console == []


@pytest.mark.parametrize("name", PAGES)
def test_landmarks_headings_and_names(name: str, pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages[name])
    nodes: list[dict[str, Any]] = tab.call("Accessibility.getFullAXTree")["nodes"]
    roles = [node["role"]["value"] for node in nodes if not node.get("ignored")]
    assert roles.count("banner") == roles.count("main") == 1
    levels = tab.value(_HEADINGS)
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels)), levels
    assert tab.value("[...document.querySelectorAll('th')].filter(e => !e.scope).length") == 0
    named = "[...document.querySelectorAll('[role=img],[role=region],input,select')]"
    assert tab.value(named + ".filter(e => !e.ariaLabel && !e.labels?.length).length") == 0
    # what scrolls on its own can be reached by the keyboard
    assert tab.value("[...document.querySelectorAll('.scroll')].filter(e => e.tabIndex < 0).length") == 0


@pytest.mark.parametrize("name", PAGES)
def test_no_key_stands_where_words_should(name: str, pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages[name])
    reported = "[...document.querySelectorAll('th, td, .label, .note, h2, h3, dt')]"
    text = tab.value(reported + ".filter(e => !e.matches('.mono, .name')).map(e => e.innerText).join('\\n')")
    assert not re.findall(r"\b[a-z]+_(?:[a-z]+_)*(?:dph|s|c|arcsec|bytes)\b|\brms dph\b|\['", text)


def test_the_unit_page_begins_with_the_verdict(pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages["unit"])
    text = tab.value("document.body.innerText")
    first = tab.value("document.querySelector('.verdict').innerText")
    assert first.startswith("FAIL for NAV") and "1 of 2 limits is not met" in first
    rows = tab.value("[...document.querySelectorAll('main table')][0].innerText")
    assert rows.index("FAIL") < rows.index("PASS"), "what failed stands first"
    assert "as found" in text and "as left" in text and "moved by" in text
    assert "a constant" in text and "about the mean" in text


def test_the_page_of_axes_tells_every_axis_with_its_messages(pages: dict[str, Path], tab: Browser) -> None:
    tab.open(pages["axes"])
    first = tab.value("document.querySelector('header').innerText")
    assert "FAIL" in first and "axis x: FAIL" in first
    for axis in "xy":
        section = tab.value(f"document.querySelector('#axis-{axis}').innerText")
        assert "FAIL" in section and "bytes" in section


@pytest.mark.parametrize("name", PAGES)
def test_paper(name: str, pages: dict[str, Path], tab: Browser) -> None:
    """It prints, on A4; axes begin on pages of their own, and no row of a table is cut."""
    tab.open(pages[name], dark=True)
    data = tab.printed()
    assert data.startswith(b"%PDF")
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data)
    assert boxes and all(abs(float(w) - 595) < 2 and abs(float(h) - 842) < 2 for w, h in boxes)
    sheets = len(re.findall(rb"/Type /Page\b", data))
    assert sheets >= (3 if name == "axes" else 1)
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert tab.value("getComputedStyle(document.querySelector('tr')).breakInside") == "avoid"
    assert tab.value("getComputedStyle(document.querySelector('h2')).breakAfter") == "avoid"
    assert tab.value("getComputedStyle(document.body).backgroundColor") in ("rgb(255, 255, 255)", "rgba(0, 0, 0, 0)")
