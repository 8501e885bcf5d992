"""Judges of what a command says of an arm: modes, responses, poles, margins and maps against the independent model."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from tests.plausible.arms import PLACES, Law, log
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
    """`tfarm margins`: verdict, edges, gains inside and outside the windows, and each margin at its frequency."""

    def arguments(self, case):
        return case.law.options

    def judge(self, case, models, ran):
        judged, answer, law = Judged(), ran.answer, case.law
        if answer["verdict"] != "marginal":
            self._verdict(judged, models, law, answer["stable"], "the law")
        for row in answer["stability_intervals"]:
            self._windows(judged, case, models, row)
        if answer["stable"]:
            self._gain_margin(judged, case, models, answer)
            self._margins(judged, case, models, answer["in_range"])
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

    def _windows(self, judged, case, models, row):
        name, (low, high) = row["number"], row["search_range"]
        windows = [(float(each["low"]), float(each["high"])) for each in row["intervals"]]
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

    def _gain_margin(self, judged, case, models, answer):
        low, high = (float(end) for end in answer["gain_margin"])
        for t in (low + BESIDE, 1.0, min(high, 3.0) * (1 - BESIDE)):
            if low < t < high:
                self._verdict(judged, models, scaled(case.law, t), True, f"the law times {t!r}")
        for t in (low * (1 - BESIDE), high * (1 + BESIDE)):
            if 0 < t < np.inf and growing(models, scaled(case.law, t)) == 0:
                judged.blind += 1

    def _margins(self, judged, case, models, band):
        """At the frequency printed L has the margin printed; on a grid it has no smaller one."""
        top = min(band["up_to_rad_s"], trusted(models))
        if np.isfinite(float(band["phase_margin_deg"])):
            at, size = band["phase_margin_at_rad_s"], abs(band["phase_margin_deg"])
            self._phase(judged, models, case.law, at, size, band["up_to_rad_s"])
        w = dense(models, case.law, top)
        L = np.array([loop_function(models.rough, case.law, each) for each in w])
        for key, f in (("disk_margin", disk), ("peak_sensitivity", peak)):
            where, printed = band[f"{key}_at_rad_s"], float(band[key])
            if (
                where is not None and where <= top and (key == "disk_margin" or printed > 1)
            ):  # S = 1 at infinite frequency
                fine, rough = (extreme(f, m, case.law, where, band["up_to_rad_s"]) for m in (models.fine, models.rough))
                size = max(abs(fine), 1e-300)
                judged.error(f"{key} at {where}", abs(printed - fine) / size, 1e-5 + SAFETY * abs(fine - rough) / size)
            least = f(L).min() if key == "disk_margin" else 1 / f(L).max()
            least = least if key == "disk_margin" else min(1.0, least)
            bound = printed if key == "disk_margin" else 1 / printed
            judged.error(f"{key}: worse on a grid", max(0.0, bound / least - 1), 1e-4)

    def _phase(self, judged, models, law, where, printed, top):
        """Next to the frequency printed |L| = 1 with that phase."""
        if where > trusted(models):
            judged.blind += 1
            return
        found = []
        for model in (models.fine, models.rough):
            at = around(model, law, where, top)
            sign = np.array([np.sign(abs(loop_function(model, law, w)) - 1) for w in at])
            ends = [(at[i], at[i + 1]) for i in np.nonzero(sign[1:] * sign[:-1] < 0)[0]]
            places = [brentq(lambda w: abs(loop_function(model, law, w)) - 1, *pair, xtol=1e-300) for pair in ends]  # noqa: B023
            phases = [abs(np.angle(-loop_function(model, law, w))) * 180 / np.pi for w in places]
            found.append(min(phases, key=lambda phase: abs(phase - printed), default=np.inf))
        judged.error("phase margin", abs(found[0] - printed), 1e-4 + SAFETY * abs(found[0] - found[1]), 5.0)


def scaled(law, t):
    """All gains times t."""
    return Law(law.K1 * t, law.K2 * t, law.Kp * t)


def loop_function(model, law, w):
    """L(i w) = -u_fed_back/u of the model."""
    s = 1j * w
    theta = model.coordinates(s)[0] @ model.b
    moment = (model.hub * s * s * theta - 1) / (1 + model.C * s)
    return (law.Kp + law.K1 * s) * theta + law.K2 * moment


def disk(L):
    """2 |(1 + L)/(1 - L)|."""
    return 2 * abs((1 + L) / (1 - L))


def peak(L):
    """|1/(1 + L)|."""
    return 1 / abs(1 + L)


def around(model, law, where, top):
    """Frequencies about one that is printed to seven digits, and about the pole there: features are as narrow as it is
    close to the axis.
    """
    pole = model.polished(1j * where, law)[0]
    width = max(abs(pole.real), 1e-13 * where)
    at = abs(pole.imag) + width * np.r_[-np.geomspace(1e3, 1e-2, 60), 0.0, np.geomspace(1e-2, 1e3, 60)]
    at = np.unique(np.r_[at, where * (1 + 1e-6 * np.linspace(-1, 1, 41))])
    return at[(at > 0) & (at <= top * (1 + 1e-14)) & (abs(at / where - 1) < 1e-4)]


def extreme(f, model, law, where, top):
    """The extreme of f(L) there: the least of `disk`, the largest of `peak`."""
    sign, at = 1 if f is disk else -1, around(model, law, where, top)
    values = [sign * f(loop_function(model, law, w)) for w in at]
    i = int(np.clip(np.argmin(values), 1, at.size - 2))
    low, reach = at[i - 1], at[i + 1] - at[i - 1]
    found = minimize_scalar(
        lambda share: sign * f(loop_function(model, law, low + share * reach)),
        bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-7},
    )  # fmt: skip
    return sign * min(found.fun, *values)


def dense(models, law, top):
    """A grid up to `top` [rad/s], with points about each pole, closed or open loop, as near as it is to the axis."""
    poles = np.r_[oscillating(models.rough, law, top), models.rough.modes[0]]
    poles = poles[(poles.imag > 0) & (poles.imag < top)][:40]
    near = (poles.imag[:, None] + abs(poles.real[:, None]) * np.array([-3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0])).ravel()
    w = np.r_[near, np.geomspace(1e-3 * models.rough.modes[0][0], top, 120)]
    return np.unique(w[(w > 0) & (w < top)])


@dataclass(frozen=True)
class Map:
    """`tfarm map`: the counts at a dozen points of the grid, and boundary points that are poles on the axis."""

    def arguments(self, case):
        unit = case.beam.total_inertia * case.first * log(case.rng, 0.05, 3.0)
        return [f"--K1={-0.3 * unit!r},{unit!r}", "--K2=-2,2", f"--Kp={case.law.Kp!r}", "--points", "21"]

    def judge(self, case, models, ran):
        judged, answer, rng = Judged(), ran.answer, case.rng
        for _ in range(12):
            i, j = rng.integers(len(answer["x"])), rng.integers(len(answer["y"]))
            law = Law(answer["x"][i], answer["y"][j], case.law.Kp)
            printed, count = answer["unstable_roots"][j][i], growing(models, law)
            if count is None or abs(law.K2 - 1) < 1e-9:
                judged.blind += 1
            elif printed == "inf":
                judged.truth(f"infinitely many for {count} at {law}", count > UNDAMPED)
            elif answer["up_to_rad_s"] > trusted(models) and case.beam.link.damping:
                judged.truth(f"{printed} for at least {count} unstable at {law}", printed >= count)
            else:
                judged.truth(f"{printed} for {count} unstable at {law}", printed == count)
        points = [point for point in answer["boundary"] if point[2] < trusted(models)]
        for at in rng.permutation(len(points))[:5]:
            K1, K2, w = points[at]
            digits = 8 * EPS * (case.first / w) ** 2  # of K2, where hub and arm nearly balance each other
            pole_check(judged, "boundary", 1j * w, models, Law(K1, K2, case.law.Kp), digits)
        return judged
