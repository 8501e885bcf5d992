"""A functional mock-up unit driven by ctypes: what an importing tool does, without one."""

import ctypes
import zipfile
from contextlib import contextmanager
from copy import copy
from ctypes import CFUNCTYPE, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from types import SimpleNamespace
from unittest import mock
from xml.etree import ElementTree

import numpy as np

from tfarm.arm.law import REFERENCE
from tfarm.exported import fmu

LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
OK, WARNING, DISCARD, ERROR = range(4)
MODEL_EXCHANGE, CO_SIMULATION = range(2)
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3

DRIVER = """
#include "fmi2.h"
#include <math.h>
#include <stdio.h>
fmi2Component fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *, int, int);
fmi2Status fmi2SetupExperiment(fmi2Component, int, double, double, int, double);
fmi2Status fmi2ExitInitializationMode(fmi2Component), fmi2Reset(fmi2Component);
fmi2Status fmi2GetReal(fmi2Component, const fmi2ValueReference *, size_t, double *);
fmi2Status fmi2SetReal(fmi2Component, const fmi2ValueReference *, size_t, const double *);
fmi2Status fmi2DoStep(fmi2Component, double, double, int);
void fmi2FreeInstance(fmi2Component);
static unsigned long long seed = 1;
static double some(void) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(seed >> 33) / 2147483648.0;
}
int main(void) {
    const fmi2CallbackFunctions none = {0};
    const double odd[] = {0.0, -0.0, NAN, INFINITY, -INFINITY, 1e308, 1e-320, 1e18};
    fmi2Component c = fmi2Instantiate("driver", fmi2CoSimulation, "GUID", "", &none, 0, 0);
    double time = 0.0, step, value;
    int good = 0;
    for (int n = 0; n < 20000; n++) {
        const double kind = some();
        const fmi2ValueReference at = (fmi2ValueReference)(some() < 0.95 ? some() * 30 : some() * 4e9);
        value = some() < 0.999 ? some() - 0.5 : odd[(int)(some() * 8)];
        if (kind < 0.5)
            fmi2SetReal(c, &at, 1, &value);
        else if (kind < 0.6)
            fmi2GetReal(c, &at, 1, &value);
        else if (kind < 0.61 || n == 0) {
            fmi2Reset(c);
            fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0);
            fmi2ExitInitializationMode(c);
            time = 0.0;
        } else {
            step = 0.01 * (1 + (int)(3 * some())) * (some() < 0.2 ? some() : 1.0);
            step = some() < 0.99 ? step : odd[(int)(some() * 5)];
            if (fmi2DoStep(c, time, step, 1) == fmi2OK) {
                time += step;
                good++;
            }
        }
    }
    fmi2FreeInstance(c);
    printf("%d steps\\n", good);
    return 0;
}
"""


@contextmanager
def modes_of_units(count):
    """Units of a number of flexible modes, in place of those that the simulation of a slew takes seconds to choose."""
    with mock.patch.object(fmu, "simulate_modes", return_value=(None, SimpleNamespace(modes=count))):
        yield


class Callbacks(Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [(name, c_void_p) for name in ("logger", "allocate", "free", "step_finished", "environment")]


class Unit:
    """An instance of a unit, unpacked into a folder; a status that is not asked for has to be good."""

    def __init__(self, file, folder):
        self.folder = Path(folder)
        if not self.folder.exists():
            with zipfile.ZipFile(file) as archive:
                archive.extractall(folder)
        self.xml = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        (self.binary,) = self.folder.glob(f"binaries/*/{self.xml.find('CoSimulation').get('modelIdentifier')}.*")
        variables = list(self.xml.iter("ScalarVariable"))
        self.at = {each.get("name"): int(each.get("valueReference")) for each in variables}
        self.causality = {each.get("name"): each.get("causality") for each in variables}
        self.period = float(self.xml.find("DefaultExperiment").get("stepSize"))
        self.library = ctypes.CDLL(str(self.binary))
        self.library.fmi2Instantiate.restype = c_void_p
        self.c = self._instance(self.xml.get("guid"), CO_SIMULATION)

    def _instance(self, guid, kind):
        self.logged, self.time = [], 0.0
        self._logger = LOGGER(lambda *arguments: self.logged.append(arguments[-1].decode()))
        self._callbacks = Callbacks(ctypes.cast(self._logger, c_void_p))
        return c_void_p(self.library.fmi2Instantiate(b"unit", kind, guid.encode(), b"", byref(self._callbacks), 0, 0))

    def another(self, guid=None, kind=CO_SIMULATION):
        """Another instance in the same process; None where there is none."""
        other = copy(self)
        other.c = other._instance(guid or self.xml.get("guid"), kind)
        return other if other.c.value else None

    def status(self, name, *arguments):
        """The status of a function."""
        return getattr(self.library, f"fmi2{name}")(self.c, *arguments)

    def call(self, name, *arguments):
        """Call a function that has to succeed."""
        status = self.status(name, *arguments)
        assert status == OK, (name, status, self.logged)

    def start(self, start=0.0, **parameters):
        """The calls of an initialisation."""
        self.call("SetupExperiment", 0, c_double(0.0), c_double(start), 0, c_double(0.0))
        self.call("EnterInitializationMode")
        self.set(parameters)
        self.call("ExitInitializationMode")
        self.time = start

    def real(self, act, references, values):
        """The status of fmi2GetReal or fmi2SetReal."""
        n = len(references)
        return self.status(f"{act}Real", (c_uint * n)(*references), c_size_t(n), values)

    def set_status(self, values):
        """The status of setting variables by name."""
        return self.real("Set", list(map(self.at.get, values)), (c_double * len(values))(*values.values()))

    def set(self, values):
        """Set variables by name."""
        assert self.set_status(values) == OK, self.logged

    def get(self, names):
        """The values of variables by name."""
        found = (c_double * len(names))()
        assert self.real("Get", list(map(self.at.get, names)), found) == OK, self.logged
        return list(found)

    def step_status(self, step):
        """The status of a step; the time goes on where it succeeds."""
        status = self.status("DoStep", c_double(self.time), c_double(step), 1)
        self.time += step if status == OK else 0.0
        return status

    def step(self, step=None):
        """A step that has to succeed, by default of a sampling period."""
        assert self.step_status(self.period if step is None else step) == OK, self.logged

    def status_of(self, kind, which):
        """The value of fmi2GetRealStatus or fmi2GetBooleanStatus."""
        value = {"Real": c_double, "Boolean": c_int}[kind]()
        self.call(f"Get{kind}Status", which, byref(value))
        return value.value


def inputs_of(task):
    """The inputs of a loop at each sample of a scenario, by name."""
    references = {f"{REFERENCE}{name}": values for name, values in task.references.items()}
    return references | {"feedforward": task.feedforward, "disturbance": task.disturbance}


def driven(unit, inputs, n):
    """Outputs by name (samples,), each just before its sample, of inputs at `n` samples: fewer where the unit stops."""
    outputs, rows, status = [each for each in unit.at if unit.causality[each] == "output"], [], OK
    for k in range(n):
        rows.append(unit.get(outputs))
        unit.set({name: values[k] for name, values in inputs.items() if name in unit.at})
        status = unit.step_status(unit.period)
        if status != OK:
            break
    if status == OK:
        rows.append(unit.get(outputs))
    return dict(zip(outputs, np.array(rows).T, strict=True))
