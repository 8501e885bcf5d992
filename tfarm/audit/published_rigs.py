"""Published natural frequencies of rigs: yielding roots, masses on the way, a hub's radius, payloads beyond the tip.

Two sources are frequency equations instead of tables: what stands here as printed are their roots, each digit of which
the test of the source computes (see `literature`).
"""

from __future__ import annotations

from dataclasses import replace

from tfarm.arm import Attachment, Hub, Payload, RotarySpring

from .literature import ANGULAR, SLENDER, WAVE_NUMBER, Case, Source, beam, inf

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
