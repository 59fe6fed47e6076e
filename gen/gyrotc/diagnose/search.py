"""One data set under all noise colours: the colours that it allows, and its views under them.

Everything that is asked of the data afterwards (`project`, `detection`) is algebra on these inner products.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import FloatArray
from ..common.quantiles import CHI2_95_TWO
from .blocks import Records
from .colours import COLOURS, Colour
from .joined import Channels, Joined, join
from .signature_bank import SignatureBank
from .views import Question, View, possible_effects, view_of, view_of_bank

__all__ = ["Search", "open_search"]


_COLOUR_RATIO = 16.0  # twice the log-likelihood ratio between the best colour and one that is contradicted


@dataclass(frozen=True)
class Search:
    """A data set, the signatures it is held against, and its views.

    Attributes:
        question: Data, columns, and what may be an effect.
        channels: Columns of the auxiliary channels, as they were given.
        beside: Columns that are in every model beside the map (blocks left out, causes found), shape (N, b).
        declared: Covariance of block means that is declared, (deg/h)²; None: nothing is.
        views: By number of the colour in `COLOURS`; the declared colour has the number after the last.
        best: Number of the likeliest colour.
        allowed: Numbers of the colours that the data allow (95 %: ratio and correlation time are free).
        cautious: Whether a cause must be significant under every colour, not on their average.
    """

    question: Question
    channels: Channels | None
    beside: FloatArray | None
    declared: Colour | None
    views: Mapping[int, View]
    best: int
    allowed: tuple[int, ...]
    cautious: bool = False

    @property
    def records(self) -> Records:
        """The runs."""
        return self.question.records

    @property
    def bank(self) -> SignatureBank:
        """Signatures of all candidates on the temperatures of these runs."""
        return self.question.bank

    @property
    def y(self) -> FloatArray:
        """Block means of the rate, deg/h, shape (N,)."""
        return self.question.y

    @property
    def sigma(self) -> FloatArray | None:
        """Factor of the noise of every block, shape (N,); None: even."""
        return self.question.sigma

    @property
    def joined(self) -> Joined:
        """All columns."""
        return self.question.joined

    @property
    def likeliest(self) -> View:
        """The view under the likeliest colour."""
        return self.views[self.best]

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residual likelihood."""
        return int(self.y.size - self.question.effects.shape[1])

    def view_of(self, colour: Colour) -> View:
        """The view under any colour."""
        return view_of(self.question, colour)

    def contradicts(self, view: View) -> bool:
        """Whether the data are so much likelier under another colour that that of the view cannot be theirs."""
        return 2.0 * (self.likeliest.log_likelihood - view.log_likelihood) > _COLOUR_RATIO

    def map_weights(self) -> FloatArray:
        """Least-squares weights of the map, shape (m,)."""
        return np.asarray(self.bank.map.T @ self.y)

    def extended(self, columns: FloatArray) -> Search:
        """The same search with further columns, shape (N, k), in every model.

        Only the colours that the data allow are looked at again.
        """
        held = columns if self.beside is None else np.column_stack([self.beside, columns])
        wider = open_search(
            self.records,
            self.bank,
            self.y,
            channels=self.channels,
            beside=held,
            sigma=self.sigma,
            declared=self.declared,
            colours=self.allowed,
        )
        return replace(wider, cautious=self.cautious)


def open_search(
    records: Records,
    bank: SignatureBank,
    y: FloatArray,
    *,
    channels: Channels | None = None,
    beside: FloatArray | None = None,
    sigma: FloatArray | None = None,
    declared: Colour | None = None,
    colours: Sequence[int] | None = None,
) -> Search:
    """Binds a bank to one record of rates.

    Args:
        records: The runs.
        bank: Their bank.
        y: Block means of the rate, deg/h, shape (N,).
        channels: Columns of the auxiliary channels and their candidates.
        beside: Columns that are in every model beside the map, shape (N, b).
        sigma: Factor of the noise of every block, shape (N,); None: even.
        declared: Covariance of block means that is declared, (deg/h)²; None: nothing is.
        colours: Numbers of the colours that are looked at; None: all, and the declared one as the last.
    """
    joined = join(bank, y, channels, beside)
    question = Question(records, bank, y, sigma, joined, possible_effects(bank, joined, records.size))
    count = len(COLOURS)
    numbers = range(count + (declared is not None)) if colours is None else colours
    views = {}
    for k in numbers:
        if k < count or declared is None:
            views[k] = view_of_bank(question, k)
        else:
            views[k] = view_of(question, declared)
    top = max(view.log_likelihood for view in views.values())
    best = next(k for k, view in views.items() if view.log_likelihood == top)
    allowed = tuple(k for k, view in views.items() if 2.0 * (top - view.log_likelihood) <= CHI2_95_TWO)
    return Search(question, channels, beside, declared, views, best, allowed)
