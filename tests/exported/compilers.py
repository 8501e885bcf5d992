"""C compilers that are installed, without a shell and with a time limit, and exported C code run on many samples."""

import shutil
import subprocess

import numpy as np
import pytest

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")
COMPILERS = ("gcc", "clang")
SECONDS = 60
KINDS = {"double": np.float64, "float": np.float32, "q31": np.int32}
PUMP = """
#include "CODE.h"
#include <stdio.h>
int main(void)
{
    static NAME_state state;
    static NAME_input input;
    static NAME_number row[FIELDS], out;
    int status;
    NAME_init(&state);
    while (fread(row, sizeof row[0], FIELDS, stdin) == FIELDS) {
ASSIGN
        out = (NAME_number)77; /* not that of the sample before */
        status = NAME_step(&state, &input, &out);
        fwrite(&out, sizeof out, 1, stdout);
        fwrite(&status, sizeof status, 1, stdout);
    }
    return 0;
}
"""


def needed(program):
    """The path of a program; without it the test is skipped, and the program is named."""
    path = shutil.which(program)
    if path is None:
        pytest.skip(f"{program} is not installed on this machine")
    return path


def run(*words, **how):
    """Run a program without a shell; its output, or an assertion with what it printed."""
    done = subprocess.run([str(each) for each in words], capture_output=True, timeout=SECONDS, check=False, **how)
    assert done.returncode == 0, (words, done.stdout[-2000:], done.stderr[-2000:])
    return done.stdout


def build(folder, compiler, *options, sources=("controller.c", "self_test.c"), out="test"):
    """Compile sources of a folder; the program."""
    program = folder / f"{out}-{compiler}-{'-'.join(options).replace('=', '').replace(',', '')}"
    run(needed(compiler), *STRICT, *options, *(folder / each for each in sources), "-o", program)
    return program


def stepped(folder, controller, inputs, compiler, *options):
    """Outputs and status of an exported controller in `folder`, of inputs (n, k) in the kind of its arithmetic."""
    return pumped(folder, "controller", KINDS[controller.word.precision], inputs, compiler, *options)


def pumped(folder, code, kind, inputs, compiler, *options):
    """Outputs and status of exported code, of inputs (n, k) of a kind."""
    header = (folder / f"{code}.h").read_text(encoding="ascii")
    name = header.partition("#ifndef ")[2].partition("_CONTROLLER_H")[0]
    body = header.partition("typedef struct {\n")[2].partition("}")[0]
    fields = [each.split()[-1] for each in body.partition(";")[0].split(",")]
    assert len(fields) == inputs.shape[1]
    assign = "\n".join(f"        input.{each} = row[{n}];" for n, each in enumerate(fields))
    text = (
        PUMP.replace("ASSIGN", assign).replace("FIELDS", str(len(fields))).replace("NAME", name).replace("CODE", code)
    )
    (folder / "pump.c").write_text(text, encoding="ascii")
    program = build(folder, compiler, *options, sources=(f"{code}.c", "pump.c"), out="pump")
    raw = run(program, input=np.ascontiguousarray(inputs, dtype=kind).tobytes())
    rows = np.frombuffer(raw, dtype=np.dtype([("out", kind), ("status", np.int32)]))
    return rows["out"], rows["status"]


def random_inputs(rng, controller, count, fields=None):
    """Inputs of the size of their ranges, one in a hundred far larger, in the kind of the arithmetic."""
    k = controller.inputs
    if controller.word.precision == "q31":
        found = rng.integers(-(2**31), 2**31, size=(count, k))
        return np.where(rng.random((count, 1)) < 0.5, found >> rng.integers(0, 31, size=(count, k)), found)
    sizes = rng.choice([1.0, 1e-3, 1e3], p=[0.9, 0.09, 0.01], size=(count, k))
    return (sizes * rng.normal(size=(count, k))).astype(KINDS[controller.word.precision]).astype(float)
