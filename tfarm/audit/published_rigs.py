"""Published natural frequencies of rigs: yielding roots and masses on the way (see `literature`)."""

from __future__ import annotations

from dataclasses import replace

from tfarm.arm import Attachment, Hub, Payload, RotarySpring

from .literature import ANGULAR, SLENDER, WAVE_NUMBER, Case, Source, beam, inf

LIGHT = 1e-9  # mass of a beam that has none, beside masses of 1


def _chun() -> Source:
    printed = {0.1: "0.7358", 1.0: "1.2479", 10.0: "1.7227", 100.0: "1.8568"}
    return Source(
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
            for stiffness, text in printed.items()
        ),
    )


def _ghali_neville() -> Source:
    light = beam(slenderness=SLENDER)
    link = replace(light.link, length=3.0, density=LIGHT)
    return Source(
        key="ghali-neville-2017",
        citation="A. Ghali and A. M. Neville, Structural Analysis, 7th edition (2017), example 24.2: masses 1, 1 and 4 "
        "at 1, 2 and 3 from the clamp of a beam of EI = 1 without mass",
        reached="as reproduced in the tests of the package pystran",
        cases=(
            Case(
                name="three masses on a cantilever",
                arm=replace(
                    light,
                    link=link,
                    hub=Hub(inertia=inf),
                    payload=Payload(mass=4.0),
                    attachments=tuple(Attachment(x=at, mass=1.0) for at in (1.0, 2.0)),
                ),
                theory="euler-bernoulli",
                quantity=ANGULAR,
                printed=("0.1609", "1.7604", "5.0886"),
            ),
        ),
    )


RIG_SOURCES: tuple[Source, ...] = (_chun(), _ghali_neville())
