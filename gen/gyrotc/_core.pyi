"""Types of the C++ core (gen/core/bind.cpp). Arrays are float64; lengths that differ raise ValueError."""

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]

compiler: str
"""What the core was compiled with, with its version."""

class KohonenMap:
    nodes: _Floats
    occupancy: _Floats
    epochs: int

def kohonen(
    samples: _Floats,
    nodes: int,
    *,
    max_epochs: int = 30,
    rate_first: float = 0.5,
    rate_last: float = 0.005,
    tolerance: float = 1e-4,
    neighbourhood: float = 0.0,
    seed: int = 0,
) -> KohonenMap: ...

class Network:
    shapes: _Floats
    weights: _Floats
    cost: float
    misfit: float

class VariableProjection:
    def __init__(self, t: _Floats, r: _Floats, weight: _Floats, target: _Floats, ridge: float) -> None: ...
    def project(self, shapes: _Floats) -> Network: ...
    def gradient(self, network: Network) -> _Floats: ...
    def losses(self, shapes: _Floats) -> _Floats: ...
    def refine(self, start: Network, tolerance: float, max_steps: int) -> Network: ...
    def path(
        self, centers: _Floats, max_size: int, enough: float, settled: float, tolerance: float
    ) -> list[Network]: ...

class Samples:
    def __init__(self, t: _Floats, r: _Floats, y: _Floats, weight: _Floats) -> None: ...

class NormalEquations:
    def norms(self) -> _Floats: ...
    def moments(self) -> _Floats: ...
    def column(self, j: int) -> _Floats: ...
    @property
    def energy(self) -> float: ...

class DenseColumns(NormalEquations):
    def __init__(self, columns: _Floats, y: _Floats) -> None: ...

class EqualGaussians(NormalEquations):
    @staticmethod
    def on_grid(
        t_first: float,
        t_step: float,
        t_count: int,
        r_first: float,
        r_step: float,
        r_count: int,
        width_t: float,
        width_r: float,
    ) -> EqualGaussians: ...
    @staticmethod
    def at(centers: _Floats, width_t: float, width_r: float) -> EqualGaussians: ...
    def add(self, samples: Samples) -> None: ...
    @property
    def centers(self) -> _Floats: ...
    @property
    def samples(self) -> float: ...

class OlsPath:
    chosen: list[int]
    reduction: _Floats
    rest: _Floats

def select_columns(
    dictionary: NormalEquations,
    max_columns: int,
    *,
    rho: float = 0.0,
    guard: float = 1e-7,
    given: int = 1,
    in_order: bool = False,
) -> OlsPath: ...
def least_squares(samples: Samples, gaussians: _Floats, ridge: float) -> _Floats: ...
def posteriors(prior: _Floats, precision: _Floats) -> tuple[_Floats, _Floats]:
    """Inverses of prior (n, n) + precision (units, n, n; contiguous), and their log determinants (units,).

    Raises:
        ValueError: A sum is not positive definite.
    """
