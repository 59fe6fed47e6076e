"""`diagnose.json`, the discrepancies, causes and gain of a diagnosis, and `series.json`, the data of its pictures."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Count, Estimate, Figure, Finding, Part, Result, UnitResult

DiagnosisVerdict = Literal[
    "consistent", "explained", "ambiguous", "partial", "noise_differs", "unexplained", "not_testable"
]


_WHOLE = 0.995  # a share of the removable error that shows as 100 %


class GainOnUnseen(Part):
    """Gain of causes on runs that they were not fitted to."""

    exam_rms_before_dph: float = Field(description="RMS of the correction without the causes, deg/h")
    exam_rms_after_dph: float = Field(description="RMS of the correction with the causes, deg/h")
    share_of_excess_removed: Figure = Field(
        description="share of the removable error that is removed; null if next to nothing is removable"
    )
    low: Figure = Field(description="lower 95 % limit of the share")
    high: Figure = Field(description="upper 95 % limit of the share")
    rms_removed_dph: Estimate = Field(description="RMS before less RMS after, deg/h")
    angle_1h_removed_arcsec: Estimate | None = Field(
        description="decrease of the RMS angle error over one hour, arcsec; null if no run lasts an hour"
    )
    angle_1h_before_arcsec: Figure = Field(description="RMS angle error over one hour without the causes, arcsec")
    angle_1h_after_arcsec: Figure = Field(description="RMS angle error over one hour with the causes, arcsec")
    rms_30min_before_dph: Figure = Field(description="RMS of means over 30 minutes without the causes, deg/h")
    rms_30min_after_dph: Figure = Field(description="RMS of means over 30 minutes with the causes, deg/h")
    about_means: bool = Field(
        default=False, description="true if the mean of each run is subtracted, because a named cause shifts runs"
    )

    @property
    def shown(self) -> Literal["gain", "loss", "undecided"]:
        """Conclusion from the 95 % interval of the difference of RMS."""
        low, high = self.rms_removed_dph.low, self.rms_removed_dph.high
        if low is not None and low > 0.0:
            return "gain"
        return "loss" if high is not None and high < 0.0 else "undecided"

    @property
    def text(self) -> str:
        """The gain on held-out runs in a sentence."""
        rms = f"RMS {self.exam_rms_before_dph:.4g} -> {self.exam_rms_after_dph:.4g} deg/h"
        runs = "On held-out runs less their means" if self.about_means else "On held-out runs"
        if self.shown == "loss":
            return f"{runs} the extension does harm: {rms}."
        if self.shown == "undecided":
            return f"{runs} no gain is shown: {rms}."
        share = self.share_of_excess_removed
        whole = share is not None and share >= _WHOLE
        amount = "" if share is None else f", {'all' if whole else f'{share:.0%}'} of the removable error"
        return f"{runs} the extension gains: {rms}{amount}."


class WithoutRate(GainOnUnseen):
    """The gain on an environment that was left out of everything."""

    environment: str = Field(description="environment that was left out, the one with the fastest temperature")


class ComparedStatistic(Part):
    """A statistic of the residuals, compared with simulated campaigns."""

    statistic: str = Field(description="name of the statistic")
    measured: float = Field(description="value of the recordings")
    simulated_mean: float = Field(description="mean of the simulated campaigns")
    simulated_low: float = Field(description="lower end of the middle 95 % of the simulated campaigns")
    simulated_high: float = Field(description="upper end of the middle 95 % of the simulated campaigns")
    p_value: float = Field(description="probability of a deviation at least as large by chance")


class Statistic(ComparedStatistic):
    """A statistic compared with the plain simulation, and with the one that has the named causes."""

    extended: ComparedStatistic | None = Field(
        description="comparison with the simulation that has the named causes; null if there are none"
    )


# A smaller posterior is 0 % in print.
_WORTH_A_WORD = 0.01

UNNAMED, NOTHING = "unnamed", "nothing"
"""Ids in the place of a cause: an effect that is in no catalogue, and no effect at all."""

LIKELIER_THAN_ALL_ELSE = 0.5  # probability above which a cause is likelier than all else together, and is named
SURE = 0.9  # probability from which a cause is the explanation; below it the other possibilities are listed


class NamedCause(Part):
    """A cause, or a kind of noise, that was found."""

    id: str = Field(description="id in the catalogue of causes, or of a kind of noise")
    family: str = Field(description="family of the cause; `noise` for noise")
    name: str = Field(description="name of the cause in words")
    p_value: Figure = Field(description="p value, adjusted for the whole search")
    parameters: dict[str, Estimate] = Field(description="fitted parameters by name")
    equivalent: tuple[str, ...] = Field(
        description="other possibilities, the likeliest first: ids of causes, `unnamed` (an effect that is in no "
        "catalogue) or `nothing`; empty if the cause has 90 %"
    )
    separate_by: str | None = Field(
        description="experiment that would decide between the cause and the likeliest other possibility; null if none "
        "is needed"
    )
    probabilities: dict[str, float] | None = Field(
        default=None,
        description="posterior probabilities by id: this cause, others in its place, `unnamed` and `nothing`",
    )
    gain: GainOnUnseen | None = Field(
        description="gain of its term beyond those of the causes before it, of all terms together for a single cycle; "
        "null for noise and for causes that no term corrects"
    )
    signature: str = Field(description="signature of the cause in the recordings, in words")
    remedy: str = Field(description="remedy in hardware or programme, in words")
    repair: str | None = Field(
        default=None, description="line of `dataset.toml` that removes the cause from the recordings; null if none does"
    )
    separable_from_d: dict[str, float] | None = Field(
        default=None, description="size, in standard deviations, from which each other cause is ruled out, by id"
    )
    channel: str | None = Field(default=None, description="recorded channel that the cause follows; null if none")
    equivalent_channels: tuple[str, ...] | None = Field(
        default=None, description="channels that explain the runs equally well"
    )

    @property
    def others(self) -> tuple[str, ...]:
        """Other possibilities with a posterior of 1 % and more, in words."""
        words = {UNNAMED: "an effect that is in no catalogue", NOTHING: "chance"}
        return tuple(
            f"{words.get(id, id.replace('_', ' '))} {share:.0%}"
            for id, share in (self.probabilities or {}).items()
            if id != self.id and share >= _WORTH_A_WORD
        )


class Baseline(Part):
    """The static map."""

    exam_rms_dph: float = Field(description="RMS on runs that it was not fitted to, deg/h")
    centers: Count = Field(description="number of centers of its networks")


class ExtendedModel(Part):
    """The model with terms for the causes."""

    exam_rms_dph: float = Field(description="RMS on runs that it was not fitted to, deg/h")
    centers: Count = Field(description="number of centers of its networks")
    terms: tuple[str, ...] = Field(description="ids of the causes in its table")
    model: str | None = Field(description="file of the model; null if none was written")
    gain: GainOnUnseen = Field(description="gain over the static map")
    rate_left_out: WithoutRate | None = Field(
        description="gain on the environment with the fastest temperature, left out of everything; null if there is "
        "one environment, or no whole mean of it"
    )
    forward_in_time: GainOnUnseen | None = Field(
        description="gain on runs later than all training; null without dates, or without a whole mean of these runs"
    )


class DetectionLimit(Part):
    """Smallest size of a cause that is found in 95 % of cases."""

    value: Figure = Field(description="smallest size that is found; null if no size is")
    unit: str = Field(description="unit of `value`")
    parameter: str | None = Field(description="parameter that the limit depends on; null if none")
    over: tuple[tuple[float, Figure], ...] = Field(
        description="pairs of a value of the parameter and the limit there; if the limit is itself a value of the "
        "parameter, the size there in standard deviations"
    )


class ConsideredCause(Part):
    """A cause of the catalogue."""

    id: str = Field(description="id in the catalogue of causes")
    family: str = Field(description="family of the cause")
    p_value: Figure = Field(description="p value, adjusted for the whole search; null if not testable")
    detection_limit: DetectionLimit | None = Field(description="size up to which the cause could still hide")
    channel: str | None = Field(default=None, description="recorded channel that the cause follows; null if none")
    not_testable: str | None = Field(
        default=None, description="reason why these recordings cannot test it; null if they can"
    )


class TriedMemories(Part):
    """Memories added to a map of temperature alone."""

    states: tuple[dict[str, str | Estimate], ...] = Field(description="`id` and parameters of each memory")
    rms_dph: float = Field(description="RMS residual, deg/h")
    criterion: float = Field(description="minus twice the log-likelihood with a penalty for parameters; less is better")
    resolved: bool = Field(description="true if this cycle fixes the parameters")


class StaticRate(Part):
    """A map of temperature with products of powers of T and dT/dt added."""

    powers: tuple[tuple[int, int], ...] = Field(description="powers of T and of dT/dt in each product")
    rms_dph: float = Field(description="RMS residual, deg/h")
    criterion: float = Field(description="criterion on the scale of the memories")


class CycleResult(Part):
    """Conclusions from a single chamber cycle."""

    map_rms_dph: float = Field(description="RMS residual of a map of temperature alone, deg/h")
    turns: Count = Field(description="number of turns of the temperature")
    not_testable: str | None = Field(
        description="reason why memory cannot be distinguished from a static map; null if it can"
    )
    gain: GainOnUnseen | None = Field(description="gain of the best memories on held-out runs; null if there are none")
    static: tuple[StaticRate, ...] = Field(description="maps without memory, the best first")
    tried: tuple[TriedMemories, ...] = Field(description="combinations of memories, the best first")


class ShippingTrial(Part):
    """Decision on shipping an extension, by pieces of training history left out in turn."""

    ships: bool = Field(description="true if the extension is shipped")
    beside: str = Field(description="correction that would be emitted without it")
    left_out: tuple[str, ...] = Field(description="pieces that were left out, in words")
    rms_before_dph: Figure = Field(
        description="RMS without it on what the rest has covered of these pieces, deg/h; null if no piece can be judged"
    )
    rms_after_dph: Figure = Field(
        description="RMS with it on the same, deg/h; null if no piece can be judged, or nothing was tried"
    )
    reason: str | None = Field(description="reason why nothing is shipped; null if an extension is")


class Unexplained(Part):
    """Structure that has no name."""

    share_explained: float = Field(description="share that the best causes explain")
    p_value: float = Field(description="p value of the residual of the best causes")
    best_partial_match: tuple[str, ...] = Field(description="ids of the best causes")
    looks_like: str | None = Field(description="description of the structure in words; null if there is none")


class Diagnosed(UnitResult):
    """Discrepancies of the static map and their causes (`gyrotc diagnose`)."""

    schema_: Annotated[Literal["gyrotc.diagnose/1"], Field(alias="schema")] = "gyrotc.diagnose/1"
    discrepancies: tuple[Statistic, ...] = Field(
        description="statistics of the residual compared with the simulation, the rarest first"
    )
    verdict: DiagnosisVerdict = Field(description="verdict (docs/diagnosis.md)")
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging time of all RMS figures, s")
    noise_floor_dph: Figure = Field(description="noise floor of means over `average_s` of the training runs, deg/h")
    causes: tuple[NamedCause, ...] = Field(description="named causes and kinds of noise")
    baseline: Baseline | None = Field(description="static map; null if nothing could be decided")
    extended: ExtendedModel | None = Field(
        description="model with terms for the causes; null if none gains on held-out runs"
    )
    considered: tuple[ConsideredCause, ...] = Field(description="all causes of the catalogue")
    missing: tuple[str, ...] = Field(description="causes that these recordings cannot test, with the reason")
    estimated_noise: dict[str, float] | None = Field(
        description="levels of noise, as in `[noise]` of a scenario; null if nothing could be decided"
    )
    measured_on: Literal["exam", "left out"] | None = Field(
        description="data on which the gain was measured: test runs or history left out; null if it was not"
    )
    single_cycle: CycleResult | None = Field(
        description="conclusions from a single chamber cycle; null if there are more"
    )
    shipping: ShippingTrial | None = Field(description="decision on shipping; null if nothing could be decided")
    unexplained: Unexplained | None = Field(description="structure that has no name; null if all is explained")
    text: str = Field(description="conclusion in words")
    meaning: str = Field(description="meaning of the verdict")
    next: tuple[str, ...] = Field(description="next steps, the most informative first")
    events: tuple[Finding, ...] = Field(default=(), description="events in the recordings, by run and time")
    scenario: str | None = Field(
        default=None, description="file of a scenario with the named causes; null if none was written"
    )
    pictures: tuple[str, ...] | None = Field(default=None, description="files of the pictures; null if none were drawn")
    series: str | None = Field(default=None, description="file with the data of the pictures; null if none was written")
    lot: str | None = Field(default=None, description="use of the lot, in words; null without `--lot`")

    @property
    def discrepancy(self) -> str:
        """The clearest discrepancy of the simulation, with its band and probability; empty if there is none."""
        if not self.discrepancies:
            return ""
        first = min(self.discrepancies, key=lambda d: d.p_value)
        unit = " deg/h" if first.statistic.endswith("_dph") else ""
        name = first.statistic.removesuffix("_dph").replace("_", " ")
        band = f"{first.simulated_low:.3g} to {first.simulated_high:.3g}{unit}"
        return f"{name} is {first.measured:.3g}{unit}, where 95 % of simulations have {band} (p = {first.p_value:.2g})"

    @property
    def physical(self) -> tuple[NamedCause, ...]:
        """Causes that are not noise."""
        return tuple(cause for cause in self.causes if cause.family != "noise")

    @property
    def noise(self) -> tuple[NamedCause, ...]:
        """Kinds of noise that were found."""
        return tuple(cause for cause in self.causes if cause.family == "noise")


SeriesValues = tuple[float, ...]


class RunSeries(Part):
    """Means over blocks of a training run."""

    name: str = Field(description="name of the run")
    file: str = Field(description="file of the run")
    environment: str = Field(description="environment of the run, as the data set states it")
    first_s: float = Field(description="time of the first row of the run on the file's clock, s")
    hours: SeriesValues = Field(description="time of the middle of each block since the first row, h")
    temperature_c: SeriesValues = Field(description="temperature, C")
    slope_c_per_min: SeriesValues = Field(description="dT/dt, C/min")
    rate_dph: SeriesValues = Field(description="rate less its mean over all training runs, deg/h")
    residual_dph: SeriesValues = Field(
        description="residual of the static map, or of a map of T alone for a single cycle, deg/h"
    )
    simulated_low_dph: SeriesValues = Field(
        description="lower end of the middle 95 % of simulated residuals, means over half an hour, deg/h; empty for a "
        "single cycle"
    )
    simulated_high_dph: SeriesValues = Field(description="upper end of that range, deg/h")
    named_dph: SeriesValues | None = Field(
        description="part of the named causes that no map holds, deg/h; null if none is named"
    )
    on_h: SeriesValues | None = Field(description="time since power-on, h; null if not known")
    day: Figure = Field(description="start of the run after that of the first run, days; null if not stated")


class ScoredRun(Part):
    """Means over `average_s` of a run that the extension was not fitted to."""

    hours: SeriesValues = Field(description="time since the first mean, h")
    before_dph: SeriesValues = Field(description="residual of the model without the causes, deg/h")
    after_dph: SeriesValues = Field(description="residual of the model with the causes, deg/h")


class ParameterLikelihood(Part):
    """Profile likelihood of a parameter of a named cause."""

    cause: str = Field(description="name of the cause, in words")
    parameter: str = Field(description="name of the parameter")
    values: SeriesValues = Field(description="values of the parameter, ascending")
    gain: SeriesValues = Field(description="twice the log-likelihood at each value, less its largest")
    low: Figure = Field(description="lower end of the 95 % interval; null if open")
    high: Figure = Field(description="upper end of the 95 % interval; null if open")


class SearchScores(Part):
    """Significance of the best candidate of each cause."""

    alone: dict[str, float] = Field(description="-ln p without any named cause, by id")
    beside: dict[str, float] | None = Field(
        description="-ln p in addition to the named causes, by id; null if none is named"
    )
    limit: float = Field(description="-ln p of a false alarm rate of 1 % for the whole search")


class DiagnosisSeries(Result):
    """Data of the pictures of a diagnosis, which are drawn from this and `diagnose.json` alone."""

    schema_: Annotated[Literal["gyrotc.diagnosis-series/1"], Field(alias="schema")] = "gyrotc.diagnosis-series/1"
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging time of the scored runs, s")
    runs: tuple[RunSeries, ...] = Field(description="training runs")
    scored: tuple[ScoredRun, ...] = Field(description="runs that the gain was measured on; empty if it was not")
    likelihoods: tuple[ParameterLikelihood | None, ...] = Field(
        description="profile likelihood of each physical cause of `diagnose.json`; null for one without a parameter"
    )
    scores: SearchScores = Field(description="significance of the causes in the search")
