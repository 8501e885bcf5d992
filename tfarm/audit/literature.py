"""Published natural frequencies with all they need to be computed again.  A new source is one more entry of `SOURCES`.

Every number stands as it was printed, with its zeros.  `reached` says how it reached us: few of the originals lay open
on the desk.  Where the exact solution differs beyond the printed digits, `why` says what the difference comes from, and
the test of that source (tests/published) computes it.

Published natural frequencies of rigs: yielding roots, masses on the way, a hub's radius, payloads beyond the tip.

Two sources are frequency equations instead of tables: what stands here as printed are their roots, each digit of which
the test of the source computes (see `literature`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from tfarm.arm import Arm, Attachment, Hub, Link, Payload, RotarySpring, Section, Theory

inf = math.inf
CYCLIC = "frequency [Hz]"
ANGULAR = "frequency [rad/s]"
WAVE_NUMBER = "L (w^2 rhoA/EI)^(1/4)"
REDUCED = "w L^2 (rhoA/EI)^(1/2)"
SLENDER = 1e6  # L/r at which shear and rotary inertia change less than the printed digits: they enter as (r/L)^2


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One column of a table: the arm, the theory it was printed for, and what was printed of modes 1, 2, ..."""

    name: str
    arm: Arm
    theory: Theory
    quantity: str  # CYCLIC, ANGULAR, WAVE_NUMBER or REDUCED; w in rad/s
    printed: tuple[str, ...]
    why: Mapping[int, str] = field(default_factory=dict)  # by mode, where the printed digits are not reached


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A publication: `citation` says where its table stands, `reached` by what way its numbers came here."""

    key: str
    citation: str
    reached: str
    cases: tuple[Case, ...]


def beam(*, slenderness: float = 100.0, root: float = inf, mass: float = 0.0, inertia: float = 0.0) -> Arm:
    """A beam of L = rhoA = EI = 1, of L/r = slenderness, Poisson's ratio 0.3 and shear factor 5/6.

    So hub inertia and payload are in units of rhoA L^3 (inertias) and rhoA L (mass).
    """
    section = Section.general(area=1.0, second_moment=slenderness**-2, shear_factor=5 / 6)
    link = Link.isotropic(length=1.0, density=1.0, youngs_modulus=slenderness**2, poissons_ratio=0.3, section=section)
    return Arm(link=link, hub=Hub(inertia=root), payload=Payload(mass=mass, inertia=inertia))


END_CONDITIONS: dict[str, dict[str, float]] = {
    "clamped-free": {},
    "clamped-sliding": {"inertia": inf},
    "clamped-pinned": {"mass": inf},
    "clamped-clamped": {"mass": inf, "inertia": inf},
    "pinned-free": {"root": 0.0},
}


def _roots(
    ends: str, printed: tuple[str, ...], quantity: str = WAVE_NUMBER, why: Mapping[int, str] | None = None
) -> Case:
    arm = beam(**END_CONDITIONS[ends])
    return Case(name=ends, arm=arm, theory="euler-bernoulli", quantity=quantity, printed=printed, why=why or {})


# By the ends of the beam.
PINNED_ROOTS = ("3.92660231", "7.06858275", "10.21017612", "13.35176878", "16.49336143")
BLEVINS_ROOTS = {
    "clamped-free": ("1.87510407", "4.69409113", "7.85475744", "10.99554073", "14.13716839"),
    "clamped-sliding": ("2.36502037", "5.49780392", "8.63937983", "11.78097245", "14.92256510"),
    "clamped-pinned": PINNED_ROOTS,
    "clamped-clamped": ("4.73004074", "7.85320462", "10.9956079", "14.1371655", "17.2787597"),
    "pinned-free": PINNED_ROOTS,
}
BLEVINS_LAST_DIGIT = "one unit too much in the last digit: cos z cosh z = 1 between 10.99560783 and 10.99560784"
# By h/L.
LEE_SCHULTZ_ROOTS = {
    0.002: ("4.72998", "7.85295", "10.9950"),
    0.005: ("4.72963", "7.85163", "10.9917"),
    0.01: ("4.72840", "7.84690", "10.9800"),
    0.02: ("4.72350", "7.82817", "10.9341"),
    0.05: ("4.68991", "7.70352", "10.6401"),
    0.1: ("4.57955", "7.33122", "9.85611"),
    0.2: ("4.24201", "6.41794", "8.28532"),
}
BIR_BLADE = Link.isotropic(
    length=31.623, density=100.0, youngs_modulus=1e8, poissons_ratio=0.3,
    section=Section.general(area=1.0, second_moment=1.0, shear_factor=5 / 6),
)  # fmt: skip
# By mass ratio m/(rhoA L) and inertia ratio I_c/(rhoA L^3) of each column.
WANG_ROOTS = {
    (1.0, 0.0): ("1.557298", "16.25009", "50.89584", "105.1983", "179.2320"),
    (1.0, 0.1): ("1.70226", "23.17405", "63.1286", "122.5668", "201.6229"),
    (1.0, 1.0): ("2.55044", "23.86031", "63.40190", "122.71062", "201.71107"),
    (10.0, 1.0): ("0.6054297", "22.47413", "61.83822", "121.0850", "200.0480"),
}
WANG_SIGN = (
    "printed with the sign of the tip inertia reversed: with -I_c for I_c their equation gives every printed digit"
)
SOURCES: tuple[Source, ...] = (
    Source(
        key="nafems-fv5",
        citation="NAFEMS, Selected Benchmarks for Forced Vibration, R0016 (1993), test 5: deep simply supported beam, "
        "2 m x 2 m x 10 m, E = 200 GPa, nu = 0.3, 8000 kg/m^3; the bending modes",
        reached="as reproduced in the Abaqus Benchmarks Guide, test 5: frequency extraction; shear factor: Cowper's "
        "10 (1 + nu)/(12 + 11 nu), the one that fits",
        cases=(
            Case(
                name="pinned-pinned",
                arm=Arm(
                    link=Link.isotropic(
                        length=10.0,
                        density=8000.0,
                        youngs_modulus=200e9,
                        poissons_ratio=0.3,
                        section=Section.rectangle(width=2.0, depth=2.0),
                    ),
                    hub=Hub(inertia=0.0),
                    payload=Payload(mass=inf),
                ),
                theory="timoshenko",
                quantity=CYCLIC,
                printed=("42.650", "148.15", "283.47"),
                why={
                    1: "at odds with the other two targets: a shear factor that gave 42.650 Hz (0.8520) would give "
                    "148.20 and 283.62 Hz"
                },
            ),
        ),
    ),
    Source(
        key="code-aster-sdlv302",
        citation="code_aster, validation manual V2.04.302 (SDLV302), section 2: short simply supported beam, "
        "0.1 m x 0.2 m x 2 m, E = 210 GPa, nu = 0.3, 7800 kg/m^3, shear factor 5/6; after G. Robert, Samtech report "
        "121 (1996)",
        reached="read in the manual",
        cases=(
            Case(
                name="pinned-pinned",
                arm=Arm(
                    link=Link.isotropic(
                        length=2.0,
                        density=7800.0,
                        youngs_modulus=2.1e11,
                        poissons_ratio=0.3,
                        section=Section.rectangle(width=0.1, depth=0.2, shear_factor=5 / 6),
                    ),
                    hub=Hub(inertia=0.0),
                    payload=Payload(mass=inf),
                ),
                theory="timoshenko",
                quantity=CYCLIC,
                printed=("115.7", "442.2", "931.6", "1534.0"),
                why={4: "four figures are given, and 1534 is right to four: the zero behind the point is typesetting"},
            ),
        ),
    ),
    Source(
        key="code-aster-v2.05.400",
        citation="code_aster, validation manual V2.05.400, section 2.1, case 1: Euler-Bernoulli beam, pinned and free",
        reached="read in the manual",
        cases=(_roots("pinned-free", ("3.9266", "7.06858", "10.2102", "13.3518", "16.4934")),),
    ),
    Source(
        key="blevins-1979",
        citation="R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), table 8-1: roots of the "
        "Euler-Bernoulli beam",
        reached="set down without a copy at hand; each digit confirmed by the transcendental equations",
        cases=(
            *(
                _roots(ends, printed, why={3: BLEVINS_LAST_DIGIT} if ends == "clamped-clamped" else {})
                for ends, printed in BLEVINS_ROOTS.items()
            ),
            *(
                Case(
                    name=f"{ends}, L/r = {SLENDER:g}",
                    arm=beam(slenderness=SLENDER, **END_CONDITIONS[ends]),
                    theory="timoshenko",
                    quantity=WAVE_NUMBER,
                    printed=BLEVINS_ROOTS[ends][:3],
                )
                for ends in ("clamped-free", "clamped-pinned", "pinned-free")
            ),
        ),
    ),
    Source(
        key="thomson-appendix-d",
        citation="W. T. Thomson, Theory of Vibration with Applications (2010), appendix D, p. 510: normal modes of "
        "uniform Euler-Bernoulli beams",
        reached="read in a scan of the page",
        cases=(
            _roots("clamped-clamped", ("4.7300", "7.8532", "10.9956")),
            _roots("clamped-clamped", ("22.3733", "61.6728", "120.9034"), REDUCED),
            _roots("clamped-free", ("1.8751", "4.6941", "7.8548")),
            _roots("clamped-free", ("3.5160", "22.0345", "61.6972"), REDUCED),
        ),
    ),
    Source(
        key="lee-schultz-2004",
        citation="J. Lee, W. W. Schultz, Eigenvalue analysis of Timoshenko beams and axisymmetric Mindlin plates by "
        "the pseudospectral method, Journal of Sound and Vibration 269 (2004) 609-621: clamped-clamped beams, "
        "nu = 0.3, shear factor 5/6",
        reached="set down without a copy at hand, so a witness of less weight: kept because every digit is confirmed",
        cases=tuple(
            Case(
                name=f"clamped-clamped, h/L = {ratio:g}",
                arm=beam(slenderness=math.sqrt(12) / ratio, **END_CONDITIONS["clamped-clamped"]),
                theory="timoshenko",
                quantity=WAVE_NUMBER,
                printed=printed,
            )
            for ratio, printed in LEE_SCHULTZ_ROOTS.items()
        ),
    ),
    Source(
        key="vpcs-sdll15",
        citation="Société française des mécaniciens, Guide de validation des progiciels de calcul de structures "
        "(AFNOR 1990), sheet SDLL15/89, problem 1: Euler-Bernoulli tube of 350/320 mm and 10 m, E = 210 GPa, "
        "7800 kg/m^3, clamped, with 1000 kg on its tip; the bending modes",
        reached="numbers and dimensions set down without a copy at hand; the sheet's method, and the formula for its "
        "first frequency, read in code_aster's manual V2.02.015",
        cases=(
            Case(
                name="clamped, with a tip mass",
                arm=Arm(
                    link=Link.isotropic(
                        length=10.0,
                        density=7800.0,
                        youngs_modulus=2.1e11,
                        poissons_ratio=0.3,
                        section=Section.tube(outer_diameter=0.35, inner_diameter=0.32),
                    ),
                    hub=Hub(inertia=inf),
                    payload=Payload(mass=1000.0),
                ),
                theory="euler-bernoulli",
                quantity=CYCLIC,
                printed=("1.65", "16.07", "50.02", "103.20"),
                why={
                    1: "the sheet's first frequency is Rayleigh's estimate with 0.24 of the beam's mass, 1.6533 Hz; "
                    "the exact one is 1.6554 Hz"
                },
            ),
        ),
    ),
    Source(
        key="bir-2010",
        citation="G. S. Bir, Verification of BModes: rotary beam and tower modal analysis code, NREL/CP-500-47953 "
        "(2010), table 5, and AIAA 2009-1035, table 3a, at rest; analytical column, after Wright, Smith, Thresher and "
        "Wang, Journal of Applied Mechanics 104 (1982): clamped Euler-Bernoulli blade, 100 kg/m, 31.623 m, "
        "EI = 1e8 N m^2, without and with 3162.3 kg on its tip; flapwise",
        reached="as reproduced in the tests of the public code pyBmodes",
        cases=(
            Case(
                name="clamped-free",
                arm=Arm(link=BIR_BLADE, hub=Hub(inertia=inf)),
                theory="euler-bernoulli",
                quantity=ANGULAR,
                printed=("3.516", "22.035", "61.697"),
                why=dict.fromkeys(
                    (2, 3),
                    "31.623 m is short for 1000^(1/2) m: that gives 61.697, and 22.0345, which was rounded once more",
                ),
            ),
            Case(
                name="clamped, with a tip mass",
                arm=Arm(link=BIR_BLADE, hub=Hub(inertia=inf), payload=Payload(mass=3162.3)),
                theory="euler-bernoulli",
                quantity=ANGULAR,
                printed=("1.557", "16.25"),
            ),
        ),
    ),
    Source(
        key="wang-2017",
        citation="B. Wang, Z. Wang, X. Zuo, Frequency equation of flexural vibrating cantilever beam considering the "
        "rotary inertial moment of an attached mass, Mathematical Problems in Engineering 2017, 1568019, table 1: "
        "Euler-Bernoulli beam with tip mass and tip inertia; the column without inertia also from their reference 11",
        reached="read in the table's page at the publisher, whose column heads lost their symbols: which ratio is "
        "which follows from the numbers",
        cases=tuple(
            Case(
                name=f"m/(rhoA L) = {mass:g}, I_c/(rhoA L^3) = {inertia:g}",
                arm=beam(mass=mass, inertia=inertia),
                theory="euler-bernoulli",
                quantity=REDUCED,
                printed=printed,
                why=dict.fromkeys(range(1, 6), WANG_SIGN) if inertia else {},
            )
            for (mass, inertia), printed in WANG_ROOTS.items()
        ),
    ),
)


LIGHT = 1e-9  # mass of a beam that has none, beside masses of 1
FAR_AXIS = 1e10  # lengths to a point about which an end turns that only slides: what is left goes with 1/FAR_AXIS
# By the stiffness k L/EI of the root.
CHUN_ROOTS = {0.1: "0.7358", 1.0: "1.2479", 10.0: "1.7227", 100.0: "1.8568"}
GHALI_BEAM = beam(slenderness=SLENDER)
# An end that slides but does not turn is one that turns about a point far away.
SLIDING_ROOTS = ("2.36502037", "5.49780392", "8.63937983", "11.78097245", "14.92256510")
SLIDING_ARMS = {
    "sliding-free, the clamp 1e10 L off the axis": replace(beam(), hub=Hub(inertia=0.0, radius=FAR_AXIS)),
    "clamped-sliding, the tip held 1e10 L beyond": replace(beam(), payload=Payload(mass=inf, offset=FAR_AXIS)),
}
# By mass m/(rhoA L) and half length e/L of each slender tip body, whose inertia is m e^2/3.
BHAT_WAGNER_ROOTS = {
    (0.5, 0.1): ("1.35056773", "3.71122911", "6.40009656", "9.13709646"),
    (1.0, 0.25): ("1.07901581", "3.08984286", "5.61317347", "8.42638262"),
    (2.0, 0.5): ("0.804292662", "2.50918084", "5.17431289", "8.12837869"),
}
# By inertia I_h/(rhoA L^3) and radius r/L of each hub.
BELLEZZA_ROOTS = {
    (0.1, 0.0): ("2.63892470", "4.79377085", "7.87565294", "11.0031042"),
    (0.0, 0.1): ("3.58261032", "6.49271973", "9.45289515", "12.4573801"),
    (0.1, 0.1): ("2.70046686", "4.89616695", "7.91975359", "11.0284434"),
    (1.0, 0.25): ("2.09220976", "4.73962320", "7.87268691", "11.0060456"),
    (0.05, 0.5): ("2.81592598", "5.46951048", "8.38394298", "11.3976967"),
}
RIG_SOURCES: tuple[Source, ...] = (
    Source(
        key="chun-1972",
        citation="K. R. Chun, Free vibration of a beam with one end spring-hinged and the other free, J. Appl. Mech. "
        "39 (1972) 1154",
        reached="set down without a copy at hand; each digit confirmed by the transcendental equation",
        cases=tuple(
            Case(
                name=f"root spring k L/EI = {stiffness:g}",
                arm=replace(beam(slenderness=SLENDER), clamp=RotarySpring(stiffness=stiffness)),
                theory="euler-bernoulli",
                quantity=WAVE_NUMBER,
                printed=(text,),
            )
            for stiffness, text in CHUN_ROOTS.items()
        ),
    ),
    Source(
        key="ghali-neville-2017",
        citation="A. Ghali and A. M. Neville, Structural Analysis, 7th edition (2017), example 24.2: masses 1, 1 and 4 "
        "at 1, 2 and 3 from the clamp of a beam of EI = 1 without mass",
        reached="as reproduced in the tests of the package pystran",
        cases=(
            Case(
                name="three masses on a cantilever",
                arm=replace(
                    GHALI_BEAM,
                    link=replace(GHALI_BEAM.link, length=3.0, density=LIGHT),
                    hub=Hub(inertia=inf),
                    payload=Payload(mass=4.0),
                    attachments=tuple(Attachment(x=at, mass=1.0) for at in (1.0, 2.0)),
                ),
                theory="euler-bernoulli",
                quantity=ANGULAR,
                printed=("0.1609", "1.7604", "5.0886"),
            ),
        ),
    ),
    Source(
        key="blevins-1979-sliding",
        citation="R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), table 8-1: roots of the "
        "Euler-Bernoulli beam with an end that slides",
        reached="set down without a copy at hand; each digit confirmed by tan z + tanh z = 0",
        cases=tuple(
            Case(name=name, arm=arm, theory="euler-bernoulli", quantity=WAVE_NUMBER, printed=SLIDING_ROOTS)
            for name, arm in SLIDING_ARMS.items()
        ),
    ),
    Source(
        key="bhat-wagner-1976",
        citation="B. R. Bhat and H. Wagner, Natural frequencies of a uniform cantilever with a tip mass slender in the "
        "axial direction, Journal of Sound and Vibration 45 (1976) 304-307: a clamped Euler-Bernoulli beam that a "
        "rigid rod of length 2 e lengthens; roots of the frequency equation, not numbers of the paper",
        reached="no copy at hand: the equation is derived anew in the test, which computes each digit",
        cases=tuple(
            Case(
                name=f"tip body m/(rhoA L) = {mass:g}, e/L = {offset:g}",
                arm=replace(beam(), payload=Payload(mass=mass, inertia=mass * offset**2 / 3, offset=offset)),
                theory="euler-bernoulli",
                quantity=WAVE_NUMBER,
                printed=printed,
            )
            for (mass, offset), printed in BHAT_WAGNER_ROOTS.items()
        ),
    ),
    Source(
        key="bellezza-lanari-ulivi-1990",
        citation="F. Bellezza, L. Lanari and G. Ulivi, Exact modeling of the flexible slewing link, IEEE International "
        "Conference on Robotics and Automation (1990) 734-739: an Euler-Bernoulli link on a turning hub; roots of "
        "the frequency equation, to which the terms in the hub's radius are added, not numbers of the paper",
        reached="no copy at hand: the equation is derived anew in the test, which computes each digit",
        cases=tuple(
            Case(
                name=f"free hub I_h/(rhoA L^3) = {inertia:g}, r/L = {radius:g}",
                arm=replace(beam(), hub=Hub(inertia=inertia, radius=radius)),
                theory="euler-bernoulli",
                quantity=WAVE_NUMBER,
                printed=printed,
            )
            for (inertia, radius), printed in BELLEZZA_ROOTS.items()
        ),
    ),
)
