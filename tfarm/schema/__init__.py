"""A quantity of a record is declared once, on its field or property, and every output reads it there.

    @dataclass(frozen=True)
    class Margins:
        delay: Annotated[float, Quantity("delay margin", "s", 4, "smallest further delay that destabilises the loop")]

JSON, CSV, terminals, pages, axes, the documentation and the comparison of two records have its name, unit, digits and
meaning from here.

quantities  Quantity, values of a record in JSON and as text, two records compared
tables      tables and sections of records, as JSON and CSV
terminal    records and tables on a terminal
html        tables on a page
printed     records that print as their table
glossary    words of certainty, terms and every declared quantity
"""

from tfarm.moved import moved
from tfarm.schema.printed import Tabled
from tfarm.schema.quantities import (
    At,
    Difference,
    Percent,
    Quantity,
    compare_records,
    entries,
    quantities,
    text,
    to_dict,
    with_unit,
)
from tfarm.schema.tables import (
    Column,
    RecordSection,
    Table,
    across,
    as_csv,
    as_json,
    curve_table,
    json_value,
    roots_table,
    save_table,
    sections,
    table,
    to_json,
)

__all__ = [
    "At",
    "Column",
    "Difference",
    "Percent",
    "Quantity",
    "RecordSection",
    "Table",
    "Tabled",
    "across",
    "as_csv",
    "as_json",
    "compare_records",
    "curve_table",
    "entries",
    "json_value",
    "quantities",
    "roots_table",
    "save_table",
    "sections",
    "table",
    "text",
    "to_dict",
    "to_json",
    "with_unit",
]

# names up to version 1.0
__getattr__ = moved(
    __name__, {"Section": "tfarm.schema:RecordSection", "compare": "tfarm.schema:compare_records"}
)
