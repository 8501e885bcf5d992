"""Arm files and options that no person would write, through the command line:  python -m tests.cli.fuzz SIZE SEED

SIZE arm files (presets with lines changed, doubled, cut or filled with odd values, and files of noise), each through
one verb with its defaults, and SIZE/17 sets of odd options on the presets.  Each command must exit 0, 2 or 3, say
nothing on standard error but lines that begin with `tfarm:`, at most one of them an error and none a traceback, and
take no more than 20 CPU seconds; with --json it prints one object or nothing.

Each runs in a fork of this process, which the system ends at that time.
"""

import json
import os
import resource
import sys
import tempfile
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.shell import heard
from tests.survey import Finding
from tfarm.cli.running import commands_of, run, whole_command

CPU_SECONDS = 20
OPTIONS_PER_FILE = 17  # 5,000 files go with 300 sets of options
PRESETS = Path(tfarm.__file__).parent / "arm" / "presets"
VERBS = (
    "modes", "response --output root_moment --points 20", "poles --count 4", "margins", "map --points 12",
    "sampled", "simulate --duration 0.2", "proof assumptions --count 2", "reduce --order 6",
    "locus --vary K2 --from 0 --to 0.5 --points 5 --branches 3", "design --modes 1",
)  # fmt: skip
NUMBERS = (
    "0", "-0.0", "1", "-1", "1e-300", "1e300", "1e308", "1e-40", "1e40", "nan", "inf", "-inf", "true", '"1"', "[]",
    "{}", "1_0", "0x10", "1e", "0.5", "1e-3", "1e3", "1e6", "12.0", "0.02", "2.1e11", "210.0", "1979-05-27", "9" * 400,
)  # fmt: skip
WORDS = (
    "", "0", "1", "2", "-1", "3.5", "1e3", "1e308", "-1e308", "1e-308", "nan", "inf", "-inf", "5_0", "٣", "abc", "1,2",
    "2,1", "0,0", "nan,inf", "1e-12,1e12", "1j", "1e300j", "0.3+57.1j,10j", "-", "--", "é", "\x00", "a" * 5000, "/",
    "..", "0.01", "0.1", "10", "100",
)  # fmt: skip


def odd_file(rng):
    """The bytes of an arm's file with something odd in it."""
    names = sorted(PRESETS.glob("*.toml"))
    lines = names[rng.integers(len(names))].read_text(encoding="utf-8").splitlines()
    for _ in range(int(rng.integers(1, 4))):
        lines = _changed(rng, lines)
    text = "\n".join(lines).encode()
    if rng.random() < 0.1:  # a few bytes of noise
        at = int(rng.integers(len(text) + 1))
        text = text[:at] + rng.bytes(int(rng.integers(1, 9))) + text[at:]
    if rng.random() < 0.05:
        text = text[: int(rng.integers(len(text) + 1))]
    return text


def _changed(rng, lines):
    """One line with another value, scaled by some powers of ten, twice, elsewhere or gone."""
    settings = [i for i, line in enumerate(lines) if "=" in line]
    i = int(rng.choice(settings)) if settings else 0
    key, _, value = lines[i].partition("=")
    draw = rng.random()
    if draw < 0.15:
        return [*lines[:i], f"{key}= {rng.choice(NUMBERS)}", *lines[i + 1 :]]
    if draw < 0.8:
        try:
            number = float(value.partition("#")[0]) * 10.0 ** rng.uniform(-4, 4)
        except ValueError:
            return lines
        return [*lines[:i], f"{key}= {number!r}", *lines[i + 1 :]]
    if draw < 0.84:
        return [*lines[:i], *lines[i + 1 :]]
    if draw < 0.88:
        return [*lines[: i + 1], *lines[i:]]
    if draw < 0.94:
        return [*lines[:i], lines[i].replace(key.strip(), key.strip()[:-1] + "x"), *lines[i + 1 :]]
    tables = ("[sampling]", "period = 1e-9", "[converters]", "moment_bits = 99", "[slew]", "[[link]]", "[hub.x]")
    return [*lines, str(rng.choice(tables))]


def odd_options(rng, options):
    """A verb of the command line with one to four of its options, each with an odd word."""
    verb = str(rng.choice(sorted(options)))
    arguments = verb.split()
    if verb not in ("proof audit", "proof validate"):
        arguments += [str(rng.choice(tfarm.presets()))]
    known = options[verb]
    for _ in range(int(rng.integers(1, 5)) if known else 0):  # a verb may have none
        name, is_flag = known[int(rng.integers(len(known)))]
        arguments += [name] if is_flag else [name, str(rng.choice(WORDS))]
    return tuple(arguments)


def options_of_the_verbs():
    """Of each verb but those that take minutes by their purpose: its options, and whether each is a flag."""
    return {
        name: [
            (param.opts[0], bool(getattr(param, "is_flag", False))) for param in verb.params if param.opts[0][:1] == "-"
        ]
        for name, verb in commands_of(whole_command()).items()
        if name not in ("report", "tune")
    }


def cases(number, seed, folder):
    """The commands: odd files in `folder`, then odd options."""
    rng = np.random.default_rng(seed)
    drawn = []
    for i in range(number):
        file = folder / f"arm{i}.toml"
        file.write_bytes(odd_file(rng))
        verb, dashes, rest = str(rng.choice(VERBS)).partition(" --")
        drawn.append(
            (*verb.split(), str(file), *f"{dashes}{rest}".split(), *(["--json"] if rng.random() < 0.5 else []))
        )
    options = options_of_the_verbs()
    return drawn + [odd_options(rng, options) for _ in range(-(-number // OPTIONS_PER_FILE))]


def started(arguments, folder, *files):
    """The process id of a fork that runs the command in that folder, with files for its output and errors."""
    child = os.fork()
    if child:
        return child
    try:
        os.chdir(folder)
        for number, file in enumerate(files, 1):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        os._exit(run(list(arguments)))
    except BaseException as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
    finally:
        os._exit(1)


def outcome(arguments, folder):
    """Exit code (None: ended by the system), output, errors and CPU seconds of one command."""
    files = folder / "out", folder / "err"
    child = started(arguments, folder, *files)
    resource.prlimit(child, resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))
    _, status, used = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    return code if code >= 0 else None, *(file.read_text("utf-8", "replace") for file in files), used.ru_utime


def judge(arguments, code, out, err, seconds):
    """What is wrong with a command, or an empty text."""
    lines = [line for line in err.splitlines() if line and not line.startswith("written: ")]
    errors = [line for line in heard("\n".join([*lines, ""])).splitlines() if not line.startswith("tfarm: warning:")]
    strangers = [line for line in lines if not line.startswith("tfarm: ")]
    checks = {
        f"more than {CPU_SECONDS} CPU seconds": code is None or seconds > CPU_SECONDS,
        f"exit {code}: {err.strip()[-200:]}": code not in (0, 2, 3),
        f"prints {strangers[:1]}": strangers,
        f"{len(errors)} errors: {errors[1:2]}": len(errors) > 1,
        f"exit {code} without a word": code and not errors,
        f"no JSON: {out[:200]}": "--json" in arguments and code == 0 and not is_json(out),
    }
    return next((words for words, is_so in checks.items() if is_so), "")


def is_json(text):
    """Whether a text is one JSON value."""
    try:
        json.loads(text)
    except ValueError:
        return False
    return True


def commands(size, seed):
    """What came of every command."""
    with tempfile.TemporaryDirectory() as name:
        for arguments in cases(size, seed, Path(name)):
            code, out, err, seconds = outcome(arguments, Path(name))
            wrong = judge(arguments, code, out, err, seconds)
            files = [Path(word).read_bytes() for word in arguments if word.startswith(name)] if wrong else []
            words = f"{wrong} | {' '.join(map(repr, arguments))[:300]} {files}" if wrong else ""
            yield Finding(f"exit {code}", words, bool(wrong), {"CPU seconds": seconds})


if __name__ == "__main__":
    survey.main(commands, size=300)
