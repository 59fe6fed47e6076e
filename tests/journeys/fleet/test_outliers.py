"""A planted lot: each fault is named in words with its run; healthy gyros are left alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
import pytest
from gyrotc.common import Averages
from gyrotc.fleet import gyro_facts, reasons, step_in, summary_of
from gyrotc.results import Copy, FleetEntry, Reason
from lot import AXES, FAULTS, Lot

MEANS = 5  # rows of a mean: 100 s


def entries(lot: Lot) -> Iterator[FleetEntry]:
    """Entries as a fleet makes them; a cubic in T stands for the map."""
    for name, runs in lot.runs.items():
        means = [{k: v.reshape(-1, MEANS).mean(axis=1) for k, v in run.items()} for run in runs]
        for axis in AXES:
            t = np.concatenate([run["temperature_c"] for run in means])
            rate = np.concatenate([run[f"rate_{axis}_dph"] for run in means])
            fit = np.polynomial.Polynomial.fit(t, rate, 3)
            reported = [
                Averages(
                    run["time_s"], r := run[f"rate_{axis}_dph"], r - fit(run["temperature_c"]), run["temperature_c"]
                )
                for run in means
            ]
            facts = gyro_facts([(f"run-{k:02d}.csv", a) for k, a in enumerate(reported, 1)])
            spikes = sum(int((np.abs(np.diff(run[f"rate_{axis}_dph"])) > 0.04).sum()) // 2 for run in runs)
            yield FleetEntry(
                name=f"{name}-{axis}", dataset=name, axis=axis, status="done", facts=facts, rows_left_out=spikes
            )


def planted(seed: int, faults: tuple[str, ...]) -> tuple[Lot, dict[str, Reason]]:
    lot = Lot(seed, 20)
    for fault, unit in zip(faults, lot.draw.permutation(lot.units), strict=False):
        lot.plant(fault, str(unit))
    copied = []
    if names := sorted(lot.planted.get("copy_of_other", ())):
        one, other = names[0], names[-1]
        copied = [
            Copy(name=one[:-1] + a, serial=one[:-2], other=other[:-1] + b, other_serial=other[:-2], share=1.0)
            for a in AXES
            for b in AXES
        ]
    return lot, {reason.name: reason for reason in reasons(list(entries(lot)), copied)}


def test_each_planted_fault_is_named_and_no_healthy_gyro() -> None:
    draws, named, accused = 4, dict.fromkeys(FAULTS, 0), 0
    for seed in range(draws):  # fixed: one small step in twenty is missed by chance
        lot, found = planted(seed, FAULTS)
        for fault, names in lot.planted.items():
            named[fault] += all(name in found and found[name].id == fault for name in names)
        accused += len(set(found) - set().union(*lot.planted.values()))
    assert all(count >= draws - 1 for count in named.values()), named
    assert accused <= 1


def test_words_with_run_and_time() -> None:
    lot, found = planted(5, FAULTS)
    reported = {fault: found[sorted(names)[0]] for fault, names in lot.planted.items()}
    file, time_s = lot.step
    assert reported["step"].file == file
    assert reported["step"].time_s == pytest.approx(time_s, abs=600.0)
    assert f"step in {file} at " in reported["step"].text
    assert "mirror image of that of the other" in reported["sign_reversed"].text
    assert "shows what" in reported["axes_exchanged"].text
    assert "copy of another unit" in reported["copy_of_other"].text
    assert reported["copy_of_other"].text.endswith(reported["copy_of_other"].name[-2:]), "the other's same axis"


def test_the_picture_of_a_noisy_gyro_shows_the_run_that_is_named() -> None:
    """Before: the words named one run, and the picture was of another."""
    lot = Lot(5, 12)
    lot.plant("noise", lot.units[3])
    [name] = lot.planted["noise"]
    one_run = f"{lot.units[7]}-x"
    run = lot.runs[lot.units[7]][4]
    run["rate_x_dph"] = run["rate_x_dph"] + 8e-3 * lot.draw.normal(size=run["time_s"].size)
    made = list(entries(lot))
    found = {reason.name: reason for reason in reasons(made, [])}
    series = {entry.name: entry.facts.series.file for entry in made if entry.facts and entry.facts.series}
    assert found[name].file == series[name] and f"such as {series[name]}" in found[name].text
    assert found[one_run].file == series[one_run] == "run-05.csv" and "in run-05.csv" in found[one_run].text


def test_exchanged_axes_stand_apart_in_what_the_fleet_says() -> None:
    """Two columns of one unit changed places: both axes are named with what they show, and both have the finding."""
    lot = Lot(6, 12)
    lot.plant("axes_exchanged", lot.units[4])
    figured = [e.model_copy(update={"serial": e.dataset, "model_hash": "0"}) for e in entries(lot)]
    summary = summary_of(figured)
    (wrong,) = lot.planted.values()
    assert {reason.name: reason.id for reason in summary.reasons} == dict.fromkeys(wrong, "axes_exchanged")
    for unit in summary.serials:
        assert ("axes_exchanged" in unit.findings) == (unit.name in wrong)
        assert (unit.outlier_reason is None) == (unit.name not in wrong)
    one, other = sorted(name[-1] for name in wrong)
    reported = next(reason.text for reason in summary.reasons if reason.name.endswith(f"-{one}"))
    assert reported == f"axes exchanged: {one} shows what {other} axes show, and {other} what {one} axes show"


def test_a_handful_of_gyros_accuses_nobody() -> None:
    lot = Lot(3, 7)
    lot.plant("sign_reversed", lot.units[0])
    assert reasons(list(entries(lot))) == []


def test_axes_are_compared_with_their_own_kind() -> None:
    """Before: with x, y and z in one heap nine healthy axes were named outliers."""
    assert reasons(list(entries(Lot(4, 10)))) == []


@pytest.mark.parametrize("amplitude", [3e-3, -1e-3])
def test_what_fades_after_a_power_on_has_its_amplitude(amplitude: float) -> None:
    """By least squares of numpy beside a constant; a run of half an hour does not show it."""
    time = 100.0 * (np.arange(72) + 0.5)
    fades = np.exp(-(time - time[0]) / 900.0)
    after = amplitude * fades + 5e-4 + 1e-4 * np.random.default_rng(3).normal(size=time.size)
    expected = np.linalg.lstsq(np.stack([fades, np.ones(time.size)], axis=1), after, rcond=None)[0][0]
    (run,) = gyro_facts([("a.csv", Averages(time, after, after, np.zeros(time.size)))]).runs
    assert run.warm_up_dph == pytest.approx(expected) == pytest.approx(amplitude, rel=0.2)
    short = Averages(time[:18], after[:18], after[:18], np.zeros(18))
    assert gyro_facts([("a.csv", short)]).runs[0].warm_up_dph == 0.0


def test_the_curve_of_a_gyro_goes_over_all_plausible_temperatures() -> None:
    """From -90 to 200 C in cells of 5 C: the mean bias in each, by pandas."""
    t = np.linspace(-89.5, 199.5, 5781)
    before = 1e-3 * t + 1e-5 * t**2
    a = Averages(100.0 * np.arange(t.size), before, 0.0 * before, t)
    expected = pd.Series(before).groupby(pd.cut(t, np.arange(-90.0, 201.0, 5.0), right=False), observed=True).mean()
    assert gyro_facts([("a.csv", a)]).curve == pytest.approx(expected.tolist())


def test_a_step_is_found_where_it_is() -> None:
    draw = np.random.default_rng(2)
    residual = draw.normal(size=200)
    residual[120:] += 3.0
    index, size, score = step_in(residual)
    assert abs(index - 120) <= 2 and size == pytest.approx(3.0, abs=0.6) and score > 10.0
    assert step_in(draw.normal(size=200))[2] < 6.0
    assert step_in(np.zeros(200)) == (0, 0.0, 0.0) and step_in(np.ones(3)) == (0, 0.0, 0.0)
