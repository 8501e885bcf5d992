"""Names and texts that would be more than text on a page that is careless, and what a page makes of them."""

from html.parser import HTMLParser
from xml.etree import ElementTree

LONG = "W" * 300  # one word, longer than any line
TEXT = (  # ends a script, opens tags, leaves attributes, speaks to templates and to TeX, turns the line around
    "<script>alert(1)</script></title></style><evil onload=\"alert(1)\" x='1'>-->]]> & &amp; {{ 7 * 7 }} {% raw %} "
    "$x$ \\frac{ I_h in kg m^2 \u05e9\u05dc\u05d5\u05dd \u202eevil"
)
PRINTED = TEXT.replace("\u202e", "")  # for an assumption, which has to be printable
NAME = "Ärm & co's {{7+7}} שלום #1 $x$ 100% &amp;"  # for an arm: as bad as a folder's name may be


class Read(HTMLParser):
    """A page's tags, attributes, and texts, and those of its tables' cells, a list a row."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.attributes, self.texts, self.rows = set(), [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes += attrs
        if tag == "tr":
            self.rows.append([])
        elif tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_data(self, data):
        self.texts.append(data)
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def check_page(page, *wanted, scripts=0):
    """Each of the texts is on the page, as text, and none of them made an element."""
    found = Read(page)
    assert found.tags.isdisjoint({"evil", "script" if not scripts else "evil"})
    assert page.count("<script") == page.count("</script") == scripts
    assert not [key for key, _ in found.attributes if key.startswith("on")]
    for text in wanted:
        assert any(text in each for each in found.texts), text


def check_drawing(svg):
    """A drawing has no tag but those of drawings."""
    tags = {element.tag.partition("}")[2] for element in ElementTree.fromstring(svg).iter()}
    assert tags.isdisjoint({"script", "evil", "foreignObject", "a"})


C_TEXTS = (  # for comments and identifiers of exported code
    TEXT, NAME, LONG, "a */ int x; /* b", "*/*/", "/*/", "ends ??/", "ends \\", "two\nlines\r\n#error", "int",
    "\\*/ ??/\n*/", "*\\/ /\\* ?\\?/", "%{ x %} ' '' \"", "`rm -rf`; $(x)", "\u2028\x00\x1b[31m", "é*\u0301/",
)  # fmt: skip
