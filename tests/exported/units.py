"""A functional mock-up unit driven by ctypes: what an importing tool does, without one."""

import ctypes
import zipfile
from ctypes import CFUNCTYPE, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from xml.etree import ElementTree

LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
OK, WARNING, DISCARD, ERROR = range(4)
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3


class Callbacks(Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [(name, c_void_p) for name in ("logger", "allocate", "free", "step_finished", "environment")]


class Unit:
    """An instance of a unit, unpacked into a folder; every status other than 0 raises, with what was logged."""

    def __init__(self, file, folder, *, guid=None):
        with zipfile.ZipFile(file) as archive:
            archive.extractall(folder)
        self.xml = ElementTree.parse(Path(folder) / "modelDescription.xml").getroot()
        slave = self.xml.find("CoSimulation")
        (binary,) = Path(folder).glob(f"binaries/*/{slave.get('modelIdentifier')}.*")
        self.library = ctypes.CDLL(str(binary))
        self.at = {each.get("name"): int(each.get("valueReference")) for each in self.xml.iter("ScalarVariable")}
        self.period = float(self.xml.find("DefaultExperiment").get("stepSize"))
        self.logged = []
        self._logger = LOGGER(lambda *arguments: self.logged.append(arguments[-1].decode()))
        self._callbacks = Callbacks(ctypes.cast(self._logger, c_void_p))
        self.library.fmi2Instantiate.restype = c_void_p
        guid = self.xml.get("guid") if guid is None else guid
        self.c = c_void_p(self.library.fmi2Instantiate(b"unit", 1, guid.encode(), b"", byref(self._callbacks), 0, 0))

    def status(self, name, *arguments):
        """The status of a function."""
        return getattr(self.library, f"fmi2{name}")(self.c, *arguments)

    def call(self, name, *arguments):
        """Call a function that has to succeed."""
        status = self.status(name, *arguments)
        assert status == OK, (name, status, self.logged)

    def start(self, start=0.0, **parameters):
        """Through the initialisation."""
        self.call("SetupExperiment", 0, c_double(0.0), c_double(start), 0, c_double(0.0))
        self.call("EnterInitializationMode")
        self.set(parameters)
        self.call("ExitInitializationMode")
        self.time = start

    def set(self, values):
        """Set variables by name."""
        n = len(values)
        self.call("SetReal", (c_uint * n)(*map(self.at.get, values)), c_size_t(n), (c_double * n)(*values.values()))

    def get(self, names):
        """The values of variables by name."""
        n, found = len(names), (c_double * len(names))()
        self.call("GetReal", (c_uint * n)(*map(self.at.get, names)), c_size_t(n), found)
        return list(found)

    def step_status(self, step):
        """The status of a step; the time goes on where it succeeds."""
        status = self.status("DoStep", c_double(self.time), c_double(step), 1)
        self.time += step if status == OK else 0.0
        return status

    def step(self, step=None):
        """A step that has to succeed, by default of a sampling period."""
        status = self.step_status(self.period if step is None else step)
        assert status == OK, self.logged

    def close(self):
        """Free the instance."""
        self.library.fmi2FreeInstance.restype = None
        self.library.fmi2FreeInstance(self.c)
