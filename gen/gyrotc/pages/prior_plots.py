"""The picture of a unit with its lot or its earlier model: what these say, what its runs say, and both together."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ..results.training import Training
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg

__all__ = ["prior_and_posterior"]

_REST_C_PER_MIN = 0.1  # means at up to this rate are drawn as at rest: a cell of the gathered means
_BAND = 2.0  # sigma that a band reaches, about 95 %


def prior_and_posterior(training: Training) -> str | None:
    """Prior, recordings and posterior where temperature stands still, deg/h over C; None where nothing was known."""
    if training.lot is not None:
        curve, name = training.lot.curve, f"the lot alone, {training.lot.units} units"
    elif training.prior is not None:
        curve, name = training.prior.curve, "the earlier model after ageing"
    else:
        return None
    if curve is None:
        return None
    t = np.array(curve.temperature_c)
    bands = (
        (curve.prior_dph, curve.prior_sigma_dph, COVERED, name),
        (curve.posterior_dph, curve.posterior_sigma_dph, AFTER, "with this unit's own runs"),
    )
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.2), layout="constrained")
        ax = figure.subplots()
        for mean, sigma, color, label in bands:
            middle, half = np.array(mean), _BAND * np.array(sigma)
            ax.fill_between(t, middle - half, middle + half, color=color, alpha=0.25, linewidth=0.0)
            ax.plot(t, middle, color=color, linewidth=1.2, label=label)
        if (means := training.means) is not None:
            still = np.abs(means.slope_c_per_min) <= _REST_C_PER_MIN
            size = 3.0 + 3.0 * np.sqrt(np.array(means.count)[still])
            at = np.array(means.temperature_c)[still], np.array(means.bias_dph)[still]
            ax.scatter(
                *at, s=size, color=BEFORE, edgecolor=ACCENT, linewidth=0.3, label="its recordings at rest"
            )
        ax.set(xlabel="temperature, C", ylabel="bias at rest, deg/h")
        ax.legend(fontsize=8)
        return svg(figure)
