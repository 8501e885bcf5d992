"""A linear law as a record: from the signals of a rig to its input,

    v = -sum over signals of C_i(s) e^{-s tau} (y_i - r_i),

with the minus of the paper's (19) (`sign` = 1 for +).  `HubFeedback` is the simplest law: constant gains on hub angle,
hub rate and root moment.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property, reduce
from itertools import chain
from operator import mul
from typing import Annotated, Any

import numpy as np

from tfarm.arm.blocks import LawBlock, Matrices, Rational, StateSpace, block_of
from tfarm.arm.checks import INPUTS, check_annotated, not_negative, number, positive
from tfarm.arm.feedback import AT_HUB, GAINS, ON, OUTPUT_OF, HubFeedback
from tfarm.arm.records import Arm
from tfarm.arrays import Complex
from tfarm.errors import ParameterError, did_you_mean, must_be_known, require
from tfarm.moved import FormerName
from tfarm.records import frozen

# before the name of a signal: its reference
REFERENCE = "reference:"
# a signal, or one of its coefficients
NUMBER = re.compile(r"(.*?)(?:\.gain|\.(num|den)\.(\d+))?", re.DOTALL)


@frozen
class Part:
    """One block of a law and its signals: names of outputs, with "@x" [m] for those along the link.

    "reference:hub_angle" is the reference of hub_angle, outside the loop.  "" is an unconnected column.
    """

    signals: tuple[str, ...]
    block: LawBlock


@frozen
class Law:
    """A linear law from named signals to the rig's input.

    `entries` maps a signal ("hub_angle", "tip_acceleration", "strain@0.05") to its factor: a number, a pair (num, den),
    a mapping of zeros, poles and gain, or a python-control system.  `parts` are the entries as blocks.
    `delay` [s] is that of the controller.  `input` is the driven input, by default that of the arm.  With a `period`
    [s] the law is in z, without one in s.  Signals among `references` enter as (signal - reference).  `sign` is -1, or
    1 for v = +C y.  `rule` and `prewarp` [rad/s] are those of the discretisation of a continuous-time law.
    `anti_windup` [s] is the time constant of back-calculation to the integrator at a limit of the input, 0 for none.
    Raises ParameterError, naming the key, for illegal values.
    """

    entries: Mapping[str, Any] = field(repr=False, compare=False)
    delay: Annotated[float, not_negative, "a delay in s, 0 or more"] = 0.0
    input: str | None = None
    period: float | None = None
    references: tuple[str, ...] = ()
    sign: int = -1
    rule: str = "tustin"
    prewarp: Annotated[float, not_negative, "a frequency in rad/s, or 0"] = 0.0
    name: str = "law"
    anti_windup: Annotated[float, not_negative, "a time constant in s, or 0"] = 0.0
    parts: tuple[Part, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        # of a law, for time and memory
        most_signals = 12
        parts, periods = (self.parts, ()) if self.parts else _parts_of(self.entries)
        object.__setattr__(self, "parts", parts)
        object.__setattr__(self, "entries", {})
        check_annotated(self, "")
        known = set(periods)
        if self.period is not None:
            meaning = "a sampling period in s; leave it out for a continuous-time law"
            known.add(positive("period", self.period, meaning))
        remedy = "the parts of a law have one sampling period in common"
        require(len(known) <= 1, "period", sorted(known), remedy)
        object.__setattr__(self, "period", known.pop() if known else None)
        object.__setattr__(self, "references", tuple(self.references))
        require(self.sign in (-1, 1), "sign", self.sign, "-1 (v = -C y, the default) or 1 (v = C y)")
        if self.input is not None:
            must_be_known("input", self.input, INPUTS)
        must_be_known("rule", self.rule, ("tustin", "zoh", "matched"))
        count = len(self.signals)
        require(count <= most_signals, "signals", count, f"at most {most_signals} signals")
        for each in self.references:
            must_be_known("references", each, self.signals)
        remedy = "back-calculation is to an integrator, a pole of the law at s = 0, and it has none"
        is_integral = not self.anti_windup or self.is_discrete or self.has_integrator
        require(is_integral, "anti_windup", self.anti_windup, remedy)
        remedy = "a discrete-time law is causal: give num at most the degree of den"
        require(self.period is None or not self.is_improper, "num", self.name, remedy)

    @classmethod
    def of_matrices(cls, A: Any, B: Any, C: Any, D: Any, signals: Sequence[str], **others: Any) -> Law:
        """Build a law of one state space from several signals, in the order of the columns of B and D."""
        block = StateSpace(A, B, C, D)
        remedy = f"B has {block.signals} columns: name one signal for each"
        require(block.signals == len(signals), "signals", list(signals), remedy)
        columns = tuple(name and _signal(name, of_reference=True) for name in signals)
        law = cls({}, parts=(Part(columns, block),), **others)
        require(law.signals, "signals", list(signals), "name at least one measured signal")
        return law

    @classmethod
    def of_gains(cls, law: HubFeedback) -> Law:
        """Build the law of gains at the hub, on the errors of their signals."""
        used = {gain.output: law[gain.name] for gain in GAINS if law[gain.name]} or {"hub_rate": 0.0}
        return cls(used, name="gains at the hub", references=tuple(name for name in used if name in AT_HUB))

    def as_typed(self) -> Iterator[tuple[str, str]]:
        """Yield each signal and the text of its block; of a state space the number of states."""
        for part in self.parts:
            block = part.block
            if not isinstance(block, Rational):
                yield ", ".join(part.signals), f"<{block.order} states>"
            else:
                num, den = (f"[{', '.join(f'{each:.6g}' for each in of)}]" for of in (block.num, block.den))
                is_gain = block.is_constant and block.den == (1.0,)
                yield part.signals[0], num[1:-1] if is_gain else f"({num}, {den})"

    @property
    def columns(self) -> list[str]:
        """The names of all columns of its parts, in their order."""
        return list(chain.from_iterable(part.signals for part in self.parts))

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """The signals in the loop, each once."""
        return tuple(dict.fromkeys(filter(is_measured, self.columns)))

    @property
    def wanted(self) -> tuple[str, ...]:
        """The columns of references, such as "reference:hub_angle", each once."""
        return tuple(dict.fromkeys(name for name in self.columns if name.startswith(REFERENCE)))

    @property
    def is_discrete(self) -> bool:
        """Whether it is a law in z."""
        return self.period is not None

    @property
    def order(self) -> int:
        """The number of its states."""
        return sum(part.block.order for part in self.parts)

    @property
    def is_improper(self) -> bool:
        """Whether a part of it differentiates."""
        return any(part.block.excess > 0 for part in self.parts)

    @property
    def is_static(self) -> bool:
        """Whether it is a constant gain on each signal, without delay."""
        return all(part.block.is_constant for part in self.parts) and not (self.delay or self.is_discrete)

    @property
    def poles(self) -> Complex:
        """Its own poles [1/s], or in z."""
        return np.concatenate([np.empty(0, complex), *(part.block.poles for part in self.parts)])

    @cached_property
    def gains(self) -> HubFeedback | None:
        """The law as gains at the hub; None where it has more than those."""
        if not self.is_static or not set(self.signals) <= set(ON):
            return None
        numbers = self.values(np.zeros(1, complex))[:, 0].real.tolist()
        names = (ON[name] for name in self.signals)
        return HubFeedback(**dict(zip(names, numbers, strict=True)))

    @property
    def numbers(self) -> dict[str, float]:
        """Each number other than 0 in which the loop is linear, by its name in `with_number`.

        That is "gain", a factor on the law, and for each signal with a block of its own the constant gain, or the
        coefficients of its polynomials and, for more than one, a factor, "hub_angle.gain".  A signal in several parts
        has no number with a name.
        """
        found = {"gain": 1.0}
        for key, (place, value) in self.part_gains.items():
            block = self.parts[place].block
            name = key.removesuffix(".gain")
            if isinstance(block, StateSpace) or block.is_constant:
                found[key] = value
                continue
            if np.count_nonzero(block.num) > 1:
                found[key] = value
            found |= {f"{name}.num.{n}": each for n, each in enumerate(block.num)}
            if block.order:
                found |= {f"{name}.den.{n}": each for n, each in enumerate(block.den)}
        return {name: value for name, value in found.items() if value}

    @property
    def part_gains(self) -> dict[str, tuple[int, float]]:
        """Each part of a single signal: its index among `parts`, and its gain, by its name in `with_number`.

        A constant gain has the name of its signal, "hub_angle"; other blocks have a factor of 1, "hub_angle.gain".
        """
        found = {}
        every = self.columns
        for place, part in enumerate(self.parts):
            name = part.signals[0]
            block = part.block
            if len(part.signals) > 1 or not is_measured(name) or every.count(name) > 1:
                continue
            if isinstance(block, Rational) and block.is_constant:
                found[name] = place, block.num[0] / block.den[0]
            else:
                found[f"{name}.gain"] = place, 1.0
        return found

    @property
    def has_integrator(self) -> bool:
        """Whether a law in s has a pole at 0."""
        size = abs(self.poles)
        # of the fastest pole, and of that of a law of a single integrator
        return bool((size <= 1e-9 * max(1.0, size.max(initial=0.0))).any())

    # ------------------------------------------------------------ values

    def polynomials(self, s: Complex) -> tuple[Complex, Complex]:
        """Return the numerators of the signals (signals, n) and their common denominator (n,), without the delay.

        With the sign of u = -sum: positive numbers are negative feedback.
        """
        if self._constants is not None:
            entries, den = self._constants
            return np.multiply.outer(entries, np.ones(np.shape(s))), np.full(np.shape(s), den)
        numerators, whole = self.shares(s)
        return numerators.sum(axis=0), whole

    @cached_property
    def _constants(self) -> tuple[Complex, complex] | None:
        """`polynomials` at any s, (signals,) and one number, of a law without states; None of any other."""
        if self.order or self.is_improper:
            return None
        numerators, whole = self.shares(np.ones(1, complex))
        return numerators.sum(axis=0)[:, 0], complex(whole[0])

    def shares(self, s: Complex, columns: Sequence[str] | None = None) -> tuple[Complex, Complex]:
        """Return the numerators of each part (parts, columns, n) and the common denominator (n,), as `polynomials`.

        The columns are the signals unless named.
        """
        s = np.asarray(s, dtype=complex)
        dens = [part.block.denominator(s) for part in self.parts]
        row = {name: n for n, name in enumerate(self.signals if columns is None else columns)}
        numerators = np.zeros((len(self.parts), len(row), *s.shape), complex)
        for n, part in enumerate(self.parts):
            others = reduce(mul, dens[:n] + dens[n + 1 :], -self.sign)
            for name, value in zip(part.signals, part.block.numerators(s), strict=True):
                if name in row:
                    numerators[n, row[name]] += value * others
        return numerators, np.asarray(reduce(mul, dens))

    def values(self, s: Complex) -> Complex:
        """Return C_i (signals, n) at s, or z, without the delay; infinite or nan at its poles."""
        numerators, whole = self.polynomials(s)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(numerators / whole)

    def matrices(self, columns: Sequence[str] | None = None) -> Matrices:
        """Return one state space from all signals, or these columns, to -v.

        Raises ParameterError where a part differentiates.
        """
        from scipy.linalg import block_diag

        chosen = (np.array(self.columns)[:, None] == np.array(columns or self.signals)).astype(float)
        blocks = [part.block.matrices() for part in self.parts]
        A, B, C, D = (block_diag(*each) for each in zip(*blocks, strict=True))
        C, D = (-self.sign * each.sum(axis=0, keepdims=True) for each in (C, D))
        return A, B @ chosen, C, D @ chosen

    # ------------------------------------------------------------ other laws

    def times(self, factor: float) -> Law:
        """Return the law times a number."""
        return self.with_factors([factor] * len(self.parts))

    def with_factors(self, factors: Sequence[float]) -> Law:
        """Return the law with each part times its own factor."""
        pairs = zip(self.parts, factors, strict=True)
        parts = (replace(part, block=part.block.times(factor)) for part, factor in pairs)
        return replace(self, parts=tuple(parts))

    weighted = FormerName("with_factors")

    def with_number(self, key: str, value: float) -> Law:
        """Return the law with another value of one number.

        Its key is "delay"; "gain", a factor on the law; "hub_angle" or "hub_angle.gain", a factor on one signal;
        "hub_angle.num.1", a coefficient, counted from 0; or "K1", "K2", "Kp", the gains on the signals of the hub.
        Raises ParameterError for an unknown key.
        """
        value = number(key, value, "a finite number")
        key = OUTPUT_OF.get(key, key)
        if key == "delay":
            return replace(self, delay=value)
        if key == "gain":
            return self.times(value)
        signal, of, place = NUMBER.fullmatch(key).groups("")  # type: ignore[union-attr]
        for n, part in enumerate(self.parts):
            if part.signals == (signal,):
                parts = list(self.parts)
                parts[n] = Part(part.signals, _with_number(part.block, of, place, value, key))
                return replace(self, parts=tuple(parts))
        known = ["gain", "delay", *(part.signals[0] for part in self.parts if len(part.signals) == 1)]
        raise ParameterError(key="law", value=key, remedy=did_you_mean(key, known))

    having = FormerName("with_number")


def _parts_of(entries: Mapping[str, Any]) -> tuple[tuple[Part, ...], tuple[float, ...]]:
    """Return the blocks of the entries of a law, and their sampling periods [s]."""
    is_some = isinstance(entries, Mapping) and entries
    require(is_some, "law", entries, 'name at least one signal, such as {"hub_rate": 0.3}')
    blocks = {name: block_of(_signal(name), entry) for name, entry in entries.items()}
    for name, (block, _) in blocks.items():
        remedy = "has several signals: use Law.of_matrices and name them"
        require(block.signals == 1, name, type(entries[name]).__name__, remedy)
    parts = tuple(Part((name,), block) for name, (block, _) in blocks.items())
    return parts, tuple(period for _, period in blocks.values() if period is not None)


def _signal(name: Any, *, of_reference: bool = False) -> str:
    """Return the name of an output, or of its reference.  Raises ParameterError for other texts."""
    plain = name.removeprefix(REFERENCE) if of_reference and isinstance(name, str) else name
    is_name = isinstance(plain, str) and re.fullmatch(r"[A-Za-z_]\w*(@[0-9.eE+-]+)?", plain)
    remedy = 'an output such as hub_rate, or one along the link with its place, "strain@0.05"'
    require(is_name, "signal", plain, remedy)
    return str(name)


def is_measured(name: str) -> bool:
    """Whether a column of a law is measured: neither a reference nor unconnected."""
    return bool(name) and not name.startswith(REFERENCE)


def _with_number(block: LawBlock, of: str, place: str, value: float, key: str) -> LawBlock:
    """Return a block with another factor, or another coefficient of its polynomial `of`."""
    if not of:
        return Rational((value,)) if block.is_constant else block.times(value)
    numbers = list(getattr(block, of, ()))
    remedy = "a number of the law is named signal, signal.num.N or signal.den.N with N counted from 0"
    require(int(place) < len(numbers), "law", key, remedy)
    numbers[int(place)] = value
    return replace(block, **{of: tuple(numbers)})  # type: ignore[arg-type]  # of a Rational


AnyLaw = HubFeedback | Law

# ------------------------------------------------------------ laws of an arm


def as_law(law: AnyLaw) -> Law:
    """Return a Law, also for gains at the hub.  Raises ParameterError for anything else."""
    if isinstance(law, HubFeedback):
        return Law.of_gains(law)
    require(isinstance(law, Law), "law", law, "give a HubFeedback or a Law")
    return law


def of_common_blocks(law: Law) -> Law:
    """Return the law with ratios of the same denominator as one block: apart, each adds poles that no signal shows.

    Poles at 0 may be those of one of the ratios: the integrator of one signal.
    """
    alike: dict[object, list[Part]] = {}
    for part in law.parts:
        block = part.block
        key: object = id(part)
        if isinstance(block, Rational) and block.order and block.excess <= 0:
            key = tuple(np.trim_zeros(block.den, "b"))
        alike.setdefault(key, []).append(part)
    return replace(law, parts=tuple(map(_merge, alike.values())))


def _merge(parts: Sequence[Part]) -> Part:
    """Return ratios of the same denominator as one block, in observable form: the transpose of each one's states."""
    if len(parts) == 1:
        return parts[0]
    order = max(part.block.order for part in parts)
    blocks = []
    for part in parts:
        assert isinstance(part.block, Rational)
        poles_at_origin = (0.0,) * (order - part.block.order)
        blocks.append(Rational(part.block.num + poles_at_origin, part.block.den + poles_at_origin))
    A, B, C, D = zip(*(block.matrices() for block in blocks), strict=True)
    signals = tuple(chain.from_iterable(part.signals for part in parts))
    return Part(signals, StateSpace(A[0].T, np.vstack(C).T, B[0].T, np.hstack(D)))


def arm_and_law(arm: Arm, law: AnyLaw) -> tuple[Arm, AnyLaw]:
    """Return the arm with the input of the law, and the law, as gains at the hub where it has no more than those.

    Raises ParameterError for anything but a law.
    """
    law = as_law(law)
    if law.input is not None and law.input != arm.input:
        arm = replace(arm, input=law.input)  # type: ignore[arg-type]  # the record refuses what is none
    return arm, law.gains or law


def must_not_be_algebraic(arm: Arm, key: str, value: object) -> None:
    """Raise ParameterError where the hub has no inertia: its root moment is the torque itself."""
    remedy = (
        "with hub.inertia = 0 the root moment is -u itself, so that moment feedback is an algebraic loop; "
        "give the hub an inertia, or a moment gain of 0"
    )
    require(not arm.has_massless_hub, key, value, remedy)


def warn_of_cancellations(law: Law) -> tuple[str, ...]:
    """Return warnings of the law's unstable poles that its own zeros cancel."""
    found = []
    for part in law.parts:
        zeros = getattr(part.block, "zeros", np.empty(0, complex))
        for pole in part.block.poles:
            is_unstable = abs(pole) >= 1 if law.is_discrete else pole.real >= 0
            if is_unstable and (abs(zeros - pole) <= 1e-6 * max(abs(pole), 1e-12)).any():
                where = f"z = {pole:.6g}" if law.is_discrete else f"{pole:.6g} 1/s"
                signals = ", ".join(part.signals)
                found.append(f"the law cancels its own unstable pole {where} on {signals}: it is not stable")
    return tuple(found)
