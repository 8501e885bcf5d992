"""Proofs on one arm: its natural frequencies, damped modes and poles enclosed and counted, its responses compared."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal, localcontext
from functools import lru_cache, partial
from typing import Annotated, Any

from tfarm.arm import PLANE, Arm, load, presets
from tfarm.arm.chain import Chain, file_text
from tfarm.digits import plain
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.response.frequency import worst_error
from tfarm.schema import Quantity
from tfarm.spectrum import DampedModes, damped_modes, modes
from tfarm.spectrum.gains import default_gains
from tfarm.spectrum.proofs import Certificate

PROVEN_OUTPUTS = ("root_moment", "tip_displacement")
UNPROVEN = "not proven"
# flexible modes of each arm, as its page lists them
PROVEN_MODES = 10
# of a natural frequency: beyond a double's digits
BRACKET_DIGITS = 20
# of an eigenvalue: more than a page prints of any
PROVEN_DIGITS = 12


@lru_cache(maxsize=8)  # for the arm's page and its proof, as the damped ones below
def proven_modes(arm: Arm, count: int) -> Certificate:
    """Return brackets of the arm's first natural frequencies.  Raises CertificationError where they are not proven."""
    return modes(arm, count).certify(BRACKET_DIGITS)


@lru_cache(maxsize=8)
def proven_damped_modes(arm: Arm, count: int) -> DampedModes:
    """Return the arm's first damped modes, each enclosed to 12 digits, none missing in their box.

    Raises CertificationError where that cannot be proven, ConvergenceError where they are too near to each other.
    """
    found = damped_modes(modes(arm, count))
    found.certify(PROVEN_DIGITS)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Boxed:
    """Eigenvalues proven complete in a box: each in a disc, `count` in all.  `failure`: what could not be proven."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    what: Annotated[
        str, Quantity("eigenvalues", help="damped modes of the arm, or poles of its default loop")
    ]
    count: Annotated[
        int, Quantity("counted", help="eigenvalues in the box by the argument principle, conjugates counted")
    ] = 0
    box: Annotated[
        list[float],
        Quantity(
            "box: Re s from, to, Im s from, to",
            "1/s",
            4,
            help="rectangle of the s-plane in which none is missing",
        ),
    ] = field(default_factory=list)
    failure: str = ""

    @property
    def verdict(self) -> Annotated[str, Quantity("verdict", help="whether as many are enclosed as counted")]:
        """Whether they are complete."""
        return self.failure or "complete, proven"


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmProof:
    """Proofs on one arm: brackets (lower, upper) [rad/s] of its first flexible frequencies, and their count.

    `count` frequencies lie below `below` [rad/s], a rigid-body mode included if `has_rigid_mode`.  `errors` has
    (output, worst |G_64/G - 1| / (1 + |s G'/G|)) over frequencies in `band`.  `failure` is what could
    not be proven; then there are no brackets.  `boxes` are damped modes and poles of the default loop.  `sha256` is
    that of the arm's file.
    """

    name: Annotated[str, Quantity("arm", help="name of the arm")]
    sha256: Annotated[
        str, Quantity("SHA-256 of arm.toml", help="hash of the arm's file, on which its page depends")
    ]
    has_rigid_mode: Annotated[
        bool,
        Quantity("rigid body", help="whether the arm turns freely as a rigid body, with natural frequency 0"),
    ]
    digits: int = BRACKET_DIGITS
    brackets: tuple[tuple[str, str], ...] = ()
    count: Annotated[
        int, Quantity("counted", help="natural frequencies below the next column's, by the proven count")
    ] = 0
    below: str = ""
    failure: str = ""
    band: tuple[float, float]
    errors: tuple[tuple[str, float], ...]
    boxes: tuple[Boxed, ...] = ()

    @property
    def enclosed(
        self,
    ) -> Annotated[
        int, Quantity("flexible modes enclosed", help="natural frequencies between two proven bounds each")
    ]:
        """The number of brackets."""
        return len(self.brackets)

    @property
    def count_below(
        self,
    ) -> Annotated[float | None, Quantity("below", "rad/s", 9, help="frequency at which the count is made")]:
        """The frequency of the count."""
        if not self.below:
            return None
        return float(self.below)

    @property
    def verdict(self) -> Annotated[str, Quantity("verdict", help="whether as many are enclosed as counted")]:
        """Whether the list is complete."""
        if self.failure:
            return f"{UNPROVEN}: {self.failure}"
        return "complete, proven"

    @property
    def source(
        self,
    ) -> Annotated[str, Quantity("source", help="preset, where the file is that of one byte for byte")]:
        """Whether the arm's file is, byte for byte, that of a preset."""
        if self.name in presets() and hash_of(load(self.name)) == self.sha256:
            return "preset"
        return "file"

    @property
    def leading_digits(self) -> list[str]:
        """The proven digits of each bracket: its lower end cut off, with its zeros."""
        with localcontext(prec=self.digits + 5):
            lower = [Decimal(bracket[0]) for bracket in self.brackets]
            ends = [Decimal(1).scaleb(each.adjusted() - self.digits + 1) for each in lower]
            return [f"{each.quantize(end):f}" for each, end in zip(lower, ends, strict=True)]


def prove(arm: Arm, chain: Chain | None = None) -> ArmProof:
    """Certify the first modes of the arm and measure its responses; a failed proof is noted, not raised."""
    own = modes(arm, PROVEN_MODES)
    flexible = own.natural_frequency[own.index > 0]
    band = float(0.1 * flexible[0]), float(1.1 * flexible[-1])
    errors = ((output, worst_error(arm, output, band)) for output in PROVEN_OUTPUTS)
    try:
        proof = proven_modes(arm, PROVEN_MODES)
        found: dict[str, Any] = {"brackets": proof.brackets, "count": proof.count, "below": proof.below}
    except CertificationError as error:
        found = {"failure": str(error)}
    return ArmProof(
        name=arm.name,
        sha256=hash_of(arm, chain),
        has_rigid_mode=arm.has_rigid_mode,
        band=band,
        errors=tuple((output, worst) for output, worst in errors if worst is not None),
        boxes=tuple(enclose_poles(arm)),
        **found,
    )


def enclose_poles(arm: Arm) -> Iterator[Boxed]:
    """Yield damped modes and the default loop's poles, each enclosed and counted; a failed proof is noted."""
    boxes: dict[str, Callable[[], DampedModes | Poles]] = {}
    if not arm.is_undamped:
        boxes[f"damped modes, C = {arm.damping:g} s"] = lambda: proven_damped_modes(arm, PROVEN_MODES)
    if not (arm.is_locked or arm.has_massless_hub):
        law = default_gains(arm)
        gains = ", ".join(law.gain_text(name, lambda gain: plain(gain, 6)) for name in PLANE)
        poles = partial(closed_loop_poles, arm, law, PROVEN_MODES)
        boxes[f"closed loop, {gains}"] = lambda: poles().with_discs(PROVEN_DIGITS)
    for what, proven in boxes.items():
        try:
            found = proven()
            yield Boxed(arm=arm.name, what=what, count=found.count, box=list(map(float, found.box)))
        except (CertificationError, ConvergenceError) as error:
            yield Boxed(arm=arm.name, what=what, failure=str(error))


def hash_of(arm: Arm, chain: Chain | None = None) -> str:
    """Return the SHA-256 of the arm's file, its chain with it."""
    return hashlib.sha256(file_text(arm, chain).encode()).hexdigest()
