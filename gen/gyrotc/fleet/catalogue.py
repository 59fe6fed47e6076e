"""The catalogue of a fleet: every calibration of every gyro in SQLite, tables and models under their hashes.

Calibrations are only ever added; a payload is written once and never changed. `docs/fleet.md` documents the
tables for other programs.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from .. import __version__
from ..common.errors import CheckFailed, GyrotcError, InputError
from ..jobs.release import unit_of
from ..model import DataFile, Model, load_model
from ..results.base import read_optional
from ..results.files import check_own, digest_of, open_or_create, write_own
from ..results.fleet import CatalogueAnswer, Catalogued, CataloguedFile, FleetEntry, FleetSummary
from ..results.folder import result_folder, share_by_hash
from ..results.marker import KINDS, faults, marker_of, read_marker, sha256
from ..tables.emit import image_of
from ..tables.quantise import NUMERICS, quantise
from ..verify.emitted import left_out_of, made_again, texts_again
from .unit import ENTRY, PAYLOADS

CATALOGUE = "catalogue"
_FILE = "catalogue.sqlite"
_EXPECTED = "a catalogue as gyrotc fleet wrote it"
_VERSION = 2  # of the tables below
_APPLICATION = 0x47544331  # "GTC1", so that `file` and gyrotc know the file
_MAGIC, _HEAD_BYTES, _APPLICATION_AT = b"SQLite format 3\0", 100, 68  # sqlite.org/fileformat2.html, 1.3
_BESIDE = {"-journal": bytes.fromhex("d9d505f920a163d7"), "-wal": bytes.fromhex("377f06")}  # 3 and 4.1 there
_MOST_S = 60.0  # a catalogue of 100,000 gyros is read in seconds
_STEPS = 100_000  # of SQLite's machine between two looks at the clock: milliseconds
_MOST_ROWS = 100  # calibrations of a whole catalogue: a screen or two

SCHEMA = """
CREATE TABLE calibration (
  id            INTEGER PRIMARY KEY,
  serial        TEXT NOT NULL,
  axis          TEXT NOT NULL,            -- x, y, z; empty where the recordings have one rate
  valid_from    TEXT,                     -- day of the calibration, ISO 8601; null: not stated
  valid_until   TEXT,                     -- last day; null: until the next calibration
  tag           TEXT NOT NULL DEFAULT '', -- withdrawn: may not be carried
  status        TEXT NOT NULL,            -- done, failed
  verdict       TEXT,                     -- PASS, CONDITIONAL PASS, FAIL; null without limits
  model_hash    TEXT,                     -- null where a failed job made no model: so are both payloads
  image_sha256  TEXT,                     -- payload
  model_sha256  TEXT,                     -- payload
  input_sha256  TEXT NOT NULL,            -- over recordings, options, limits and program
  after_rms_dph REAL,
  expanded_dph  REAL,                     -- U of the compensated bias
  folder        TEXT NOT NULL,
  row_sha256    TEXT NOT NULL DEFAULT '', -- over the columns above, its recordings and the row before of this axis
  UNIQUE (serial, axis, input_sha256, model_hash)
);
CREATE TABLE recording (
  calibration INTEGER NOT NULL REFERENCES calibration (id),
  file        TEXT NOT NULL,
  role        TEXT NOT NULL,
  sha256      TEXT NOT NULL,
  PRIMARY KEY (calibration, file, role, sha256)
) WITHOUT ROWID;
CREATE TABLE newest (
  serial TEXT NOT NULL,
  axis   TEXT NOT NULL,
  sha256 TEXT NOT NULL,                   -- row_sha256 of the row that was entered last
  PRIMARY KEY (serial, axis)
) WITHOUT ROWID;
CREATE INDEX of_serial ON calibration (serial, axis, valid_from);
"""

_CARRIED = """
SELECT * FROM calibration AS c
WHERE serial = :serial AND valid_from <= :day AND (valid_until IS NULL OR valid_until >= :day)
  AND status = 'done' AND coalesce(verdict, '') <> 'FAIL' AND tag <> 'withdrawn'
  AND NOT EXISTS (
    SELECT 1 FROM calibration AS later
    WHERE later.serial = c.serial AND later.axis = c.axis AND later.valid_from <= :day AND later.tag <> 'withdrawn'
      AND (later.valid_from, later.id) > (c.valid_from, c.id))
ORDER BY axis
"""


def enter(out: Path, entries: Sequence[FleetEntry], tag: str = "") -> int:
    """Adds what a fleet has made and the catalogue does not have yet; returns how many calibrations that are.

    A calibration that failed is one, with a model or without: no earlier table of the gyro is valid after it.
    Gyros under one serial are not distinguished by it, so none of them is entered; nor is one that a finding in
    `fleet.json` bars. Of one that is released nevertheless the reason goes into its tag.

    Args:
        out: The fleet's folder; each entry's result lies in the folder of its name.
        tag: Goes with each that is added.

    Raises:
        InputError: The file there is no catalogue, or is damaged.
        GyrotcError: It cannot be written.
    """
    counts = Counter((entry.serial, entry.axis) for entry in entries)
    summary = read_optional(out / "fleet.json", FleetSummary)
    barred = {unit.name for unit in summary.serials if unit.barred} if summary else set()
    made = [e for e in entries if e.key and e.serial and counts[e.serial, e.axis] == 1 and e.name not in barred]
    place = out / CATALOGUE
    if not made and not place.exists():
        return 0
    place.mkdir(exist_ok=True)
    with opened(place / _FILE) as base:
        known: dict[tuple[str, str, str], set[str | None]] = {}
        for *inputs, model_hash in base.execute("SELECT serial, axis, input_sha256, model_hash FROM calibration"):
            known.setdefault(tuple(inputs), set()).add(model_hash)
        added = 0
        with base:  # one transaction
            for one in made:
                # What came of it is not in the catalogue: no model of the same inputs, or none but failures
                of_inputs = known.get((one.serial or "", one.axis or "", one.key or ""), set())
                if not of_inputs or (one.model_hash is not None and of_inputs == {None}):
                    released = f"{tag}; released: {one.released}".removeprefix("; ")
                    added += _add(base, out, one, released if one.released else tag)
        return added


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """A catalogue, to be written to; one that is none yet is made."""
    _check_file(path)
    try:
        with closing(sqlite3.connect(path)) as base:
            _confine(base)
            if base.execute("PRAGMA user_version").fetchone()[0] == 0:
                with base:
                    base.executescript(
                        f"BEGIN; PRAGMA application_id = {_APPLICATION}; PRAGMA user_version = {_VERSION}; {SCHEMA}"
                    )
            _check_schema(base, path)
            yield base
    except sqlite3.OperationalError as error:  # the disk, a lock
        raise GyrotcError(f"{path}: {error}") from error
    except sqlite3.DatabaseError as error:
        raise InputError(str(path), f"is no catalogue ({error})", "a catalogue as gyrotc fleet wrote it") from error


def _confine(base: sqlite3.Connection) -> None:
    """No function of a foreign schema runs, and no statement for ever: a view may count without an end."""
    base.execute("PRAGMA trusted_schema = 0")
    end = time.monotonic() + _MOST_S
    base.set_progress_handler(lambda: int(time.monotonic() > end), _STEPS)


def _check_schema(base: sqlite3.Connection, path: Path) -> None:
    """The tables and the index are those of gyrotc, and there is nothing else: no view, no trigger."""
    text = "SELECT type, name, sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY name"
    with closing(sqlite3.connect(":memory:")) as empty:
        empty.executescript(SCHEMA)
        wanted = empty.execute(text).fetchall()
    application, version = (base.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
    if application == _APPLICATION and 0 < version < _VERSION:
        raise InputError(str(path), f"is of an earlier gyrotc (version {version})", "a new --out of gyrotc fleet")
    if application != _APPLICATION or base.execute(text).fetchall() != wanted:
        raise InputError(str(path), "has other tables than a catalogue", _EXPECTED)


def _check_file(path: Path) -> None:
    """Refuses what is no catalogue of gyrotc before SQLite, which follows links, opens it; none yet is made empty.

    So that SQLite takes a journal for what it is, that must be one, too: another file of that name would be deleted.
    """
    handle, _ = open_or_create(path)
    try:
        head = os.pread(handle, _HEAD_BYTES, 0)
    finally:
        os.close(handle)
    wanted = _MAGIC, _APPLICATION.to_bytes(4, "big")
    if head and (head[: len(_MAGIC)], head[_APPLICATION_AT : _APPLICATION_AT + 4]) != wanted:
        raise InputError(str(path), "is no catalogue", "a catalogue as gyrotc fleet wrote it")
    for end, magic in _BESIDE.items():
        beside = path.with_name(path.name + end)
        if beside.exists() or beside.is_symlink():
            check_own(beside)
            with beside.open("rb") as stream:
                if stream.read(len(magic)) not in (b"", bytes(len(magic)), magic):
                    raise InputError(str(beside), f"is none of SQLite's {end[1:]} files", "none; move it away")


def _add(base: sqlite3.Connection, out: Path, entry: FleetEntry, tag: str) -> int:
    """Enters one result: payloads first, so that no row names what is not there; 0 where its folder has gone."""
    row = {
        "serial": entry.serial, "axis": entry.axis or "", "valid_from": entry.date[:10] if entry.date else None,
        "valid_until": None, "tag": tag, "status": entry.status, "verdict": entry.verdict,
        "model_hash": entry.model_hash, "image_sha256": None, "model_sha256": None, "input_sha256": entry.key,
        "after_rms_dph": entry.after_rms_dph, "expanded_dph": None, "folder": entry.name,
    }  # fmt: skip
    data: Sequence[DataFile] = ()
    if entry.model_hash is not None:
        folder = out / entry.name
        if not (folder / ENTRY).is_file():  # a name with bytes that are no character lies elsewhere
            return 0
        unit = unit_of(folder)
        if (unit.decision, unit.model.hash) != (entry.verdict, entry.model_hash):
            found = "is not what the other results give"
            raise InputError(str(folder / ENTRY), found, "a result as fleet wrote it")
        data = unit.model.data
        row["image_sha256"] = share_by_hash(out / PAYLOADS, folder / "c" / f"gtc_{unit.model.id}.bin").name
        row["model_sha256"] = share_by_hash(out / PAYLOADS, folder / "model.json").name
        if unit.budget:
            row |= {"valid_until": unit.budget.valid_until, "expanded_dph": unit.budget.expanded_dph}
    places = ", ".join(f":{name}" for name in row)
    serial = entry.serial or ""
    _check_rows(base, out / CATALOGUE / _FILE, serial)
    number = base.execute(f"INSERT INTO calibration ({', '.join(row)}) VALUES ({places})", row).lastrowid
    files = {(number, d.file, d.role, d.sha256) for d in data}
    base.executemany("INSERT INTO recording VALUES (?, ?, ?, ?)", sorted(files))
    hash_rows(base, serial)
    return 1


def _hashes(base: sqlite3.Connection, serial: str) -> Iterator[tuple[int, str, str, str]]:
    """Of each row of a gyro in order: id, axis, the hash that it states, and the one that it should state.

    Each goes on from that of the row before: a row that was changed, taken away or moved shows in all after it.
    """
    last: dict[str, str] = {}
    for *columns, stated in base.execute("SELECT * FROM calibration WHERE serial = ? ORDER BY id", (serial,)):
        number, axis = columns[0], columns[2]
        files = base.execute(
            "SELECT file, role, sha256 FROM recording WHERE calibration = ? ORDER BY 1, 2, 3", (number,)
        )
        last[axis] = digest_of([columns, [list(file) for file in files], last.get(axis, "")])
        yield number, axis, stated, last[axis]


def hash_rows(base: sqlite3.Connection, serial: str) -> None:
    """Enters the hashes of a gyro's rows anew."""
    for number, axis, _, hash_ in list(_hashes(base, serial)):
        base.execute("UPDATE calibration SET row_sha256 = ? WHERE id = ?", (hash_, number))
        base.execute("INSERT OR REPLACE INTO newest VALUES (?, ?, ?)", (serial, axis, hash_))


def _check_rows(base: sqlite3.Connection, path: Path, serial: str) -> None:
    """Refuses rows of a gyro that are not as they were entered: a hash finds an edit, not who makes it again, too.

    Raises:
        InputError: They are not.
    """
    newest = {}
    for _, axis, stated, hash_ in _hashes(base, serial):
        if stated != hash_:
            raise InputError(str(path), f"a row of {serial} is not as it was entered", _EXPECTED)
        newest[axis] = hash_
    if newest != dict(base.execute("SELECT axis, sha256 FROM newest WHERE serial = ?", (serial,)).fetchall()):
        raise InputError(str(path), f"rows of {serial} are missing, or are not its own", _EXPECTED)


def withdraw(place: Path, model_hash: str) -> int:
    """Marks the calibrations of a model as withdrawn; returns how many there are.

    Args:
        place: A fleet's folder, or the catalogue's file.

    Raises:
        InputError: There is no catalogue, it is damaged, or no calibration of this model is in it.
    """
    path = _file_of(place)
    with opened(path) as base, base:
        of_model = "SELECT DISTINCT serial FROM calibration WHERE model_hash = ?"
        serials = [serial for (serial,) in base.execute(of_model, (model_hash,)).fetchall()]
        for serial in serials:
            _check_rows(base, path, serial)
        count = base.execute("UPDATE calibration SET tag = 'withdrawn' WHERE model_hash = ?", (model_hash,)).rowcount
        for serial in serials:
            hash_rows(base, serial)
    if not count:
        raise InputError("--withdraw", repr(model_hash), "the hash of a model in this catalogue")
    return count


def _file_of(place: Path) -> Path:
    path = place if place.is_file() else place / CATALOGUE / _FILE
    if not path.is_file():
        raise InputError(str(place), "has no catalogue", "the --out of gyrotc fleet")
    return path


def catalogued(place: Path, serial: str | None, day: str | None) -> CatalogueAnswer:
    """What a gyro may carry on a day; without a serial the calibrations that were entered last.

    Args:
        place: A fleet's folder, or the catalogue's file.
        day: ISO 8601.

    Raises:
        InputError: There is no catalogue, or it is damaged.
    """
    path = _file_of(place)
    query = _CARRIED if serial else f"SELECT * FROM calibration ORDER BY id DESC LIMIT {_MOST_ROWS}"
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as base:
            _confine(base)
            _check_schema(base, path)
            base.row_factory = sqlite3.Row
            rows = base.execute(query, {"serial": serial, "day": day}).fetchall()
            for one in {serial} if serial else {row["serial"] for row in rows}:
                _check_rows(base, path, one)
            found = tuple(_entry(base, row) for row in rows)
            for one in found if serial else ():
                _check_payloads(path.parent / Path(PAYLOADS).name, one)
            total = base.execute("SELECT coalesce(max(id), 0) FROM calibration").fetchone()[0]
    except sqlite3.DatabaseError as error:
        raise InputError(str(path), f"is no catalogue ({error})", "a catalogue as gyrotc fleet wrote it") from error
    return CatalogueAnswer(
        gyrotc_version=__version__, serial=serial, axis=None, day=day if serial else None, calibrations=total,
        found=found,
    )  # fmt: skip


def _check_payloads(place: Path, one: Catalogued) -> None:
    """What a gyro may carry is there, and is what its row says.

    Raises:
        InputError: It is not.
    """
    image, text = (place / known[:2] / known for known in (one.image_sha256 or "", one.model_sha256 or ""))
    for path in (image, text):
        if not path.is_file() or sha256(path) != path.name:
            raise InputError(str(path), "is missing or not what its name says", _EXPECTED)
    model = load_model(text)
    if (model.serial, model.axis, model.hash) != (one.serial, one.axis, one.model_hash):
        raise InputError(str(text), f"is not the model that the catalogue names for {one.serial}", _EXPECTED)
    if image.read_bytes() not in _images(model):
        raise InputError(str(image), f"is not the image that {text.name} gives", _EXPECTED)


def _images(model: Model) -> Iterator[bytes]:
    """The image of a model in each arithmetic that it is emitted in."""
    for numeric in NUMERICS:
        with suppress(CheckFailed):  # refused for this model
            yield image_of(quantise(model, numeric))


def export(place: Path, serial: str, day: str, out: Path) -> tuple[Catalogued, ...]:
    """Writes what a gyro may carry on a day as one complete folder, as `build` leaves it.

    Args:
        place: A fleet's folder, or the catalogue's file.
        day: ISO 8601.
        out: The folder; of a gyro of several axes one in it for each.

    Returns:
        As `catalogued`; where that is nothing, nothing is written.

    Raises:
        InputError: As `catalogued`; a result is not as the fleet wrote it, or was replaced by that of another
            calibration; `out` is taken, as of `result_folder`.
    """
    found = catalogued(place, serial, day).found
    fleet = place.resolve().parents[1] if place.is_file() else place
    for one in found:
        folder = fleet / one.folder
        wrong = faults(folder)
        if wrong:
            raise InputError(str(folder), wrong[0], "a result as gyrotc fleet wrote it")
        if load_model(folder / "model.json").hash != one.model_hash:
            raise InputError(str(folder), "holds another calibration than the catalogue names", "the fleet of that one")
        _copy(folder, out / one.axis if one.axis and len(found) > 1 else out, one)
    return found


def _copy(folder: Path, out: Path, one: Catalogued) -> None:
    """A result with the files that its fleet did not keep."""
    model = load_model(folder / "model.json")
    options, emission = made_again(folder / "c", model)
    left_out = left_out_of(folder, model, texts_again(model, options, emission))
    with result_folder(out, "fleet", kind=KINDS["build"], inputs=[folder]) as stage:
        stage.of(one.serial, one.axis)
        for name in (read_marker(folder) or marker_of()).files:
            target = stage.folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            write_own(target, (folder / name).read_bytes())
        for name, data in left_out.items():
            write_own(stage.folder / "c" / name, data)


def _entry(base: sqlite3.Connection, row: sqlite3.Row) -> Catalogued:
    names = [name for name in Catalogued.model_fields if name not in ("axis", "recordings")]
    files = base.execute("SELECT file, role, sha256 FROM recording WHERE calibration = ? ORDER BY file", (row["id"],))
    recordings = tuple(CataloguedFile(file=f["file"], role=f["role"], sha256=f["sha256"]) for f in files)
    return Catalogued(**{name: row[name] for name in names}, axis=row["axis"] or None, recordings=recordings)
