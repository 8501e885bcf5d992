"""Published natural frequencies against the exact ones: their number, ours, the difference, and why there is one.

`literature.toml` has the numbers, with all they need to be computed again.  A row agrees if ours, rounded to the last
printed digit, is what they printed.  One that does not must give a reason (`why`), and one that does must not.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from importlib.resources import files
from itertools import groupby
from operator import attrgetter
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Theory
from tfarm.arm.schema import arm_of_table
from tfarm.errors import CertificationError
from tfarm.schema import Quantity
from tfarm.spectrum import modes

DATA = tomllib.loads((files("tfarm.audit") / "literature.toml").read_text("utf-8"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedColumn:
    """One column of a table: the arm, the theory it was printed for, and what was printed of modes 1, 2, ...

    `quantity` is one of those of `exact_numbers`, w in rad/s; `why` has a reason for each mode whose printed digits are
    not reached.
    """

    name: str
    arm: Arm
    theory: Theory
    quantity: str
    printed: tuple[str, ...]
    why: Mapping[int, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A publication: `citation` names its table, `reached` the way of its numbers to here."""

    key: Annotated[str, Quantity("source", key="key", help="short name of the publication")]
    citation: Annotated[str, Quantity("citation", help="publication and table of the printed numbers")]
    reached: Annotated[str, Quantity("read from", help="way by which the printed numbers came here")]
    cases: tuple[PrintedColumn, ...]


def arm_of_case(case: Mapping[str, Any]) -> Arm:
    """Return the arm of a case: the beam of the file with the case's own tables in the place of its own."""
    beam = DATA["beam"]
    slenderness = case.get("slenderness", beam["slenderness"])
    section = beam["section"] | {"second_moment": slenderness**-2}
    link = beam["link"] | {"youngs_modulus": slenderness**2, "section": section} | case.get("link", {})
    parts = {key: case[key] for key in ("clamp", "payload", "attachment") if key in case}
    return arm_of_table({"name": "arm", "link": link, "hub": beam["hub"] | case.get("hub", {}), **parts})


def _source(table: dict[str, Any]) -> Source:
    """Return the source of a table, whose theory and quantity are those of its cases but where these have others."""
    return Source(
        key=table["key"],
        citation=table["citation"],
        reached=table["reached"],
        cases=tuple(_column(table | case) for case in table["case"]),
    )


def _column(case: dict[str, Any]) -> PrintedColumn:
    """Return the column of a case."""
    return PrintedColumn(
        name=case["name"],
        arm=arm_of_case(case),
        theory=case["theory"],
        quantity=case["quantity"],
        printed=tuple(case["printed"]),
        why=dict.fromkeys(case.get("differs", ()), case.get("why", "")),
    )


ALL = tuple(map(_source, DATA["source"]))


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedRow:
    """One printed number and ours; `difference` is ours/printed - 1, `why` empty where ours agrees."""

    source: Annotated[str, Quantity("source", help="short name of the publication")]
    case: Annotated[str, Quantity("case", help="boundary conditions and payload of one column of the table")]
    quantity: Annotated[
        str, Quantity("quantity", help="quantity that is printed, with its unit or normalisation")
    ]
    mode: Annotated[int, Quantity("mode", help="number of the mode, from 1")]
    agrees: Annotated[
        bool,
        Quantity(
            "agrees to the last printed digit", help="whether the exact value rounds to the printed digits"
        ),
    ]
    printed: Annotated[str, Quantity("printed", help="number as printed, with its zeros")]
    ours: Annotated[
        float, Quantity("exact", digits=10, help="value by the exact solution in the same quantity")
    ]
    difference: Annotated[
        float, Quantity("relative difference", digits=2, help="exact over printed, less one")
    ]
    why: Annotated[
        str, Quantity(help="reason of a difference beyond the printed digits; empty where there is none")
    ]


class PublishedDifference(NamedTuple):
    """Printed numbers of a case that ours do not round to, and why."""

    source: Annotated[str, Quantity("source", help="short name of the publication")]
    case: Annotated[str, Quantity("case", help="boundary conditions and payload of one column of the table")]
    modes: Annotated[str, Quantity("modes", help="numbers of the modes that differ")]
    largest: Annotated[
        float,
        Quantity(
            "largest difference", digits=2, help="exact over printed, less one, of the mode that differs most"
        ),
    ]
    why: Annotated[str, Quantity("reason", help="cause of the difference, computed anew in the tests")]


def validate(sources: tuple[Source, ...] = ALL) -> tuple[PublishedRow, ...]:
    """Return every row of every source.

    Raises CertificationError naming the rows that differ beyond their printed digits without a reason, or that give
    a reason and agree.
    """
    found: list[PublishedRow] = []
    for source in sources:
        for case in source.cases:
            found += case_rows(source.key, case)
    wrong = []
    for row in found:
        if row.agrees == bool(row.why):
            fault = "which agrees though a reason is given" if row.agrees else "and no reason is given"
            head = f"{row.source}, {row.case}, mode {row.mode}"
            wrong.append(f"{head}: printed {row.printed}, exact {row.ours:.10g}, {fault}")
    if wrong:
        raise CertificationError("; ".join(wrong))
    return tuple(found)


def case_rows(key: str, case: PrintedColumn) -> list[PublishedRow]:
    """Return the rows of one column of a table."""
    found = exact_numbers(case).tolist()
    return [
        PublishedRow(
            source=key,
            case=case.name,
            quantity=case.quantity,
            mode=mode,
            printed=printed,
            ours=ours,
            difference=ours / float(printed) - 1,
            agrees=agrees(ours, printed),
            why=case.why.get(mode, ""),
        )
        for mode, (printed, ours) in enumerate(zip(case.printed, found, strict=True), start=1)
    ]


def exact_numbers(case: PrintedColumn) -> NDArray[np.float64]:
    """Return the exact solution's numbers for a column, in its quantity."""
    link = case.arm.link
    count = len(case.printed)
    table = modes(case.arm, count, theory=case.theory)
    reduced = table.flexible * link.length**2 * np.sqrt(link.rhoA / link.EI)
    return {
        "frequency [Hz]": table.natural_frequency_hz[-count:],
        "frequency [rad/s]": table.flexible,
        "w L^2 (rhoA/EI)^(1/2)": reduced,
        "L (w^2 rhoA/EI)^(1/4)": np.sqrt(reduced),
    }[case.quantity]


def agrees(ours: float, printed: str) -> bool:
    """Whether ours lies within half a unit of the last printed digit."""
    number = Decimal(printed)
    return abs(Decimal(ours) - number) <= Decimal("0.5").scaleb(int(number.as_tuple().exponent))


@dataclass(frozen=True)
class Validation:
    """Published tables, number by number."""

    rows: Annotated[
        tuple[PublishedRow, ...], Quantity("published numbers", help="printed and exact value of each number")
    ]
    sources: Annotated[
        tuple[Source, ...], Quantity("sources", help="publications that the numbers are from")
    ] = ALL

    @property
    def differences(
        self,
    ) -> Annotated[
        list[PublishedDifference],
        Quantity("differences", help="numbers whose printed digits are not reached, a row a reason"),
    ]:
        """A row a reason."""
        differing = [row for row in self.rows if not row.agrees]
        found = []
        for (source, case, why), group in groupby(differing, attrgetter("source", "case", "why")):
            rows = list(group)
            modes_text = ", ".join(str(row.mode) for row in rows)
            largest = max((row.difference for row in rows), key=abs)
            found.append(PublishedDifference(source, case, modes_text, largest, why))
        return found

    @property
    def agree(
        self,
    ) -> Annotated[
        int,
        Quantity(
            "agree to the last printed digit", help="count of printed numbers that the exact value rounds to"
        ),
    ]:
        """The number of numbers that agree."""
        return sum(row.agrees for row in self.rows)

    @property
    def explained(
        self,
    ) -> Annotated[
        int,
        Quantity(
            "differ for the reason given",
            "",
            6,
            "count of printed numbers with another last digit and a known cause",
        ),
    ]:
        """The number of those that do not."""
        return sum(bool(row.why) for row in self.rows)
