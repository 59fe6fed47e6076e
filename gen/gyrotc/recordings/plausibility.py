"""Compare the values of a recording with their declared units.

Each test rests on what no gyro, no chamber and no thermometer does, not on what is usual; what merely looks odd
passes. Values in another unit than the declared one that break none of these bounds cannot be detected, and pass.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import cos, hypot, radians, sin

import numpy as np

from ..common.arrays import FloatArray
from ..common.inputs import PLAUSIBLE_C
from ..common.metrics import MAD_TO_SIGMA, median
from .description import Description, Layout, RunEntry
from .reading import Evidence, Recording
from .records import Curve, EarthRate, Run
from .units import Conversion

EARTH_RATE_DPH = 15.04106717866910  # 7.2921150e-5 rad/s (WGS 84), deg/h

EARTH_RATE_NOT_STATED = "the model may take Earth's rate for bias."
"""Ends what is said of a mean rate that could be Earth's."""
TRUSTED = "units are trusted: "
"""Begins what is said of values that contradict their units and were taken all the same."""
_LARGEST_DPH = 15.05  # of a component of Earth's rate, rounded up


def earth_rate_warning(stated: str | None, mean_dph: float) -> str:
    """Return a warning about a mean rate that could be Earth's if nothing is stated; empty if all is well."""
    if stated is not None or abs(mean_dph) > _LARGEST_DPH:
        return ""
    return (
        f"The mean rate is {mean_dph:.4g} deg/h, Earth's rate is up to 15.04 deg/h, and the data set does not "
        f"state earth_rate: {EARTH_RATE_NOT_STATED}"
    )


def earth_rate(
    latitude_deg: float, azimuth_deg: float, elevation_deg: float, *, latitude_sigma_deg: float, axis_sigma_deg: float
) -> EarthRate:
    """Component of Earth's rate along an axis: Ω (cos φ cos A cos E + sin φ sin E), and its uncertainty.

    Args:
        latitude_deg: φ, deg, north positive.
        azimuth_deg: A, of the axis, deg, clockwise from true north.
        elevation_deg: E, of the axis, deg, up from the horizontal.
        latitude_sigma_deg: Standard uncertainty of φ, deg.
        axis_sigma_deg: Standard uncertainty of the axis in each of the two directions across it, deg.

    Returns:
        Rate and standard uncertainty by first-order propagation, deg/h.
    """
    phi, a, e = radians(latitude_deg), radians(azimuth_deg), radians(elevation_deg)
    along = cos(phi) * cos(a) * cos(e) + sin(phi) * sin(e)
    by_latitude = -sin(phi) * cos(a) * cos(e) + cos(phi) * sin(e)
    by_azimuth = -cos(phi) * sin(a)  # turning the axis sideways by an angle turns its azimuth by that over cos E
    by_elevation = -cos(phi) * cos(a) * sin(e) + sin(phi) * cos(e)
    sigma = hypot(by_latitude * radians(latitude_sigma_deg), hypot(by_azimuth, by_elevation) * radians(axis_sigma_deg))
    return EarthRate(EARTH_RATE_DPH * along, EARTH_RATE_DPH * sigma)


_PLACE_C = 1.0  # what counts as the same temperature, as in `assess.findings`


def curves_of(
    description: Description, runs: Mapping[int, Run], recordings: Mapping[str, Recording]
) -> tuple[Curve, ...]:
    """The curve of every run, in their order.

    Args:
        runs: By their number in the description.
    """
    return tuple(_curve(run, recordings[run.file], description, description.run[index]) for index, run in runs.items())


def _curve(run: Run, recording: Recording, description: Description, entry: RunEntry) -> Curve:
    cells = recording.evidence.cells
    cells = cells[run.in_span(cells[:, 0])]
    place = np.round(cells[:, 1] / _PLACE_C)
    places, index = np.unique(place, return_inverse=True)
    count = np.bincount(index.reshape(-1), minlength=len(places))
    sums = [np.bincount(index.reshape(-1), column, minlength=len(places)) for column in cells[:, 2:].T]
    weight = run.pulse_weight_arcsec
    scale = 1.0 if weight is None else weight / run.row_period_s
    axes = tuple(recording.layout.axes)
    return Curve(
        file=run.file,
        from_s=run.from_s,
        role=run.role,
        axes=axes,
        temperature_c=_PLACE_C * places,
        rates_dph=scale * np.column_stack([s / count for s in sums]),
        cells=count,
        earth_dph=_earth(description, entry, axes),
    )


def _earth(description: Description, entry: RunEntry, axes: tuple[str, ...]) -> tuple[float, ...] | None:
    """Return Earth's rate along every axis, if it is to be computed and all angles are stated."""
    if description.earth_rate != "compute" or description.latitude_deg is None:
        return None
    found = []
    for axis in axes or ("",):
        angles = [_angle(entry.axis_azimuth_deg, axis), _angle(entry.axis_elevation_deg, axis)]
        if angles[0] is None or angles[1] is None:
            return None
        along = earth_rate(description.latitude_deg, angles[0], angles[1], latitude_sigma_deg=0.0, axis_sigma_deg=0.0)
        found.append(along.rate_dph)
    return tuple(found)


def _angle(stated: object, axis: str) -> float | None:
    value = stated.get(axis) if isinstance(stated, Mapping) else None if axis else stated
    return float(value) if isinstance(value, int | float) else None


_HOTTEST_C = 125.0  # upper end of the military range; beyond it are down-hole gyros, whose owners know
_FASTEST_C_PER_MIN = 30.0  # of a product's thermometer: chambers of stress screening move air by 15 to 30
_RISE_C = 5.0  # of a change that is looked at, in six steps of which none is nearly half of it
_STEPS = 6  # of temperature that a rise must last: a single wild reading has two
_LARGEST_STEP = 0.4  # share of the rise: of six even steps each is 0.17, of a jump one is nearly 1
_NEARLY = 0.999  # of a bound: a sum of six steps and the difference of the ends differ by rounding
_FLOWN = 5e-5  # deg/sqrt(h): the quietest gyros flown, hemispherical resonators and long coils of fibre
_QUIETEST = 0.1 * _FLOWN  # ten times quieter than the quietest gyro is no gyro
_NOISY = 6.0  # deg/sqrt(h), 0.1 deg/s/sqrt(Hz): the noisiest gyros sold, vibrating structures for cameras and toys
_AT_REST = 10.0  # times its noise in a data sheet: what chambers and cables do to a gyro at rest is less
_NOISIEST = _AT_REST * _NOISY  # beyond it is no gyro at rest
_QUIET_TAU_S = 100.0  # noise is looked at up to here; drift with temperature begins to count beyond
_FEWEST_CELLS = 30  # less is not judged
_HOT_SHARE = 0.02  # of the cells; a few wild readings say nothing of the unit
_TRIAD = 0.03  # relative; how near three means come to Earth's rate by chance is of this order
_ALONG = 0.1  # relative; a bias is that much of Earth's component
_SMALLEST_ALONG_DPH = 1.0  # deg/h: a smaller component of Earth's rate is not distinguished from a bias
# Units in which a rate or a time may really be, as a declaration may have got it wrong.
RATE_UNITS_DPH = {"deg/h": 1.0, "deg/s": 3600.0, "rad/s": 648000.0 / np.pi}
TIME_UNITS_S = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "day": 86400.0}


@dataclass(frozen=True, slots=True)
class Suspicion:
    """Values that their declared unit cannot explain.

    Attributes:
        kind: "time", "temperature" or "rate".
        column: The column.
        found: What the values look like.
        likely: The unit that would explain them; None: no usual one would.
    """

    kind: str
    column: str
    found: str
    likely: str | None

    @property
    def unit(self) -> str:
        """The unit to declare, in quotes; where none is known, what to look for."""
        scale = '"..." with the scale of the logger, such as "deg/s/131"'
        return f'"{self.likely}"' if self.likely is not None else scale


def suspicions(
    evidence: Evidence,
    layout: Layout,
    units: Mapping[str, Conversion],
    *,
    earth_stated: bool,
    noise: float | None = None,
) -> Iterator[Suspicion]:
    """Yield what contradicts the units of a file.

    Args:
        evidence: Of its rows, in gyrotc's units.
        layout: Its columns.
        units: Conversions that were made, by column; none: the names of the columns declare gyrotc's units.
        earth_stated: Whether the description says what was done about Earth's rate.
        noise: Declared angle random walk, deg/sqrt(h).
    """
    cells = evidence.cells
    if len(cells) < _FEWEST_CELLS:
        return
    yield from _of_temperature(evidence, layout.temperature, units)
    yield from _of_time(cells[:, 0], cells[:, 1], layout.time, units)
    if layout.pulses:
        return
    columns = list(layout.axes.values()) or [layout.value]
    found = None
    if len(columns) == 3 and not earth_stated:
        found = _of_triad(cells[:, 2:], columns[0], units)
    for k, column in enumerate(columns):
        if found is None and not evidence.stuck:
            found = _of_noise(cells[:, 0], cells[:, 2 + k], column, noise, units)
    if found is not None:
        yield found


def earth_suspicion(column: str, mean_dph: float, earth_dph: float, unit: Conversion | None) -> Suspicion | None:
    """A mean rate that is Earth's component along the axis, but in another unit."""
    if abs(earth_dph) < _SMALLEST_ALONG_DPH or mean_dph == 0.0:
        return None
    for likely, factor in _other_rates(unit):
        if abs(mean_dph * factor / earth_dph - 1.0) < _ALONG:
            found = (
                f"a mean of {mean_dph:.4g} deg/h{_as(unit)}; in {likely} it is Earth's rate along the axis, "
                f"{earth_dph:.4g} deg/h"
            )
            return Suspicion("rate", column, found, likely)
    return None


def _of_temperature(evidence: Evidence, column: str, units: Mapping[str, Conversion]) -> Iterator[Suspicion]:
    low, high = evidence.temperature_c
    unit = units.get(column)
    in_file = (low, high) if unit is None else (unit.back(low), unit.back(high))
    other = (np.array(in_file) - 32.0) / 1.8
    share = float(np.mean(evidence.cells[:, 1] > _HOTTEST_C))
    if share < _HOT_SHARE or not PLAUSIBLE_C[0] <= other[0] <= other[1] <= _HOTTEST_C:
        return
    found = (
        f"up to {high:.4g} C{_as(unit)}, beyond the {_HOTTEST_C:g} C that electronics stand; "
        f"in fahrenheit it is {other[0]:.1f} ... {other[1]:.1f} C"
    )
    yield Suspicion("temperature", column, found, "degF")


def _of_time(
    time: FloatArray, temperature: FloatArray, column: str, units: Mapping[str, Conversion]
) -> Iterator[Suspicion]:
    fastest = _sustained(time, temperature)
    if fastest <= _FASTEST_C_PER_MIN:
        return
    unit = units.get(column)
    declared = 1.0 if unit is None else unit.factor
    for likely, factor in TIME_UNITS_S.items():
        slower = fastest * declared / factor
        if slower <= _FASTEST_C_PER_MIN:
            found = (
                f"temperature changes by {fastest:.3g} C/min{_as(unit)}, faster than a chamber moves a gyro "
                f"({_FASTEST_C_PER_MIN:g}); in {likely} it is {slower:.3g} C/min"
            )
            yield Suspicion("time", column, found, likely)
            return


def _sustained(time: FloatArray, temperature: FloatArray) -> float:
    """Fastest change of temperature that lasts, C/min: six steps of one sign, 5 C or more, no step nearly half of it.

    It is sought on every scale: cells are merged in pairs until too few are left. 0 where none is faster than a
    chamber: only windows from whose first to whose last cell it went that fast are looked at.
    """
    fastest = 0.0
    while len(time) > _STEPS:
        took = time[_STEPS:] - time[:-_STEPS]
        moved = np.abs(temperature[_STEPS:] - temperature[:-_STEPS])
        fast = (moved >= _NEARLY * _RISE_C) & (60.0 * moved >= _NEARLY * _FASTEST_C_PER_MIN * took)
        looked = (fast & (took > 0.0)).nonzero()[0]
        if len(looked):
            windows = np.lib.stride_tricks.sliding_window_view(np.diff(temperature), _STEPS)[looked]
            rise = np.abs(windows.sum(axis=1))
            one_sign = np.abs(np.sign(windows).sum(axis=1)) == _STEPS
            even = np.abs(windows).max(axis=1) <= _LARGEST_STEP * rise
            lasting = one_sign & even & (rise >= _RISE_C)
            if lasting.any():
                fastest = max(fastest, float(np.max(60.0 * rise[lasting] / took[looked][lasting])))
        time, temperature = _of_pairs(time), _of_pairs(temperature)
    return fastest


def _of_pairs(values: FloatArray) -> FloatArray:
    """Return the means of the first and second value, the third and fourth and so on; an odd last one is left out."""
    half = len(values) // 2 * 2
    return np.asarray((values[:half:2] + values[1:half:2]) / 2.0)


def _of_triad(rates: FloatArray, column: str, units: Mapping[str, Conversion]) -> Suspicion | None:
    """Three axes at rest see Earth's rate whole, whichever way they point."""
    norm = float(np.linalg.norm(rates.mean(axis=0)))
    unit = units.get(column)
    for likely, factor in _other_rates(unit):
        if abs(norm * factor / EARTH_RATE_DPH - 1.0) < _TRIAD:
            found = (
                f"the means of the three axes make {norm:.4g} deg/h{_as(unit)}; in {likely} they make Earth's "
                f"rate, 15.04 deg/h"
            )
            return Suspicion("rate", column, found, likely)
    return None


def _of_noise(
    time: FloatArray, rate: FloatArray, column: str, noise: float | None, units: Mapping[str, Conversion]
) -> Suspicion | None:
    """Noise below or above that of every gyro; where noise is declared, nearer to what another unit makes of that."""
    walks = _random_walks(time, rate)
    unit = units.get(column)
    if not walks:
        return None
    walk, robust = max(one for one, _ in walks), min(one for _, one in walks)
    if robust > _NOISIEST:
        return _too_noisy(robust, rate, column, unit, "any gyro", (_FLOWN, _NOISY))
    if noise and robust > _AT_REST * noise:
        declared = f"a gyro of {noise:.2g} deg/sqrt(h)"
        louder = _too_noisy(robust, rate, column, unit, declared, (noise / _AT_REST, _AT_REST * noise))
        if louder.likely is not None:
            return louder
    larger = [(likely, factor) for likely, factor in _other_rates(unit) if factor > 1.0]
    for least in (_FLOWN, _QUIETEST):
        for likely, factor in larger:
            bound = _QUIETEST if not noise else noise / np.sqrt(factor)
            if walk < bound and walk * factor >= least:
                found = (
                    f"white noise of {walk:.2g} deg/sqrt(h){_as(unit)}, below that of any gyro made, and a mean of "
                    f"{np.mean(rate):.4g} deg/h; in {likely} it is {walk * factor:.2g} deg/sqrt(h) and "
                    f"{np.mean(rate) * factor:.4g} deg/h"
                )
                return Suspicion("rate", column, found, likely)
    return None


def _too_noisy(
    walk: float, rate: FloatArray, column: str, unit: Conversion | None, gyro: str, usual: tuple[float, float]
) -> Suspicion:
    """Return the suspicion of noise above that of a gyro, with the unit in which it is as usual, if there is one.

    Args:
        gyro: The gyro in words.
        usual: Least and largest usual noise, deg/sqrt(h).
    """
    middle = median(rate)
    found = (
        f"white noise of {walk:.2g} deg/sqrt(h){_as(unit)}, above that of {gyro} at rest, and a median of "
        f"{middle:.4g} deg/h"
    )
    for likely, factor in _other_rates(unit):
        if factor < 1.0 and usual[0] <= walk * factor <= usual[1]:
            found += f"; in {likely} it is {walk * factor:.2g} deg/sqrt(h) and {middle * factor:.4g} deg/h"
            return Suspicion("rate", column, found, likely)
    return Suspicion("rate", column, found, None)


def _random_walks(time: FloatArray, rate: FloatArray) -> list[tuple[float, float]]:
    """Return pairs of angle random walks, deg/sqrt(h): from all steps between cells, and from their median.

    Cells are the rows, then ever longer ones up to 100 s. The largest tells what is too quiet, because a logger's
    filter makes neighbouring rows alike: the noise shows on longer means only. The smallest from a median tells what is
    too noisy: it sees neither wild rows nor the quantisation of pulses. Rates that are all the same give no pair.
    """
    walks: list[tuple[float, float]] = []
    while len(rate) >= _FEWEST_CELLS:
        tau = median(np.diff(time))
        if walks and tau > _QUIET_TAU_S:
            break
        steps = np.diff(rate)
        scale = float(np.sqrt(max(tau, 0.0) / 3600.0 / 2.0))
        if steps.any():
            walks.append((scale * float(np.sqrt(np.mean(steps**2))), scale * MAD_TO_SIGMA * median(np.abs(steps))))
        time, rate = _of_pairs(time), _of_pairs(rate)
    return walks


def _other_rates(unit: Conversion | None) -> Iterator[tuple[str, float]]:
    """Other units of a rate, and by how much a rate would be larger if the file were in them."""
    declared = 1.0 if unit is None else unit.factor
    for likely, factor in RATE_UNITS_DPH.items():
        if abs(factor / declared - 1.0) > 0.01:
            yield likely, factor / declared


def _as(unit: Conversion | None) -> str:
    return "" if unit is None else f" as {unit.unit}"
