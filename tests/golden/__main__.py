"""Compare the answers of all commands with those that are kept, or keep them anew.

python -m tests.golden [SIZE SEED]      # as `make survey` runs it; both are passed over
python -m tests.golden --keep [WORDS]   # of the commands that begin so
"""

import sys

from tests.golden.answers import answer_of, commands, differences, file_of, keep, kept


def main(words):
    if words[:1] == ["--keep"]:
        chosen = [line for line in commands() if line.startswith(" ".join(words[1:]))]
        for line in chosen:
            keep(line, answer_of(line))
        names = {file_of(line) for line in commands()}
        for path in (file_of("x").parent).glob("*.json"):
            if path not in names:
                path.unlink()
        return 0
    failed = 0
    for line in commands():
        found = differences(line, kept(line), answer_of(line))
        failed += bool(found)
        if found:
            print(line, *found, sep="\n    ")
    print(f"{len(commands())} commands, {failed} with another answer than kept")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
