"""Learning in service on a target: drawn calls through the compiled unit and its mirror, bit for bit.

The gyro learns over some power-ons, saves, is cut off in a write after every number of words, takes back what it kept
before, and goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..common.texts import c_environment
from ..model import Model
from ..results.release import LearnedCalls
from ..store.files import write_own
from ..target.learning import KEPT_WORDS, KNOTS, Learner, ServicePrior, Stop
from .toolchain import Target, compile_objects, link, run_program

Words = NDArray[np.uint32]
_SEED = 20140904  # of the calls: the same for every table
_SHOWN = 5  # mismatches
_START, _POWER_ON, _REST, _SHIFT, _SAVE, _TORN, _BEFORE = range(7)  # calls of learn.c.j2
_NAMES = ("start", "power_on", "rest", "shift", "save", "restore of a torn write", "restore")
_POWER_ONS, _RESTS = 4, 9  # the least that pass each gate, and are refused by it


@dataclass(frozen=True, slots=True)
class _Call:
    kind: int
    numbers: tuple[float, ...] = ()
    whole: int = 0  # words of a torn write, or whether a rest is confirmed

    def words(self) -> list[int]:
        numbers = np.array(self.numbers, dtype=np.float32).view(np.uint32).tolist()
        found = [self.kind, *([self.whole] if self.kind == _TORN else [*numbers, self.whole])]
        return [*found, *[0] * (9 - len(found))]


def drawn_calls(prior: ServicePrior) -> list[_Call]:
    """Power-ons with rests that are accepted, and that each gate refuses; a save after each."""
    draw = np.random.default_rng(_SEED)
    high = prior.low_c + (KNOTS - 1) / prior.knots_per_c
    sigma = float(np.sqrt(prior.map_var[0] + prior.power_on_var[0] + prior.power_on_var[3]))
    calls = [_Call(_START)]

    def one_power_on() -> Iterator[_Call]:
        temp_c, time_s = draw.uniform(prior.low_c, high), prior.settle_s
        yield _Call(_POWER_ON, (float(draw.choice([np.nan, 5e4])), temp_c))
        for k in range(_RESTS):
            time_s += 10.0 ** draw.uniform(0, 4)
            temp_c = float(np.clip(temp_c + draw.normal(0, 8), prior.low_c - 5, high + 5))
            size = (1.0, 1.0, 1.0, 30.0)[k % 4]  # a wrong one now and then
            span_c = prior.span_c * (1.0 if k else 2.0)
            earth_var = np.nan if k == 1 else (0.1 * sigma) ** 2
            rate = size * draw.normal(0, sigma)
            yield _Call(_REST, (time_s, temp_c, span_c, rate, 600.0, 0.0, earth_var), int(k == 7))
            yield _Call(_SHIFT, (time_s + draw.uniform(0, 900), temp_c + draw.normal(0, 3)))

    for _ in range(_POWER_ONS):
        calls += [*one_power_on(), _Call(_SAVE)]
    calls += [_Call(_TORN, whole=n) for n in range(KEPT_WORDS + 1)]
    return [*calls, _Call(_BEFORE), *one_power_on(), _Call(_SAVE)]


def expected_words(prior: ServicePrior, calls: Sequence[_Call]) -> Words:
    """What learn.c must answer, a row for each call."""
    learner = Learner(prior)
    kept = [[0] * KEPT_WORDS, [0] * KEPT_WORDS]
    shift = np.zeros(2, dtype=np.float32)
    rows = []
    for call in calls:
        status, numbers = 0, call.numbers
        if call.kind == _START:
            learner = Learner(prior)
        elif call.kind == _POWER_ON:
            learner.power_on(*numbers)
        elif call.kind == _REST:
            time_s, temp_c, span_c, rate, duration_s, mean_var, earth_var = numbers
            stop = Stop(time_s, temp_c, rate, duration_s, span_c, mean_var, earth_var, bool(call.whole))
            status = int(learner.rest(stop)[0])
        elif call.kind == _SHIFT:
            shift = np.concatenate(learner.shift(*numbers))
        elif call.kind == _SAVE:
            kept = [kept[1], learner.save()]
        elif call.kind == _TORN:
            status = Learner(prior).restore(kept[1][: call.whole] + kept[0][call.whole :])
        else:
            status = learner.restore(kept[0])
        state = np.concatenate([learner.x[:, 0], learner.p[:, 0]]).view(np.uint32).tolist()
        rows.append([status & 0xFFFFFFFF, *state, *kept[1], *shift.view(np.uint32).tolist()])
    return np.array(rows, dtype=np.uint32)


def learned_on(
    target: Target, model: Model, prior: ServicePrior, c: Path, objects: Sequence[Path], work: Path
) -> LearnedCalls:
    """Runs the calls on a target.

    Args:
        objects: Runtime and table.

    Raises:
        CheckFailed: The compiler refused, or the program did not run to its end.
    """
    source = work / "learn.c"
    text = c_environment().get_template("learn.c.j2").render(id=model.id, symbol=model.symbol)
    write_own(source, text)
    own = compile_objects(target, [source], work, include=c)
    link(target, [*own, *objects], work / "learn")
    calls = drawn_calls(prior)
    expected = expected_words(prior, calls)
    word = np.dtype("<u4" if target.byte_order == "little" else ">u4")
    given = np.array([len(calls), *(w for call in calls for w in call.words())], dtype=word)
    done = run_program(target, work / "learn", [given.tobytes()])
    if done.returncode != 0 or len(done.stdout) != 4 * expected.size:
        raise CheckFailed(f"the test of learning ended with status {done.returncode} {done.stderr[:200]}")
    got = np.frombuffer(done.stdout, dtype=word).astype(np.uint32).reshape(expected.shape)
    wrong = np.flatnonzero((got != expected).any(axis=1))
    first = tuple(
        f"call {k}, {_NAMES[calls[k].kind]}: word {at} is {int(got[k, at]):08x}, reference {int(expected[k, at]):08x}"
        for k in wrong[:_SHOWN].tolist()
        for at in [int(np.argmax(got[k] != expected[k]))]
    )
    return LearnedCalls(calls=len(calls), words=expected.size, mismatches=wrong.size, first_mismatches=first)
