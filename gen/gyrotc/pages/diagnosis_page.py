"""`report.html` of a diagnosis: one page from `diagnose.json` and the pictures beside it. Computes nothing new."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from ..common.errors import InputError
from ..common.opening import read_input
from ..common.texts import checked_svg
from ..results.base import read_result
from ..results.diagnosed import Diagnosed, GainOnUnseen
from .report import page_environment, page_from, write_page

__all__ = ["PICTURES", "is_diagnosis", "write_diagnosis_page"]

PICTURES = "pictures"


def is_diagnosis(folder: Path) -> bool:
    """Whether a folder holds a diagnosis (and not a build)."""
    return (folder / "diagnose.json").is_file() and not (folder / "evaluate.json").exists()


def write_diagnosis_page(folder: Path) -> Path:
    """Writes `folder/report.html` from what stands in the folder; returns its path.

    Raises:
        InputError: `diagnose.json` is missing, broken or of another kind.
    """
    result = read_result(folder / "diagnose.json", Diagnosed)
    with page_from(folder / "diagnose.json"):
        text = (
            page_environment()
            .get_template("diagnosis.html.j2")
            .render(
                d=result,
                physical=result.physical,
                noise=result.noise,
                gains=list(_gains(result)),
                limits=[c for c in result.considered if c.detection_limit],
                pictures=_pictures(folder, result),
            )
        )
    return write_page(folder, text)


def _pictures(folder: Path, result: Diagnosed) -> dict[str, Markup]:
    """Pictures by name; one that is missing is left out.

    Raises:
        InputError: One is more than a drawing.
    """
    here = {path.name: path for path in (folder / PICTURES).glob("*") if path.is_file()}
    found = {}
    names = (Path(name).name for name in result.pictures or ())
    for path in (here[name] for name in names if name in here):
        try:
            found[path.stem] = checked_svg(read_input(path, "result_mib", "a picture").decode("utf-8"))
        except ValueError as error:
            raise InputError(str(path), str(error), "a picture that diagnose drew") from error
    return found


def _gains(result: Diagnosed) -> list[tuple[str, GainOnUnseen]]:
    """Gain of the whole extension where it is shipped, else of every cause, by where it was measured."""
    seen = "exam runs" if result.measured_on == "exam" else "parts left out in turn, causes chosen anew"
    extended = result.extended
    if extended is None:
        return [(f"{seen}: {c.name[0].lower()}{c.name[1:]}", c.gain) for c in result.causes if c.gain]
    rows = [(seen, extended.gain)]
    if extended.rate_left_out:
        rows.append((f"“{extended.rate_left_out.environment}” left out", extended.rate_left_out))
    if extended.forward_in_time:
        rows.append(("forward in time", extended.forward_in_time))
    return rows
