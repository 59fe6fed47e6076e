"""Learning in service: the C unit has the bits of its mirror; gates, authority and kept words hold."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from gyrotc.mirror.learning import (
    DISAGREES,
    E_ID,
    E_IMAGE,
    KEPT_WORDS,
    OK,
    REFUSED,
    Learner,
    ServicePrior,
    Stop,
    packed,
)

ROOT = Path(__file__).resolve().parents[3]


def prior(**changed: object) -> ServicePrior:
    """Of a laser gyro of the paper's class: deg/h, C, s."""
    knots = -40.0 + 100.0 / 7.0 * np.arange(8) - 10.0
    same = np.where(np.outer(knots, knots) > 0, np.minimum.outer(abs(knots), abs(knots)), 0.0)
    shape = {
        "id": 0x1234ABCD, "low_c": -40.0, "knots_per_c": 0.07, "reference_c": 10.0, "authority_dph": 0.03,
        "power_on_var": (3e-4**2, 1e-16, 1e-18, 3e-5**2), "memory_per_c": 0.0866, "memory_per_s": 1 / 14400,
        "warm_up_per_s": 1 / 600, "off_s": 172800.0, "noise_var": 1.2e-4**2 * 3600, "noise_ratio": 9.0,
        "span_c": 1.5, "settle_s": 0.0, "gate_square": 16.0, "jump_square": 16.0, "agreeing_rests": 3,
        "agreeing_power_ons": 2, "map_var": packed(2e-4**2 + 3.2e-5**2 * same),
        "ageing_var": packed((1e-12 + 1e-14 * same) / 3600.0),
    }  # fmt: skip
    return ServicePrior(**{**shape, **changed})  # type: ignore[arg-type]


class _Stop(ctypes.Structure):
    _fields_ = [
        *((n, ctypes.c_float) for n in ("time_s", "temp_c", "span_c", "rate_dph")),
        *((n, ctypes.c_float) for n in ("duration_s", "mean_var", "earth_var")),
        ("confirmed", ctypes.c_int32),
    ]  # fmt: skip


class Unit:
    """The compiled unit, one axis."""

    def __init__(self, library: ctypes.CDLL, known: ServicePrior) -> None:
        words = known.words()
        self.c, self.prior = library, (ctypes.c_uint32 * len(words))(*words)
        self.state = (ctypes.c_uint32 * 111)()
        assert self.c.gtc_learn_start(self.state, self.prior) == OK

    def power_on(self, off_s: float, temp_c: float) -> None:
        assert self.c.gtc_learn_power_on(self.state, self.prior, ctypes.c_float(off_s), ctypes.c_float(temp_c)) == OK

    def rest(self, stop: Stop) -> int:
        given = _Stop(stop.time_s, stop.temp_c, stop.span_c, float(np.asarray(stop.rate_dph)), stop.duration_s,
                      stop.mean_var, stop.earth_var, int(stop.confirmed))  # fmt: skip
        return int(self.c.gtc_learn_rest(self.state, self.prior, ctypes.byref(given)))

    def shift(self, time_s: float, temp_c: float) -> tuple[float, float]:
        found = (ctypes.c_float * 2)()
        given = ctypes.c_float(time_s), ctypes.c_float(temp_c)
        assert self.c.gtc_learn_shift(self.state, self.prior, *given, found) == OK
        return found[0], found[1]

    def numbers(self) -> np.ndarray:
        return np.frombuffer(self.state, dtype=np.uint32)[:104]

    def save(self) -> list[int]:
        words = (ctypes.c_uint32 * KEPT_WORDS)()
        assert self.c.gtc_learn_save(self.state, self.prior, words) == OK
        return list(words)

    def restore(self, words: list[int]) -> int:
        return int(self.c.gtc_learn_restore(self.state, self.prior, (ctypes.c_uint32 * KEPT_WORDS)(*words)))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    out = tmp_path_factory.mktemp("learn") / "learn.so"
    sources = [ROOT / "libc" / f"{n}.c" for n in ("gtc_learn", "gtc_f32", "gtc_crc")]
    subprocess.run(
        ["gcc", "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-ffp-contract=off", "-shared",
         "-fPIC", "-I", ROOT / "include", "-I", ROOT / "libc", *sources, "-o", out],
        check=True,
    )  # fmt: skip
    return ctypes.CDLL(str(out))


def bits(learner: Learner) -> np.ndarray:
    return np.concatenate([learner.x[:, 0], learner.p[:, 0]]).view(np.uint32)


def test_the_unit_has_the_bits_of_its_mirror(library: ctypes.CDLL) -> None:
    """Drawn power-ons and stops, wild ones among them, through both."""
    seed = int(np.random.default_rng().integers(2**31))
    print("seed", seed)
    draw = np.random.default_rng(seed)
    for soft in (16.0, 64.0):
        known = prior(jump_square=soft, span_c=2.0, power_on_var=(3e-4**2, 1e-16, 1e-8, 3e-5**2))
        unit, mirror = Unit(library, known), Learner(known)
        for _ in range(6):
            off, temp = float(draw.choice([np.nan, 5e4, 2.5e6])), float(np.float32(draw.uniform(-45, 65)))
            unit.power_on(off, temp)
            mirror.power_on(off, temp)
            time = 0.0
            for _ in range(12):
                time = float(np.float32(time + draw.choice([0.0, 1.0, 60.0, 3600.0, 1e5])))
                temp = float(np.float32(temp + draw.choice([0.0, 1e-4, 0.3, 7.0, 60.0]) * draw.choice([-1, 1])))
                stop = Stop(
                    time, temp, float(np.float32(draw.normal(0.0, 10.0 ** draw.uniform(-5, 0)))),
                    float(draw.choice([1.0, 60.0, 1800.0])), span_c=float(draw.choice([0.0, 2.0, 2.5])),
                    mean_var=float(np.float32(draw.choice([0.0, 1e-7, 1e-3]))),
                    earth_var=float(np.float32(draw.choice([0.0, 1e-8]))), confirmed=bool(draw.random() < 0.1),
                )  # fmt: skip
                assert unit.rest(stop) == mirror.rest(stop)[0]
                assert np.array_equal(unit.numbers(), bits(mirror))
                asked = (
                    float(np.float32(time + draw.uniform(0, 9000))),
                    float(np.float32(np.clip(temp + draw.normal(0, 5), -90, 200))),
                )
                y, sigma = mirror.shift(*asked)
                assert unit.shift(*asked) == (float(y[0]), float(sigma[0]))
            assert unit.save() == mirror.save()


def served(known: ServicePrior, wrong: float, seed: int) -> tuple[float, float, float]:
    """RMS of the error without and with learning, deg/h, and the largest |shift|; a share of the rests are wrong."""
    draw = np.random.default_rng(seed)
    learner, errors, shifts = Learner(known), [], []
    level = draw.normal(0, 4e-4)
    for _ in range(12):
        truth = level + draw.normal(0, 3e-4)
        learner.power_on(172800.0, 20.0)
        for k in range(6):
            temp = 20.0 + 4.0 * k
            rate = truth + draw.normal(0, 1.2e-4) + (draw.normal(0, 5.0) if draw.random() < wrong else 0.0)
            learner.rest(Stop(3600.0 * (k + 1), temp, rate, 3600.0))
            y = float(learner.shift(3600.0 * (k + 1) + 600.0, temp + 1.0)[0][0])
            errors.append((truth, truth - y))
            shifts.append(abs(y))
    plain, left = np.sqrt(np.mean(np.square(errors), axis=0))
    return float(plain), float(left), max(shifts)


def test_learning_lowers_the_error_and_wrong_rests_do_not_spoil_it() -> None:
    for seed in range(4):
        plain, left, _ = served(prior(), 0.0, seed)
        assert left < 0.5 * plain
        spoilt, largest = served(prior(), 0.2, seed)[1:]
        assert spoilt < 0.6 * plain and largest <= np.float32(0.03)


def test_each_gate_refuses_and_leaves_what_was_learned() -> None:
    known = prior(settle_s=100.0)
    good = {"time_s": 3600.0, "temp_c": 20.0, "rate_dph": 1e-4, "duration_s": 600.0}
    for wrong in (
        {"time_s": 50.0}, {"span_c": 2.0}, {"mean_var": 1e-5}, {"earth_var": float("nan")}, {"rate_dph": 0.1},
        {"rate_dph": 0.02},
    ):  # fmt: skip
        learner = Learner(known)
        learner.power_on(3600.0, 20.0)
        assert learner.rest(Stop(**{**good, **wrong}))[0] == REFUSED  # type: ignore[arg-type]
        assert not learner.x.any()
        assert learner.rest(Stop(**good))[0] == OK and learner.x.any()  # type: ignore[arg-type]


def test_a_step_is_accepted_when_three_power_ons_agree() -> None:
    learner = Learner(prior())
    answers = []
    for _ in range(4):
        learner.power_on(86400.0, 20.0)
        answers.append(int(learner.rest(Stop(3600.0, 20.0, 5e-3, 3600.0))[0]))
    assert answers[:3] == [REFUSED, REFUSED, DISAGREES]
    assert answers[3] == OK and abs(float(learner.shift(3600.0, 20.0)[0][0]) - 5e-3) < 5e-4


def test_kept_words_come_back_and_others_are_refused(library: ctypes.CDLL) -> None:
    """A hundred power cycles; every torn word; another table's; what is no covariance."""
    known = prior()
    unit, other = Unit(library, known), Unit(library, known)
    for cycle in range(100):
        unit.power_on(86400.0, 20.0)
        unit.rest(Stop(3600.0, 20.0 + cycle % 7, 2e-4, 1800.0))
        words = unit.save()
        assert other.restore(words) == OK and other.save() == words
        unit = Unit(library, known)
        assert unit.restore(words) == OK
    for k in range(KEPT_WORDS):
        torn = list(words)
        torn[k] ^= 1 << (k % 32)
        assert other.restore(torn) == E_IMAGE and other.save() == words
    assert Unit(library, prior(id=7)).restore(words) == E_ID


def test_no_state_leaves_the_authority(library: ctypes.CDLL) -> None:
    """Whatever bits a state has: the shift is a number within the authority, sigma one that is not negative."""
    seed = int(np.random.default_rng().integers(2**31))
    print("seed", seed)
    draw = np.random.default_rng(seed)
    unit = Unit(library, prior())
    for _ in range(2000):
        unit.state[:] = draw.integers(0, 2**32, 111, dtype=np.uint64).tolist()
        y, sigma = unit.shift(float(draw.uniform(0, 1e6)), float(draw.uniform(-90, 200)))
        assert abs(y) <= np.float32(0.03) and sigma >= 0.0
