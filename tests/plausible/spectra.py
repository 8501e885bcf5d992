"""Judges of the verbs that look at the arm itself: modes, response, reduce, assumptions."""

import json
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tests.plausible.arms import PLACES, log
from tests.plausible.judging import Judged
from tests.plausible.model import EPS, Model

COARSE, ROUGH, FINE = (
    24,
    56,
    72,
)  # Legendre terms of the two models: right to 1e-9 up to modes 27 and 36 (rounding apart)
ROUNDING = 256  # eps of the model's largest flexibility (tests.spectrum.proofs)
ENDS = (
    "hub_angle", "hub_rate", "tip_displacement", "tip_deflection", "tip_acceleration", "root_moment", "root_shear",
)  # fmt: skip
ALONG = ("deflection", "rotation", "moment", "shear")
SAFETY = 20  # times the difference of two models


class Models:
    """The two models of an arm, made once."""

    def __init__(self, beam, rough=ROUGH, fine=FINE):
        self.beam, self.rough, self.fine = beam, Model(beam, rough), Model(beam, fine)

    @cached_property
    def coarse(self):
        """A small model for many loops."""
        return Model(self.beam, COARSE)

    def both(self, of):
        """Something of the finer model, and the tolerance that its difference from the rougher one gives."""
        value = of(self.fine)
        return value, SAFETY * abs(value - of(self.rough))


@dataclass(frozen=True)
class Modes:
    """`tfarm modes`: frequencies, hub participation, modal moments, eigenvalues, beside eigenvalues of the model."""

    oracle = "frequencies, participations, root moments by eigenvalues; damped ones by inverse iteration"

    def arguments(self, case):
        return ["--count", str(int(case.rng.integers(3, 21)))]

    def judge(self, case, models, ran):
        judged, rows = Judged(), [row for row in ran.answer["modes"] if row["index"]]
        fine, rough = models.fine, models.rough
        (omega, shapes), (other, others) = fine.modes, rough.modes
        rounding = ROUNDING * EPS * (omega / omega[0]) ** 2
        for row in rows:
            n = row["index"] - 1
            w, printed = omega[n], row["natural_frequency_rad_s"]
            own = SAFETY * abs(other[n] / w - 1) + rounding[n] + 8 * EPS
            judged.error(f"mode {n + 1}", abs(printed / w - 1), own, 1e-4, f"{printed!r} for {w!r}")
            b, b2 = abs(fine.b @ shapes[:, n]), abs(rough.b @ others[:, n])
            size = 1 / np.sqrt(case.beam.total_inertia)  # of a participation: the rigid body's
            slack = (1e-9 + SAFETY * abs(b - b2) / size) + 1e3 * rounding[n]
            judged.number(f"participation {n + 1}", abs(row["hub_participation"]) / size, b / size, slack, 1e-4)
            if "eigenvalue" in row or "eigenvalues" in row:
                self._eigenvalue(judged, row, models, own)
        judged.truth("complete", ran.answer["complete"] is True)
        return judged

    def _eigenvalue(self, judged, row, models, own):
        zeros = [complex(*row["eigenvalue"])] if "eigenvalue" in row else [complex(p) for p in row["eigenvalues"]]
        for zero in zeros:
            pole_check(judged, f"eigenvalue of mode {row['index']}", zero, models, None, own)


def pole_check(judged, what, printed, models, law, own=0.0):
    """A printed pole beside the model's nearest one, relative to its size."""
    fine, step = models.fine.polished(printed, law)
    rough, other = models.rough.polished(printed, law)
    size = abs(fine) or 1.0
    slack = SAFETY * (abs(fine - rough) + step + other) / size + own + 1e-11
    judged.error(what, abs(printed - fine) / size, slack, 1e-3, f"{printed} for {fine}")


@dataclass(frozen=True)
class Response:
    """`tfarm response`: one output on the axis and off it, beside the model's solution at the same s."""

    oracle = "one linear solution for each s; error over |G| + |s G'|"

    def arguments(self, case):
        rng = case.rng
        name = str(rng.choice([*ENDS, *ENDS, *ALONG]))
        w = case.first * np.exp(rng.uniform(np.log(1e-3), np.log(60.0), 6))
        s = [complex(0.0, each) for each in w[:4]] + [complex(each * rng.uniform(-0.3, 1), each) for each in w[4:]]
        options = ["--output", name, "--s=" + ",".join(f"{p.real!r}{p.imag:+.17g}j" for p in s)]
        return options + (["--x", repr(case.beam.link.length * float(rng.choice(PLACES)))] if name in ALONG else [])

    def judge(self, case, models, ran):
        judged, answer = Judged(), ran.answer
        name, x = answer["output"], answer.get("x")
        for point, value in zip(answer["s"], answer["value"], strict=True):
            s, printed = complex(*point), complex(*value)
            near = s * (1 + np.array([0, 1e-4, -1e-4]))
            G, size = _with_size(models.fine.response(name, near, x))
            other = models.rough.response(name, near[:1], x)[0]
            zero = self._noise(models.fine, name, s)
            slack = SAFETY * abs(G - other) / size + 1e-9 + zero / size
            judged.error(f"{name} at {s}", abs(printed - G) / size, slack, 1e-3, f"{printed} for {G}")
        return judged

    def _noise(self, model, name, s):
        """The model's rounding in a moment or deflection that is the small difference of large ones."""
        theta = abs(model.response("hub_angle", np.array([s]))[0])
        L, J = model.beam.link.length, model.beam.total_inertia
        of_angle = {"tip_deflection": L, "deflection": L, "rotation": 1.0, "root_moment": J * abs(s) ** 2}
        of_angle |= {"moment": J * abs(s) ** 2, "shear": J / L * abs(s) ** 2, "root_shear": J / L * abs(s) ** 2}
        return 1e-11 * theta * of_angle.get(name, 0.0)


def _with_size(values):
    """G and |G| + |s G'| from G at s, and a ten-thousandth of s to either side."""
    G, right, left = values
    return G, abs(G) + abs(right - left) / 2e-4


@dataclass(frozen=True)
class Reduce:
    """`tfarm reduce`: its state space at random frequencies, within the error that it prints."""

    oracle = "C (i w - A)^-1 B + D beside the model's response, at 24 w of the band"

    def arguments(self, case):
        rng = case.rng
        low, high = case.first * log(rng, 1e-3, 0.1), case.first * log(rng, 1.5, 40.0)
        names = [str(name) for name in rng.choice(ENDS, size=2, replace=False)]
        asked = ["--order", str(2 * int(rng.integers(2, 14)))]
        if rng.random() < 0.5:
            asked = ["--error", repr(10 ** -float(rng.integers(2, 6)))]
        return ["--outputs", ",".join(names), "--band", f"{low!r},{high!r}", *asked]

    def judge(self, case, models, ran):
        judged, answer = Judged(), ran.answer
        A, B, C, D = (np.array(answer[name], dtype=float) for name in "ABCD")
        low, high = answer["band_rad_s"]
        for w in np.exp(np.random.default_rng(1).uniform(np.log(low), np.log(high), 24)):
            values = C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B.astype(complex)) + D
            near = 1j * w * (1 + np.array([0, 1e-4, -1e-4]))
            for name, value in zip(answer["outputs"], values[:, 0], strict=True):
                G, size = _with_size(models.fine.response(name, near))
                other = models.rough.response(name, near[:1])[0]
                slack = SAFETY * abs(G - other) / size + 1e-8 + Response()._noise(models.fine, name, 1j * w) / size
                allowed = answer["errors"][name] * (1 + 1e-6) + slack
                excess = max(0.0, abs(value - G) / size - answer["errors"][name])
                if slack < 1e-3:
                    judged.error(f"{name} at {w} rad/s", excess, allowed - answer["errors"][name], np.inf)
        return judged


@dataclass(frozen=True)
class Assumptions:
    """`tfarm assumptions`: the frequencies over candidate hub inertias."""

    oracle = "frequencies of a model with the candidate's hub"

    def arguments(self, case):
        return []

    def judge(self, case, models, ran):
        judged, hub = Judged(), ran.answer["hub"]
        own = [row for row in hub["candidates"] if row["is_own"]]
        omega = models.fine.modes[0]
        for n, printed in enumerate(own[0]["natural_frequency_rad_s"] if own else []):
            judged.error(f"mode {n + 1}", abs(printed / omega[n] - 1), 1e-7)
        return judged


def dumped(answer):
    """The answer as text, for a listing."""
    return json.dumps(answer)[:300]
