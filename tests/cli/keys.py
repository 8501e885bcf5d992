"""The keys of what each command prints with --json: a contract, kept in `keys.json` beside this file.

    python -m tests.cli.keys

writes that file anew, for a release that adds keys (CHANGELOG says what a program may rely on).
"""

import json
import subprocess
import sys
from pathlib import Path

KEPT = Path(__file__).with_name("keys.json")
LAW = "[law.hub_rate]\nnum = [0.3]\nden = [0.001, 1.0]\n[law.root_moment]\ngain = 0.3\n"
ARM, BARE, GAINS = "sasaki2012-lab", "sasaki2012", ("--K1", "0.3", "--K2", "0.3")
COMMANDS = {  # what each is asked, as short as its keys allow; {law} is a file of `LAW`
    "modes": ("modes", BARE, "--count", "2", "--certify"),
    "modes, damped": ("modes", ARM, "--count", "2", "--certify"),
    "modes, compared": ("modes", BARE, "--count", "2", "--compare"),
    "response": ("response", ARM, "--output", "root_moment", "--s", "0.3+57.1j"),
    "response, compared": ("response", BARE, "--output", "root_moment", "--s", "0.3+57.1j", "--compare"),
    "poles": ("poles", ARM, *GAINS, "--count", "3"),
    "margins": ("margins", ARM, *GAINS),
    "margins, unstable": ("margins", ARM, "--K1", "0.3", "--K2", "-4"),
    "margins of a law": ("margins", ARM, "--law", "{law}"),
    "bode": ("bode", ARM, "--output", "root_moment", "--from", "1", "--to", "300"),
    "nyquist": ("nyquist", ARM, *GAINS),
    "compare": ("compare", BARE, ARM),
    "locus": ("locus", ARM, "--vary", "K2", "--from", "0", "--to", "2", "--points", "5", "--branches", "3"),
    "locus of a law": (
        "locus", ARM, "--law", "{law}", "--vary", "root_moment", "--from", "0.1", "--to", "1", "--points", "4",
        "--branches", "2",
    ),
    "map": ("map", ARM, "--K1=-1,3", "--K2=-2,2"),
    "spill": ("spill", ARM, "--K1", "0.3", "--K2=-2"),
    "design": ("design", ARM, "--objective", "damping"),
    "reduce": ("reduce", ARM, "--outputs", "root_moment", "--order", "6"),
    "sampled": ("sampled", ARM, *GAINS, "--modes", "4"),
    "sampled, a law": ("sampled", ARM, "--law", "{law}", "--modes", "4"),
    "simulate": ("simulate", ARM, "--scenario", "slew", "--modes", "4"),
    "tune": ("tune", ARM, "--trials", "2"),
    "validate": ("validate",),
    "assumptions": ("assumptions", BARE),
    "glossary": ("glossary",),
    "presets": ("presets",),
}  # fmt: skip


def paths(value, at=""):
    """The paths of all keys of a JSON value, a list's items together: "modes[].index"."""
    if isinstance(value, dict):
        named = {f"{at}.{key}".lstrip("."): one for key, one in value.items()}
        return set(named).union(*(paths(one, name) for name, one in named.items()))
    if isinstance(value, list):
        return {each for one in value for each in paths(one, f"{at}[]")}
    return set()


def main():
    found = {}
    for name, words in COMMANDS.items():
        law = KEPT.with_name("law.toml")
        law.write_text(LAW, encoding="utf-8")
        command = [sys.executable, "-m", "tfarm", *(word.format(law=law) for word in words), "--json"]
        found[name] = sorted(paths(json.loads(subprocess.run(command, capture_output=True, check=True).stdout)))
        law.unlink()
    KEPT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
