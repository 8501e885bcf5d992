"""What is proven and measured of one arm, kept in its folder as proof.json and read again for the page on trust.

The natural frequencies are enclosed and counted in ball arithmetic; the float64 responses are measured against it.

The tables of what is proven and measured of each arm, for the page on trust.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import tfarm
from tfarm.arm import Arm, HubFeedback
from tfarm.columns import Column, Table
from tfarm.digits import scientific, significant, singly, worded
from tfarm.dsp import Chain
from tfarm.dsp.chain import file_text
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.plots.style import gains_words
from tfarm.report.cards import keep, kept
from tfarm.report.cases import has_loop
from tfarm.report.modes_section import BRACKET_DIGITS, PROVEN_DIGITS, PROVEN_MODES, proven_damped_modes
from tfarm.report.sections import typeset
from tfarm.response.frequency import BAND_POINTS, worst_error
from tfarm.spectrum import DampedModes
from tfarm.spectrum.table import default_gains

PROVEN_OUTPUTS = ("root_moment", "tip_displacement")
UNPROVEN = "not proven"
DIGITS_CAPTION = (
    f"First {PROVEN_MODES} flexible modes at C = 0, angular frequency in rad/s. All {BRACKET_DIGITS} digits are "
    "proven; the dots stand for those that follow (digits are cut off, not rounded)."
)
COUNTS_CAPTION = (
    "The count is made at one frequency between the last mode of the list and the next: as many as the flexible modes "
    "enclosed, and one more where the arm turns as a rigid body. Each arm's folder has the enclosures as proof.json."
)
BOXES_CAPTION = (
    "Eigenvalues off the axis, s in 1/s, conjugates and those at 0 counted. Each is enclosed in a disc of "
    f"{PROVEN_DIGITS} digits that holds exactly one (Rouché's theorem), and the argument principle, evaluated in ball "
    "arithmetic around the box, counts as many inside: none is missing there. With damping no box can hold all: "
    "lightly damped shear modes exist far above any, and slow real eigenvalues accumulate at -1/C."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Boxed:
    """Eigenvalues proven complete in a box (re_min, re_max, im_min, im_max) [1/s]: each in a disc, `count` in all.

    `failure` says what could not be proven.
    """

    what: str
    count: int = 0
    box: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    failure: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmProof:
    """Of one arm: brackets (lower, upper) [rad/s] of its first flexible frequencies, the count that completes them.

    `count` frequencies lie below `below` [rad/s], a rigid-body mode included if `has_rigid_mode`.  `errors` has
    (output, worst |G_64/G - 1| / (1 + |s G'/G|)) over `points` frequencies from `band`.  `failure` says what could
    not be proven; then there are no brackets.  `boxes` are damped modes and poles of the default loop.  `sha256` is
    that of the arm's file.
    """

    name: str
    sha256: str
    has_rigid_mode: bool
    digits: int = BRACKET_DIGITS
    brackets: tuple[tuple[str, str], ...] = ()
    count: int = 0
    below: str = ""
    failure: str = ""
    points: int = BAND_POINTS
    band: tuple[float, float]
    errors: tuple[tuple[str, float], ...]
    boxes: tuple[Boxed, ...] = ()


def prove(arm: Arm, chain: Chain | None = None) -> ArmProof:
    """Certify the first modes of the arm and measure its responses; what cannot be proven is said, not raised."""
    modes = tfarm.modes(arm, count=PROVEN_MODES)
    flexible = modes.natural_frequency[modes.index > 0]
    band = float(0.1 * flexible[0]), float(1.1 * flexible[-1])
    found: dict[str, Any] = {}
    try:
        proof = modes.certify(BRACKET_DIGITS)
        found = {"brackets": proof.brackets, "count": proof.count, "below": proof.below}
    except CertificationError as error:
        found = {"failure": str(error)}
    return ArmProof(
        name=arm.name,
        sha256=hash_of(arm, chain),
        has_rigid_mode=arm.has_rigid_mode,
        band=band,
        errors=tuple(
            (output, worst) for output in PROVEN_OUTPUTS if (worst := worst_error(arm, output, band)) is not None
        ),
        boxes=tuple(boxed(arm)),
        **found,
    )


def boxed(arm: Arm) -> Iterator[Boxed]:
    """Damped modes and the default loop's poles, each enclosed and counted; what cannot be proven is said."""
    boxes: list[tuple[str, Callable[[], DampedModes | Poles]]] = []
    if not arm.is_undamped:
        boxes.append((f"damped modes, C = {arm.damping:g} s", lambda: proven_damped_modes(arm, PROVEN_MODES)))
    if has_loop(arm):
        law = default_gains(arm)
        boxes.append((f"closed loop, {gains_words(law, 6)}", lambda: _proven_poles(arm, law)))
    for what, proven in boxes:
        try:
            found = proven()
            yield Boxed(what=what, count=found.count, box=_four(found.box))
        except (CertificationError, ConvergenceError) as error:
            yield Boxed(what=what, failure=str(error))


def _proven_poles(arm: Arm, law: HubFeedback) -> Poles:
    poles = closed_loop_poles(arm, law, PROVEN_MODES)
    poles.certify(PROVEN_DIGITS)
    return poles


def _four(box: Sequence[float]) -> tuple[float, float, float, float]:
    left, right, low, high = (float(edge) for edge in box)
    return left, right, low, high


def hash_of(arm: Arm, chain: Chain | None = None) -> str:
    """SHA-256 of the arm's file, its chain with it."""
    return hashlib.sha256(file_text(arm, chain).encode()).hexdigest()


def save_proof(arm: Arm, folder: Path, chain: Chain | None = None) -> None:
    """proof.json."""
    keep(folder, "proof", asdict(prove(arm, chain)))


def written_proofs(out: Path) -> Sequence[ArmProof]:
    """The proofs of all arms in the folder of reports, by name; what is none of ours is passed over."""
    return kept(out, "proof", _proof)


def _proof(read: dict[str, Any], _: Path) -> ArmProof:
    read["brackets"] = tuple((str(lower), str(upper)) for lower, upper in read["brackets"])
    read["band"] = float(read["band"][0]), float(read["band"][1])
    read["errors"] = tuple((str(output), float(error)) for output, error in read["errors"])
    read["boxes"] = tuple(Boxed(**each | {"box": _four(each["box"])}) for each in read["boxes"])
    return ArmProof(**read)


# ------------------------------------------------------------ digits
def shared_digits(bracket: tuple[str, str], digits: int) -> str:
    """The leading digits that all numbers in a bracket of so many digits share: its lower end, with its zeros."""
    lower = Decimal(bracket[0])
    with localcontext(prec=digits + 5):
        return f"{lower.quantize(Decimal(1).scaleb(lower.adjusted() - digits + 1)):f}"


def digits_table(proofs: Sequence[ArmProof]) -> Table:
    """A row a mode, a column an arm: every digit that is proven."""
    dotted = worded(lambda text: f"{text}…" if text else UNPROVEN)
    columns = [Column("mode", "mode", of=range(1, PROVEN_MODES + 1))]
    for proof in proofs:
        digits = [shared_digits(bracket, proof.digits) for bracket in proof.brackets] or [""] * PROVEN_MODES
        columns.append(Column(f"{proof.name}_rad_s", proof.name, "rad/s", of=digits, digits=dotted))
    return Table(
        stem="digits",
        title=f"Natural frequencies, {BRACKET_DIGITS} digits",
        caption=DIGITS_CAPTION,
        columns=tuple(columns),
    )


def counts_table(proofs: Sequence[ArmProof]) -> Table:
    """How many lie below where, and how many were enclosed."""
    return Table(
        stem="counts",
        title="None missing",
        caption=COUNTS_CAPTION,
        record=list(proofs),
        columns=(
            Column("arm", "arm", of="name"),
            Column("rigid_body", "rigid body", of=lambda proof: int(proof.has_rigid_mode)),
            Column("enclosed", "flexible modes enclosed", of=lambda proof: len(proof.brackets)),
            Column("count", "counted"),
            Column(
                "below_rad_s", "below", "rad/s", of="below",
                shown=lambda proof: significant(float(proof.below), 9) if proof.below else "",
            ),
            Column(
                "verdict", "verdict",
                of=lambda proof: f"{UNPROVEN}: {proof.failure}" if proof.failure else "complete, proven",
            ),
        ),
    )  # fmt: skip


def boxes_tables(proofs: Sequence[ArmProof]) -> tuple[Table, ...]:
    """Damped modes and closed-loop poles, a row a box; no table where there is none."""
    rows = [(proof.name, each) for proof in proofs for each in proof.boxes]
    if not rows:
        return ()
    four = singly(significant, 4)
    edges = ((0, "re_min", "Re s from"), (1, "re_max", "Re s to"), (3, "im_max", "|Im s| below"))
    table = Table(
        stem="boxes",
        title="Damped modes and closed-loop poles",
        caption=BOXES_CAPTION,
        record=[each for _, each in rows],
        columns=(
            Column("arm", "arm", of=[name for name, _ in rows]),
            Column("what", "of", digits=worded(typeset)),
            Column("count", "counted"),
            *(Column(key, title, "1/s", of=[each.box[i] for _, each in rows], digits=four) for i, key, title in edges),
            Column("verdict", "verdict", of=lambda each: each.failure or "complete, proven"),
        ),
    )
    return (table,)


def accuracy_table(proofs: Sequence[ArmProof]) -> Table:
    """The worst error of each arm's two responses."""
    columns = [
        Column("arm", "arm", of=[proof.name for proof in proofs]),
        Column("band_rad_s", "from … to, rad/s", of=[" … ".join(significant(x, 4) for x in p.band) for p in proofs]),
    ]
    for output in PROVEN_OUTPUTS:
        errors = [dict(proof.errors).get(output) for proof in proofs]
        cells = ["zero throughout" if error is None else scientific(error, 2) for error in errors]
        values = ["" if error is None else error for error in errors]
        columns.append(Column(output, output.replace("_", " "), of=values, shown=cells))
    caption = "Worst error of double precision over those frequencies, counted as said above."
    return Table(
        stem="accuracy", title="Double precision against proven digits", caption=caption, columns=tuple(columns)
    )
