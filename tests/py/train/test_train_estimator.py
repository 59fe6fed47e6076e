"""The regressor keeps to scikit-learn's rules and finds what the training finds."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from gyrotc.train.estimator import RBFNetworkRegressor
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks
from training_data import NOISE_DPH, rms, samples, true_bias


@parametrize_with_checks([RBFNetworkRegressor(), RBFNetworkRegressor(n_centers=4, random_state=7)])
def test_it_is_an_estimator(estimator: RBFNetworkRegressor, check: object) -> None:
    check(estimator)  # type: ignore[operator]


def test_two_inputs_are_trained_as_a_gyro_is() -> None:
    data = samples(0, noise_dph=NOISE_DPH / np.sqrt(10.0))
    x = np.stack([data.temperature_c, data.slope_c_per_min], axis=1)
    found = make_pipeline(StandardScaler(), RBFNetworkRegressor()).fit(x, data.bias_dph)
    error = found.predict(x) - true_bias(data.temperature_c, data.slope_c_per_min)
    assert rms(error) < 0.25 * NOISE_DPH
    assert 1 <= len(found[-1].weights_) <= 8


@pytest.mark.parametrize("d", [1, 3, 5])
def test_any_number_of_inputs(d: int) -> None:
    rng = np.random.default_rng(d)
    x = rng.uniform(-2.0, 5.0, (600, d))
    y = 3.0 + np.exp(-(((x[:, 0] - 1.0) / 1.5) ** 2)) + 0.1 * x[:, -1] + rng.normal(0.0, 0.02, 600)
    assert cross_val_score(RBFNetworkRegressor(), x, y, cv=3).min() > 0.8


def test_attributes_are_in_the_units_of_the_inputs() -> None:
    rng = np.random.default_rng(4)
    x = rng.uniform(-40.0, 60.0, (500, 3))
    y = np.exp(-np.sum(((x - 10.0) / 40.0) ** 2, axis=1)) + 1e-3 * x[:, 1]
    found = RBFNetworkRegressor(n_centers=20).fit(x, y)
    value = found.intercept_ + (x - found._middle) @ found.coef_
    for center, width, weight in zip(found.centers_, found.widths_, found.weights_, strict=True):
        value = value + weight * np.exp(-np.sum(((x - center) / width) ** 2, axis=1))
    np.testing.assert_allclose(found.predict(x), value, rtol=1e-9)


def test_a_negative_number_of_centers_is_refused() -> None:
    with pytest.raises(ValueError, match="n_centers"):
        RBFNetworkRegressor(n_centers=-1).fit(np.zeros((5, 2)), np.arange(5.0))


def test_the_package_offers_it_and_loads_scikit_learn_only_then() -> None:
    code = (
        "import sys, gyrotc\n"
        "assert 'sklearn' not in sys.modules\n"
        "assert gyrotc.RBFNetworkRegressor().fit([[0.0], [1.0], [2.0]], [0.0, 1.0, 2.0]).n_features_in_ == 1\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
