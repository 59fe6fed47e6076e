"""gyrotc: from thermal-chamber recordings of a gyro to verified C tables that compensate its bias.

The command does the whole job (`gyrotc --help`, or `python -m gyrotc --help`):

    gyrotc import log.csv --out data        recordings of a logger to a data set
    gyrotc check data                       errors and warnings about recordings
    gyrotc build data --out result          fit, C source, proof on every target, report
    gyrotc diagnose data --out diagnosis    what the model does not explain, and the cause
    gyrotc simulate paper --out data        a data set to try it with

From Python (`gyrotc.jobs.api`):

    data = gyrotc.load("data")              recordings, or gyrotc.Dataset.from_pandas(frame, rate_unit="deg/s")
    result = gyrotc.build(data)             what the command does; result.plot(), result.to_xarray()
    gyrotc.check("data")                    so do gyrotc.fit and gyrotc.jobs.diagnose

`gyrotc.RBFNetworkRegressor` is the network as an estimator of scikit-learn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .jobs.api import Dataset, Result, build, check, fit, load
    from .train.estimator import RBFNetworkRegressor

__all__ = ["Dataset", "RBFNetworkRegressor", "Result", "__version__", "build", "check", "fit", "load"]

__version__ = "0.1.0"

_API = ("Dataset", "Result", "build", "check", "fit", "load")


def __getattr__(name: str) -> Any:
    """A name of the API on first use: `import gyrotc` stays quick, and scikit-learn optional.

    Raises:
        ModuleNotFoundError: scikit-learn is not installed; the message says what to install.
    """
    if name in _API:
        from .jobs import api

        return getattr(api, name)
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
