"""gyrotc: from thermal-chamber recordings of a gyro to verified C tables that compensate its bias.

The command does the whole job (`gyrotc --help`, or `python -m gyrotc --help`):

    gyrotc import log.csv --out data        recordings of a logger to a data set
    gyrotc check data                       errors and warnings about recordings
    gyrotc build data --out result          fit, C source, proof on every target, report
    gyrotc diagnose data --out diagnosis    what the model does not explain, and the cause
    gyrotc simulate paper --out data        a data set to try it with

From Python: `gyrotc.model.load_model("result/model.json")` reads a fitted model, and
`gyrotc.RBFNetworkRegressor` is the network as an estimator of scikit-learn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .train.estimator import RBFNetworkRegressor

__all__ = ["RBFNetworkRegressor", "__version__"]

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """`RBFNetworkRegressor` on first use: scikit-learn stays optional.

    Raises:
        ModuleNotFoundError: scikit-learn is not installed; the message says what to install.
    """
    if name != "RBFNetworkRegressor":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from .train.estimator import RBFNetworkRegressor
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "sklearn":
            raise
        from .common.errors import install_command

        found = f"gyrotc.{name} needs scikit-learn: {install_command('sklearn')}"
        raise ModuleNotFoundError(found, name=error.name) from error
    return RBFNetworkRegressor
