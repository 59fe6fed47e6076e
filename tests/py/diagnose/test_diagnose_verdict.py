"""Every verdict: when it is given, and in words."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gyrotc.cli.jobs import diagnosis_lines
from gyrotc.diagnose.discrepancy import NoiseFinding
from gyrotc.diagnose.misfit import Misfit
from gyrotc.diagnose.summary import VERDICTS, next_steps, verdict_of
from gyrotc.results.diagnosed import (
    ConsideredCause,
    Diagnosed,
    DiagnosisVerdict,
    Estimate,
    NamedCause,
    Unexplained,
)
from gyrotc.results.planned import DetectionLimit

NOISE = [NoiseFinding("noise_level", 1e-9, {"ratio": 2.0}, "the noise is twice the declared level")]


def attribution(**changes: Any) -> Any:
    """What `verdict_of` reads: one cause that explains everything, without rivals."""
    plain: dict[str, Any] = {
        "detected": True,
        "causes": (SimpleNamespace(plausible=True),),
        "p_values": (1e-3,),
        "rivals": ((),),
        "left": Misfit(0.5, 0.5, 1.0),
    }
    plain["other"] = SimpleNamespace(lead=-np.inf)
    return SimpleNamespace(**{**plain, **changes})


@pytest.mark.parametrize(
    ("verdict", "found", "noise"),
    [
        ("explained", attribution(), []),
        ("explained", attribution(), NOISE),
        ("ambiguous", attribution(rivals=(("hysteresis",),)), []),
        ("partial", attribution(left=Misfit(1e-4, 1e-4, 0.95)), []),
        ("partial", attribution(left=Misfit(1e-9, 1e-9, 0.85)), []),
        ("unexplained", attribution(left=Misfit(1e-9, 1e-9, 0.75)), []),
        ("unexplained", attribution(left=Misfit(1e-9, 1e-9, 0.3)), []),
        ("explained", attribution(left=Misfit(0.2, 1e-9, 0.95)), NOISE),
        ("unexplained", attribution(left=Misfit(0.2, 1e-9, 0.75)), NOISE),
        ("unexplained", attribution(causes=(SimpleNamespace(plausible=False),)), []),
        ("unexplained", attribution(p_values=(0.98,), left=Misfit(0.06, 0.06, 0.12)), []),
        ("unexplained", attribution(causes=(), rivals=()), []),
        ("unexplained", attribution(other=SimpleNamespace(lead=1e6)), []),
        ("noise_differs", attribution(detected=False, causes=(), rivals=()), NOISE),
        ("consistent", attribution(detected=False, causes=(), rivals=()), []),
    ],
)
def test_the_verdict_follows_from_what_was_found(verdict: str, found: Any, noise: list[NoiseFinding]) -> None:
    assert verdict_of(found, noise) == verdict


def result(verdict: DiagnosisVerdict) -> Diagnosed:
    cause = NamedCause(
        id="hysteresis", family="hysteresis", name="A loop", p_value=0.001, gain=None, signature="a loop",
        parameters={"width_c": Estimate(value=4.0, low=3.0, high=5.0)}, remedy="one play operator",
        equivalent=("turn_on_offset",) if verdict == "ambiguous" else (),
        separate_by="holds from both sides" if verdict == "ambiguous" else None,
    )  # fmt: skip
    causes = (cause,) if verdict in ("explained", "ambiguous", "partial") else ()
    considered = tuple(
        ConsideredCause(
            id=id, family="lag", p_value=0.5,
            detection_limit=DetectionLimit(value=value, unit=unit, parameter="tau_s", over=()),
        )
        for id, value, unit in (("warm_up", 1e-3, "deg/h"), ("cavity_lag", None, "s"))
    )  # fmt: skip
    return Diagnosed(
        gyrotc_version="0.1.0", serial="G1", axis=None, verdict=verdict, block_s=10.0, average_s=100.0,
        noise_floor_dph=1e-3, discrepancies=(), causes=causes, baseline=None, extended=None, considered=considered,
        missing=(), estimated_noise=None, measured_on="exam", single_cycle=None, shipping=None, unexplained=None,
        text="Finding.", meaning=VERDICTS[verdict], next=tuple(next_steps(verdict, causes, ["ageing"], shipped=False)),
    )  # fmt: skip


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_words_and_a_next_step(verdict: DiagnosisVerdict) -> None:
    text = "\n".join(diagnosis_lines(result(verdict)))
    assert text.startswith(f"G1: {verdict.replace('_', ' ')}. Finding.")
    assert VERDICTS[verdict] in text and "next: " in text
    assert "warm_up: 0.001 deg/h" in text and "cavity_lag: not visible" in text, "the detection limits"


def test_an_ambiguous_verdict_names_the_experiment() -> None:
    steps = next_steps("ambiguous", result("ambiguous").causes, [], shipped=True)
    assert steps == ["To tell them apart: holds from both sides."]


def test_what_no_table_holds_has_its_own_remedy() -> None:
    causes = result("explained").causes
    assert next_steps("explained", causes, [], shipped=False) == ["Against it: one play operator."]
    assert "build --extend" in next_steps("explained", causes, [], shipped=True)[0]


def test_structure_without_a_name_is_described() -> None:
    left = Unexplained(
        p_value=1e-6, share_explained=0.4, best_partial_match=("hysteresis",), looks_like="a switch"
    )
    text = "\n".join(diagnosis_lines(result("unexplained").model_copy(update={"unexplained": left})))
    assert "40%" in text and "it looks more like a switch" in text


def test_causes_without_an_extension_are_told_so() -> None:
    assert "no extension is shipped" in "\n".join(diagnosis_lines(result("explained")))
