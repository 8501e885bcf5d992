"""The list of modes of commands and pages: undamped, damped and hub-locked frequencies, mode by mode."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from tfarm.arm import WITH_SHEAR, Arm
from tfarm.digits import DOUBLE_DIGITS
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.exact.values import Method
from tfarm.schema import Quantity
from tfarm.spectrum.damped import MOST_MODES, DampedModes, Unassigned, damped_modes
from tfarm.spectrum.proofs import Certificate, Disc
from tfarm.spectrum.table import Modes, compare_theories, hub_locked

LOCKED_NOTE = (
    "frequencies with a locked hub, as dry friction mostly locks it after a slew; a measured frequency "
    "near this column indicates a hub at rest"
)
# in a report's files, of numbers from shapes, which differ by 1e-14 between processors
SHAPE_DIGITS = 10


@dataclass(frozen=True, slots=True)
class ListedMode:
    """One mode.  Frequencies are texts for more than 15 digits."""

    index: Annotated[int, Quantity("mode", help="number of the mode; 0 is the rigid body")]
    natural_frequency: Annotated[
        float | str, Quantity("natural frequency", "rad/s", 12, "of the undamped arm")
    ]
    natural_frequency_hz: Annotated[
        float, Quantity("frequency", "Hz", 9, "natural frequency over 2 pi", key="natural_frequency_hz")
    ]
    eigenvalue: Annotated[complex | None, Quantity("eigenvalue", "1/s", 10, "of the damped arm, Im >= 0")]
    second_eigenvalue: Annotated[
        float | None, Quantity("second eigenvalue", "1/s", 8, "faster one of an overdamped mode")
    ]
    damping_ratio: Annotated[
        float | None, Quantity("damping ratio", help="-Re s/|s|; above 1 for an overdamped mode")
    ]
    hub_locked: Annotated[float | str | None, Quantity("hub locked", "rad/s", 12, LOCKED_NOTE)]
    hub_participation: Annotated[
        float,
        Quantity("hub participation b", "rad/sqrt(kg m^2)", help="hub angle of the mode of unit modal mass"),
    ]
    modal_moment: Annotated[
        float, Quantity("modal moment", "N m/sqrt(kg m^2)", help="root moment of the mode of unit modal mass")
    ]
    nodes: Annotated[
        list[float], Quantity("nodes", "m", 4, "points of the link without displacement, from the hub")
    ]
    theories: Annotated[
        dict[str, float], Quantity(key="theories_rad_s", help="natural frequency by each beam theory")
    ]
    sensitivity: Annotated[
        dict[str, float], Quantity(help="d ln w/d ln p, relative change of frequency by parameter")
    ]
    lower: Annotated[str | None, Quantity(key="lower_rad_s", help="lower end of the certified bracket")] = (
        None
    )
    upper: Annotated[str | None, Quantity(key="upper_rad_s", help="upper end of the certified bracket")] = (
        None
    )
    discs: Annotated[tuple[Disc, ...] | None, Quantity(help="certified enclosures of the eigenvalues")] = None


@dataclass(frozen=True)
class ModeList:
    """The first flexible modes, none missing.

    `damped` is None without damping, and where the damped modes cannot be found or certified, for the reason in
    `damped_failure`.
    """

    found: Modes
    damped: DampedModes | None
    modes: Annotated[list[ListedMode], Quantity("modes", help="in ascending order of natural frequency")]
    unassigned: Annotated[
        list[Unassigned],
        Quantity(
            "eigenvalues of no mode",
            help="in the box, assigned to no mode for certain",
            key="unassigned_eigenvalues",
        ),
    ]
    method: Annotated[
        Method, Quantity("method", help="of the natural frequencies: closed-form, balls or appendix")
    ]
    digits: Annotated[int | None, Quantity(help="digits of the natural frequencies, if more than 15")]
    proof: Annotated[
        Certificate | None, Quantity("certified", help="brackets, and a count that proves them complete")
    ]
    damped_failure: Annotated[str | None, Quantity("damped modes not determined", help="the reason")]
    is_proven_in_box: Annotated[
        bool,
        Quantity(
            key="proven_complete_in_box", help="whether the list of eigenvalues in the box is certified"
        ),
    ]

    @property
    def arm(self) -> Annotated[str, Quantity("arm", help="name of the arm")]:
        """The name of the arm."""
        return self.found.arm.name

    @property
    def theory(
        self,
    ) -> Annotated[str, Quantity("beam theory", help="timoshenko, shear, rayleigh or euler-bernoulli")]:
        """The theory of the beam."""
        return self.found.theory

    @property
    def input(self) -> Annotated[str, Quantity(help="input of the arm")]:
        """The input of the arm."""
        return self.found.arm.input

    @property
    def count(
        self,
    ) -> Annotated[int, Quantity("flexible modes, none missing", help="number of the last mode")]:
        """The number of the last mode."""
        return int(self.found.index.max())

    @property
    def certainty(
        self,
    ) -> Annotated[str, Quantity("completeness", help="word of certainty for the list of modes")]:
        """The word of certainty for the list of modes."""
        if self.proof is None:
            return "converged (counted)"
        return "certified"

    @property
    def box(
        self,
    ) -> Annotated[
        tuple[float, ...] | None,
        Quantity("box: Re s from, to, Im s from, to", "1/s", help="searched for eigenvalues"),
    ]:
        """The box of the eigenvalues."""
        return None if self.damped is None else tuple(self.damped.box)

    @property
    def eigenvalues_in_box(
        self,
    ) -> Annotated[
        int | None, Quantity("eigenvalues in the box, all listed", help="counted with conjugates")
    ]:
        """Their number, with conjugates."""
        return None if self.damped is None else self.damped.count

    @property
    def box_note(
        self,
    ) -> Annotated[str | None, Quantity("beyond the box", help="eigenvalues that no finite box has")]:
        """The eigenvalues beyond the box, in words."""
        return None if self.damped is None else beyond_the_box(self.found.arm)

    @property
    def hub_locked_note(self) -> Annotated[str | None, Quantity("hub locked", help="meaning of that column")]:
        """The meaning of the column; None for an arm with a locked hub."""
        return None if self.found.arm.is_locked else LOCKED_NOTE

    @property
    def damped_note(
        self,
    ) -> Annotated[str | None, Quantity("damped modes", help="modes without an eigenvalue, and why")]:
        """The flexible modes without an eigenvalue and the reason, in one line; None where each has one."""
        if self.damped is None:
            return None
        last = int(self.damped.index[-1])
        notes = []
        without = self.damped.index[~self.damped.is_assigned].tolist()
        if without:
            notes.append(f"no eigenvalue is assigned for certain to mode {', '.join(map(str, without))}")
        if self.damped.left_out:
            if last == MOST_MODES:
                why = f"a list has at most {MOST_MODES}"
            else:
                why = "the box of more could not be searched"
            notes.append(f"eigenvalues up to mode {last} only: {why}")
        return "; ".join(notes) or None

    @property
    def circuit(
        self,
    ) -> Annotated[
        list[float],
        Quantity(
            "of the motor's circuit [1/s]", help="real eigenvalues of no mode", key="circuit_eigenvalues"
        ),
    ]:
        """Real eigenvalues of the motor's circuit."""
        return [] if self.damped is None else list(self.damped.others)


def listed_modes(
    found: Modes, digits: int | None = None, certify: bool = False, method: Method = "closed-form"
) -> ModeList:
    """Return the list of modes, with frequencies as strings for more than 15 digits.

    With `certify` each flexible mode has its bracket and its discs, and the list a certified count.  `method` is that
    of the frequencies.  Raises CertificationError where a bracket fails.
    """
    certain = DOUBLE_DIGITS if digits is None else digits
    proof = found.certify(certain) if certify else None
    damped = None
    discs = None
    failure = None
    if not found.arm.is_undamped:
        try:
            damped = damped_modes(found)
            if certify:
                discs = damped.certify(certain)
        except (ConvergenceError, CertificationError) as error:
            damped = None
            failure = f"damped modes: {error}"
    unassigned = [] if damped is None else list(damped.unassigned)
    if discs is not None:
        last = discs[len(discs) - len(unassigned) :]
        unassigned = [each._replace(discs=own) for each, own in zip(unassigned, last, strict=True)]
    return ModeList(
        found=found,
        damped=damped,
        modes=list(_rows(found, digits, method, damped, proof, discs)),
        unassigned=unassigned,
        method=method,
        digits=digits,
        proof=proof,
        damped_failure=failure,
        is_proven_in_box=discs is not None,
    )


def _rows(
    found: Modes,
    digits: int | None,
    method: Method,
    damped: DampedModes | None,
    proof: Certificate | None,
    discs: Sequence[Sequence[Disc]] | None,
) -> Iterator[ListedMode]:
    """Yield a row for each mode."""
    locked = hub_locked(found)
    rigid = len(found) - found.flexible.size
    frequencies = found.frequencies(method)
    omega: list[Any] = frequencies.tolist()
    hertz = (frequencies / (2 * math.pi)).tolist()
    still: list[Any] = locked.flexible.tolist()
    if digits is not None and digits > DOUBLE_DIGITS:
        omega = found.digits(digits)
        still = locked.digits(digits)[-locked.flexible.size :]
    brackets: list[Any] = [(None, None)] * len(found)
    if proof is not None:
        brackets[rigid:] = proof.brackets
    theories = compare_theories(found)
    sensitivity = found.sensitivity
    enclosures = _discs_by_mode(damped, discs)
    for row in range(len(found)):
        first, second, ratio = (None, None, None) if damped is None else _damped_numbers(damped, row)
        yield ListedMode(
            index=int(found.index[row]),
            natural_frequency=omega[row],
            natural_frequency_hz=hertz[row],
            eigenvalue=first,
            second_eigenvalue=second,
            damping_ratio=ratio,
            hub_locked=None if row < rigid else still[row - rigid],
            hub_participation=float(found.hub_participation[row]),
            modal_moment=float(found.modal_moment[row]),
            nodes=found.nodes[row].tolist(),
            theories={str(name): float(values[row]) for name, values in theories.items()},
            sensitivity={name: float(values[row]) for name, values in sensitivity.items()},
            lower=brackets[row][0],
            upper=brackets[row][1],
            discs=enclosures.get(int(found.index[row])),
        )


def _damped_numbers(damped: DampedModes, row: int) -> tuple[complex | None, float | None, float | None]:
    """Return eigenvalue, second real eigenvalue and damping ratio of a mode, or None."""
    if row >= len(damped.index) or not damped.is_assigned[row]:
        return None, None, None
    p, q = damped.eigenvalues[row].tolist()
    # friction at the hub
    turning = damped.index[row] == 0 and q != 0
    both = (damped.is_overdamped[row] or turning) and not math.isnan(q.real)
    return p, q.real if both else None, float(damped.damping_ratio[row])


def _discs_by_mode(
    damped: DampedModes | None, discs: Sequence[Sequence[Disc]] | None
) -> dict[int, tuple[Disc, ...]]:
    """Return the discs of each mode by its number, also of the rigid body with friction."""
    if damped is None or discs is None:
        return {}
    numbers = damped.index[damped.index > 0].tolist()
    has_friction = damped.single.size > len(damped.others)
    if has_friction:
        numbers.append(0)
    return dict(zip(numbers, map(tuple, discs), strict=False))


def beyond_the_box(arm: Arm) -> str:
    """Return a description of the eigenvalues of a damped arm beyond any box."""
    if arm.has_elastic_link:
        return "their damping decreases with frequency, as no segment has damping (C = 0)"
    dampings = {link.damping for link in arm.links}
    most = " of the most damped segment" * (len(dampings) > 1)
    if arm.theory in WITH_SHEAR:
        light = "shear is undamped in this model, so lightly damped modes exist at ever higher frequency"
    elif all(dampings):
        light = "in this theory, which leaves out shear, all of them are overdamped from some frequency on"
    else:
        light = "segments without damping have lightly damped modes at ever higher frequency"
    slow = f"the slow real eigenvalues of overdamped bending modes accumulate at -1/C{most}, {-1 / arm.damping:.6g} 1/s"
    return f"{light}, and {slow}"
