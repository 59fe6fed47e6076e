"""gyrotc: from thermal-chamber recordings of a gyro to verified C tables that compensate its bias."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .train.estimator import RBFNetworkRegressor

__all__ = ["RBFNetworkRegressor", "__version__"]

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """`RBFNetworkRegressor` on first use: scikit-learn stays optional."""
    if name != "RBFNetworkRegressor":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .train.estimator import RBFNetworkRegressor

    return RBFNetworkRegressor
