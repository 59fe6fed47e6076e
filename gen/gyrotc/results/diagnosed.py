"""`diagnose.json`: what the simulation gets wrong about recordings, the named causes, and what an extension gains;
`series.json`: what its pictures show."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Count, Estimate, Figure, Finding, Part, Result, UnitResult

DiagnosisVerdict = Literal[
    "consistent", "explained", "ambiguous", "partial", "noise_differs", "unexplained", "not_testable"
]


_WHOLE = 0.995  # a share of the removable error that shows as 100 %


class GainOnUnseen(Part):
    """What causes gain on runs that they were not fitted to."""

    exam_rms_before_dph: float = Field(description="RMS of what would be emitted without them, deg/h")
    exam_rms_after_dph: float = Field(description="RMS with the causes, deg/h")
    share_of_excess_removed: Figure = Field(
        description="share of the removable error that is removed; null where next to nothing is removable"
    )
    low: Figure = Field(description="lower 95 % limit of the share")
    high: Figure = Field(description="upper 95 % limit of the share")
    rms_removed_dph: Estimate = Field(description="difference of both RMS, deg/h")
    angle_1h_removed_arcsec: Estimate | None = Field(
        description="of the RMS angle after an hour, arcsec; null where no run lasts an hour"
    )
    angle_1h_before_arcsec: Figure = Field(description="of the static map, arcsec")
    angle_1h_after_arcsec: Figure = Field(description="with the causes, arcsec")
    rms_30min_before_dph: Figure = Field(description="RMS of means over 30 minutes, of the static map, deg/h")
    rms_30min_after_dph: Figure = Field(description="the same with the causes, deg/h")

    @property
    def shown(self) -> Literal["gain", "loss", "undecided"]:
        """What the 95 % interval of the difference of RMS says."""
        low, high = self.rms_removed_dph.low, self.rms_removed_dph.high
        if low is not None and low > 0.0:
            return "gain"
        return "loss" if high is not None and high < 0.0 else "undecided"

    @property
    def text(self) -> str:
        """What unseen runs say of it, in a sentence."""
        rms = f"RMS {self.exam_rms_before_dph:.4g} -> {self.exam_rms_after_dph:.4g} deg/h"
        if self.shown == "loss":
            return f"On unseen runs the extension does harm: {rms}."
        if self.shown == "undecided":
            return f"On unseen runs no gain is shown: {rms}."
        share = self.share_of_excess_removed
        whole = share is not None and share >= _WHOLE
        amount = "" if share is None else f", {'all' if whole else f'{share:.0%}'} of the removable error"
        return f"On unseen runs the extension gains: {rms}{amount}."


class WithoutRate(GainOnUnseen):
    """The gain on an environment that was left out of everything."""

    environment: str = Field(description="the one with the fastest temperature")


class ComparedStatistic(Part):
    """A statistic of the residuals against simulated campaigns."""

    statistic: str = Field(description="its name")
    measured: float = Field(description="of the recordings")
    simulated_mean: float = Field(description="mean of the simulated campaigns")
    simulated_low: float = Field(description="lower end of their middle 95 %")
    simulated_high: float = Field(description="upper end of their middle 95 %")
    p_value: float = Field(description="how often chance departs as far")


class Statistic(ComparedStatistic):
    """A statistic against the plain simulation, and against the one with what was found."""

    extended: ComparedStatistic | None = Field(description="null where nothing was found")


# A smaller posterior is 0 % in print.
_WORTH_A_WORD = 0.01

UNNAMED, NOTHING = "unnamed", "nothing"
"""In the place of a cause: an effect that is in no catalogue; no effect at all."""

LIKELIER_THAN_ALL_ELSE = 0.5  # probability above which something is likelier than all else together, and is named
SURE = 0.9  # probability from which it is the explanation; below, what else remains possible is listed


class NamedCause(Part):
    """A cause, or a kind of noise, that was found."""

    id: str = Field(description="of the catalogue of causes, or of a kind of noise")
    family: str = Field(description="of the cause; `noise` for noise")
    name: str = Field(description="in words")
    p_value: Figure = Field(description="adjusted for the whole search")
    parameters: dict[str, Estimate] = Field(description="fitted parameters by name")
    equivalent: tuple[str, ...] = Field(
        description="what else remains possible, the likeliest first: ids of causes, `unnamed` (an effect that is in "
        "no catalogue) or `nothing`; none where the cause has 90 %"
    )
    separate_by: str | None = Field(
        description="the experiment that would decide between it and the likeliest of these"
    )
    probabilities: dict[str, float] | None = Field(
        default=None,
        description="of this cause, of all others in its place, of something `unnamed` and of `nothing`, by id",
    )
    gain: GainOnUnseen | None = Field(description="null for noise and for structure of the map, which nothing corrects")
    signature: str = Field(description="how it shows")
    remedy: str = Field(description="what helps against it")
    repair: str | None = Field(default=None, description="line of `dataset.toml` that takes it out of the recordings")
    separable_from_d: dict[str, float] | None = Field(
        default=None, description="size, in standard deviations, from which each other cause is ruled out"
    )
    channel: str | None = Field(default=None, description="of a recorded channel")
    equivalent_channels: tuple[str, ...] | None = Field(
        default=None, description="channels that explain the runs as well"
    )

    @property
    def others(self) -> tuple[str, ...]:
        """What else is possible in the place of the cause, in words with its posterior; of 1 % and more."""
        words = {UNNAMED: "an effect that is in no catalogue", NOTHING: "chance"}
        return tuple(
            f"{words.get(id, id.replace('_', ' '))} {share:.0%}"
            for id, share in (self.probabilities or {}).items()
            if id != self.id and share >= _WORTH_A_WORD
        )


class Baseline(Part):
    """The static map."""

    exam_rms_dph: float = Field(description="RMS on runs it was not fitted to, deg/h")
    centers: Count = Field(description="of its networks")


class ExtendedModel(Part):
    """The model with terms for the causes."""

    exam_rms_dph: float = Field(description="RMS on runs it was not fitted to, deg/h")
    centers: Count = Field(description="of its networks")
    terms: tuple[str, ...] = Field(description="ids of causes in its table")
    model: str | None = Field(description="its file; null where none was written")
    gain: GainOnUnseen = Field(description="over the static map")
    rate_left_out: WithoutRate | None = Field(description="null where there is one environment")
    forward_in_time: GainOnUnseen | None = Field(
        description="on runs later than all that was learnt from; null without dates"
    )


class DetectionLimit(Part):
    """Smallest size of a cause that is found in 95 % of cases."""

    value: Figure = Field(description="null: never")
    unit: str = Field(description="of `value`")
    parameter: str | None = Field(description="that the limit depends on; null: none")
    over: tuple[tuple[float, Figure], ...] = Field(description="pairs of parameter and limit")


class ConsideredCause(Part):
    """A cause of the catalogue."""

    id: str = Field(description="of the catalogue of causes")
    family: str = Field(description="of the cause")
    p_value: Figure = Field(description="adjusted for the whole search; null: not testable")
    detection_limit: DetectionLimit | None = Field(description="what could still hide")
    channel: str | None = Field(default=None, description="of a recorded channel")
    not_testable: str | None = Field(default=None, description="why these recordings cannot test it")


class TriedMemories(Part):
    """Memories beside a map of temperature alone."""

    states: tuple[dict[str, str | Estimate], ...] = Field(description="`id` and parameters of each")
    rms_dph: float = Field(description="what they leave, deg/h")
    criterion: float = Field(description="twice the log-likelihood with the price of parameters; less is better")
    resolved: bool = Field(description="whether this cycle fixes the parameters")


class StaticRate(Part):
    """A map of temperature with products of it and of its rate beside it."""

    powers: tuple[tuple[int, int], ...] = Field(description="of temperature and of its rate")
    rms_dph: float = Field(description="what it leaves, deg/h")
    criterion: float = Field(description="as that of the memories")


class CycleResult(Part):
    """What one chamber cycle tells."""

    map_rms_dph: float = Field(description="what a map of temperature alone leaves, deg/h")
    turns: Count = Field(description="how often the temperature turns")
    not_testable: str | None = Field(
        description="why memory cannot be distinguished from a static map; null where it can"
    )
    gain: GainOnUnseen | None = Field(description="of the best memories on unseen runs; null where there are none")
    static: tuple[StaticRate, ...] = Field(description="what needs no memory, the best first")
    tried: tuple[TriedMemories, ...] = Field(description="the best first")


class ShippingTrial(Part):
    """Whether an extension is shipped, by stretches of training history left out in turn."""

    ships: bool = Field(description="whether it is")
    beside: str = Field(description="correction that would be emitted without it")
    left_out: tuple[str, ...] = Field(description="what was left out, in words")
    rms_before_dph: Figure = Field(
        description="of what the rest has covered of them without it, deg/h; null: not tried"
    )
    rms_after_dph: Figure = Field(description="the same with it, deg/h; null: not tried")
    reason: str | None = Field(description="why nothing is shipped; null where something is")


class Unexplained(Part):
    """Structure that has no name."""

    share_explained: float = Field(description="by the best causes")
    p_value: float = Field(description="of what they leave")
    best_partial_match: tuple[str, ...] = Field(description="ids of the best causes")
    looks_like: str | None = Field(description="in words")


class Diagnosed(UnitResult):
    """What the static map does not explain, and why (`gyrotc diagnose`)."""

    schema_: Annotated[Literal["gyrotc.diagnose/1"], Field(alias="schema")] = "gyrotc.diagnose/1"
    discrepancies: tuple[Statistic, ...] = Field(description="what the simulation gets wrong, the rarest first")
    verdict: DiagnosisVerdict = Field(description="see docs/diagnosis.md")
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging of all RMS figures, s")
    noise_floor_dph: Figure = Field(description="of means over `average_s` of the training runs, deg/h")
    causes: tuple[NamedCause, ...] = Field(description="what was found")
    baseline: Baseline | None = Field(description="null where nothing could be decided")
    extended: ExtendedModel | None = Field(description="null where nothing gains on unseen runs")
    considered: tuple[ConsideredCause, ...] = Field(description="the whole catalogue")
    missing: tuple[str, ...] = Field(description="what these recordings cannot test, and why")
    estimated_noise: dict[str, float] | None = Field(
        description="levels as `[noise]` of a scenario has them; null where nothing could be decided"
    )
    measured_on: Literal["exam", "left out"] | None = Field(description="where the gain was measured")
    single_cycle: CycleResult | None = Field(description="null where there are more cycles")
    shipping: ShippingTrial | None = Field(description="null where nothing could be decided")
    unexplained: Unexplained | None = Field(description="null where everything has a name")
    text: str = Field(description="the finding in words")
    meaning: str = Field(description="what the verdict means")
    next: tuple[str, ...] = Field(description="what to do, the most telling first")
    events: tuple[Finding, ...] = Field(default=(), description="what happened to the recordings, by run and time")
    scenario: str | None = Field(default=None, description="file of a scenario that simulates what was found")
    pictures: tuple[str, ...] | None = Field(default=None, description="files of pictures")
    series: str | None = Field(default=None, description="file of what the pictures show")
    lot: str | None = Field(default=None, description="with `--lot`: what was done with it; null without")

    @property
    def discrepancy(self) -> str:
        """What the simulation gets wrong most clearly: statistic, simulated band, probability; empty if unknown."""
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

    name: str = Field(description="of the run")
    file: str = Field(description="of the run")
    environment: str = Field(description="as the data set names it")
    first_s: float = Field(description="time of its first row on the file's clock, s")
    hours: SeriesValues = Field(description="middles of the blocks since that row, h")
    temperature_c: SeriesValues = Field(description="temperature, C")
    slope_c_per_min: SeriesValues = Field(description="dT/dt, C/min")
    rate_dph: SeriesValues = Field(description="rate less its mean over all training runs, deg/h")
    residual_dph: SeriesValues = Field(description="what the static map leaves (of a single cycle: a map of T), deg/h")
    simulated_low_dph: SeriesValues = Field(
        description="lower end of the middle 95 % of simulated residuals, means over half an hour, deg/h; empty of a "
        "single cycle"
    )
    simulated_high_dph: SeriesValues = Field(description="upper end, deg/h")
    named_dph: SeriesValues | None = Field(
        description="what the named causes add that no map holds, deg/h; null where none is named"
    )
    on_h: SeriesValues | None = Field(description="time since power-on, h; null where it is not known")
    day: Figure = Field(description="start since that of the first run, days; null where it is not stated")


class ScoredRun(Part):
    """Means over `average_s` of a run that the extension was not fitted to."""

    hours: SeriesValues = Field(description="since the first, h")
    before_dph: SeriesValues = Field(description="what the model without the causes leaves, deg/h")
    after_dph: SeriesValues = Field(description="what the model with them leaves, deg/h")


class ParameterLikelihood(Part):
    """Profile likelihood of a parameter of a named cause."""

    cause: str = Field(description="name of the cause, in words")
    parameter: str = Field(description="name of the parameter")
    values: SeriesValues = Field(description="of the parameter, ascending")
    gain: SeriesValues = Field(description="twice the log-likelihood less its largest")
    low: Figure = Field(description="lower end of the 95 % interval")
    high: Figure = Field(description="upper end")


class SearchScores(Part):
    """How telling the best candidate of every cause is."""

    alone: dict[str, float] = Field(description="-ln p before any cause was taken, by id")
    beside: dict[str, float] | None = Field(
        description="-ln p beside the named causes, by id; null where none is named"
    )
    limit: float = Field(description="-ln p that has 1 % for the whole search")


class DiagnosisSeries(Result):
    """What the pictures of a diagnosis show: they are drawn from this and `diagnose.json` alone."""

    schema_: Annotated[Literal["gyrotc.diagnosis-series/1"], Field(alias="schema")] = "gyrotc.diagnosis-series/1"
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging of the scored runs, s")
    runs: tuple[RunSeries, ...] = Field(description="training runs")
    scored: tuple[ScoredRun, ...] = Field(description="runs that were judged; none where nothing was to be judged")
    likelihoods: tuple[ParameterLikelihood | None, ...] = Field(
        description="of each physical cause of `diagnose.json`; null for one without a parameter"
    )
    scores: SearchScores = Field(description="of the search")
