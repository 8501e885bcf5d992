"""Judges of what a command says of an arm: modes, responses, poles and windows against the independent model."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tests.plausible.arms import PLACES
from tests.plausible.model import EPS, Model

BLIND = 1e-2  # relative: a model whose own error is larger says nothing


@dataclass
class Judged:
    """What the model says of one answer: the checks that failed, the worst error, and how many checks it could make."""

    wrong: list = field(default_factory=list)
    worst: float = 0.0
    checks: int = 0
    blind: int = 0

    def number(self, what, printed, model, tolerance, blind=BLIND):
        """A printed number beside the model's; all relative to the size that the caller divided by, or absolute."""
        self.error(what, abs(printed - model), tolerance, blind, f"{printed!r} for {model!r}")

    def error(self, what, error, tolerance, blind=BLIND, text=""):
        """An error, and the model's own."""
        if not math.isfinite(tolerance) or tolerance > blind:
            self.blind += 1
            return
        self.checks += 1
        if not error <= tolerance:
            self.wrong.append(f"{what}: off by {error:.2g}, tolerance {tolerance:.2g} {text}")
        self.worst = max(self.worst, float(error))

    def truth(self, what, holds):
        """Something that is so or not."""
        self.checks += 1
        if not holds:
            self.wrong.append(what)


ROUGH, FINE = 56, 72  # Legendre terms of the two models: right to 1e-9 up to modes 27 and 36 (rounding apart)
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


@dataclass(frozen=True)
class Modes:
    """`tfarm modes`: frequencies, hub participation, modal moments, eigenvalues, beside eigenvalues of the model."""

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


BESIDE = 1e-5  # share of a printed edge on either side of which the loop is looked at
CLEAR = 1e-6  # of |s|: a smaller real part is polished before it is believed
UNDAMPED = 15  # modes that it looks at where C = 0
MOST = 25  # poles next to the axis that it polishes


def oscillating(model, law, top):
    """The model's poles in |Im s| <= top with Im >= 0 but those at 0: (n,), as the linear form has them."""
    return upper(model.eigenvalues(law), model.modes[0][0], top)


def upper(s, scale, top):
    """Those of the eigenvalues with 0 <= Im <= top, but those at 0 beside a frequency `scale`; ascending in size."""
    s = s[(s.imag >= -1e-9 * abs(s)) & (abs(s) > 1e-7 * scale) & (s.imag <= 1.05 * top)]
    return s[np.argsort(abs(s))]


def trusted(models):
    """The frequency [rad/s] up to which both models agree on the modes to a millionth."""
    fine, rough = models.fine.modes[0], models.rough.modes[0]
    off = abs(rough / fine[: rough.size] - 1) > 1e-6
    return float(fine[max(0, int(np.argmax(off)) - 1)])


def growing(models, law, top=None):
    """Poles of the model right of the axis below `top` [rad/s], conjugates counted; None where it cannot tell.

    Those near the axis are polished first: the linear form's rounding is larger than their damping.
    """
    top = trusted(models) if top is None else min(top, trusted(models))
    if models.beam.link.damping == 0:
        top = min(top, float(models.fine.modes[0][UNDAMPED]))
    every = models.rough.eigenvalues(law)
    rounding = 1e3 * EPS * abs(every).max()
    starts = upper(every, models.rough.modes[0][0], top)
    near = abs(starts.real) < np.maximum(CLEAR * abs(starts), rounding)
    right = starts[(starts.real > 0) & ~near & (starts.imag <= top)]
    count = int(np.where(right.imag > 1e-7 * abs(right), 2, 1).sum())
    for start in starts[near & (starts.imag <= top)][:MOST]:
        sign = side(models, complex(start), law)
        if sign is None:
            return None
        count += int(np.where(start.imag > 1e-7 * abs(start), 2, 1)) * int(sign > 0)
    return count


def side(models, start, law):
    """The sign of the real part of the pole next to a start; None where the model's own error is larger."""
    fine, step = models.fine.polished(start, law)
    if abs(fine - start) > 0.02 * abs(start):
        return None
    error = step
    if abs(fine.real) < 1e-6 * abs(fine):
        other, _ = models.rough.polished(start, law)
        error += SAFETY * abs(fine.real - other.real)
    return None if abs(fine.real) <= error + 1e-15 * abs(fine) else float(np.sign(fine.real))


@dataclass(frozen=True)
class Poles:
    """`tfarm poles`: each printed pole is one of the model's, and none of the model's in the box is missing."""

    def arguments(self, case):
        return case.law.options

    def judge(self, case, models, ran):
        judged, answer, law = Judged(), ran.answer, case.law
        printed = np.array([complex(*pole) for pole in answer["poles"]])
        for pole in printed[printed != 0]:
            pole_check(judged, "pole", complex(pole), models, law)
        left, right, _, top = answer["box"]
        moving, blind = printed[printed != 0], 0
        for start in oscillating(models.rough, law, top):
            if not (left < start.real < right and start.imag < top < trusted(models)):
                continue
            pole, step = models.fine.polished(complex(start), law)
            off = abs(pole - models.rough.polished(complex(start), law)[0])
            inside = left * (1 - 1e-6) < pole.real < right and -1e-9 * abs(pole) <= pole.imag < top * (1 - 1e-6)
            if not inside or abs(pole) < 1e-7 * case.first:
                continue
            if off + step > 1e-6 * abs(pole):
                blind += 1
                continue
            pole = complex(pole.real, abs(pole.imag))
            judged.truth(f"{pole} of the model is missing", bool((abs(moving - pole) < 1e-4 * abs(pole)).any()))
        judged.blind += blind
        clear = abs(moving.real) > 1e-9 * abs(moving)
        if clear.all() and moving.size:
            unstable = int(np.where(moving.imag > 0, 2, 1)[moving.real > 0].sum())
            judged.truth(f"{answer['unstable']} unstable for {unstable}", answer["unstable"] == unstable)
        return judged


@dataclass(frozen=True)
class Margins:
    """`tfarm margins`: verdict, edges, gains inside and outside the windows."""

    def arguments(self, case):
        return case.law.options

    def judge(self, case, models, ran):
        judged, answer, law = Judged(), ran.answer, case.law
        if answer["verdict"] != "marginal":
            self._verdict(judged, models, law, answer["stable"], "the law")
        for name in ("K1", "K2", "Kp"):
            self._windows(judged, case, models, name, answer)
        return judged

    def _verdict(self, judged, models, law, stable, what):
        count = growing(models, law)
        if count is None:
            judged.blind += 1
            return
        if count:
            judged.truth(f"{what} is called stable, {count} poles grow ({law})", not stable)
        elif stable:
            judged.checks += 1
        else:  # the model sees its own modes only: that it finds none proves nothing about the others
            judged.blind += 1

    def _windows(self, judged, case, models, name, answer):
        low, high = answer[f"{name}_looked_at"]
        windows = [tuple(map(float, pair)) for pair in answer[f"{name}_windows"]]
        ends = [end for pair in windows for end in pair if low < end < high]
        for end in ends[:4]:
            self._edge(judged, models, case.law, name, end, windows)
        for value in case.rng.uniform(low, high, 3):
            inside = any(a < value < b for a, b in windows)
            near = min((abs(value - end) for end in ends), default=np.inf) < 1e-3 * (high - low)
            if not near and not (case.beam.link.damping == 0 and name == "K2" and abs(value - 1) < 1e-3):
                self._verdict(judged, models, replace(case.law, **{name: float(value)}), inside, f"{name} = {value!r}")

    def _edge(self, judged, models, law, name, end, windows):
        """On one side of the edge the loop holds, on the other it does not."""
        step = BESIDE * (abs(end) or 1e-3 * abs(getattr(law, name)))
        for value in (end - step, end + step):
            inside = any(a < value < b for a, b in windows)
            self._verdict(judged, models, replace(law, **{name: value}), inside, f"{name} = {value!r}, by an edge")
            if not inside and growing(models, replace(law, **{name: value})) == 0:
                judged.blind += 1
