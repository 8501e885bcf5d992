"""tfarm: a rotating flexible Timoshenko arm in the frequency domain, from its exact solution::

    arm = tfarm.load("sasaki2012")            # a preset or a TOML file
    G = tfarm.transfer(arm, "root_moment")    # exact; callable at any complex s
    modes = tfarm.modes(arm, count=10)        # complete
    law = tfarm.HubFeedback(K1=0.3, K2=0.3)   # u = -K1 theta_t - K2 E I phi'(0)
    found = tfarm.margins(arm, law)           # verdict and stability margins
    tfarm.plots.modes(modes)                  # pictures of records: modes, bode, nyquist, ...

The public names and their modules are those of the stub `__init__.pyi`; each is imported at its first use.
"""

import ast
from importlib import import_module
from pathlib import Path

__version__ = "1.1.0"


def _public_names() -> dict[str, tuple[str, str]]:
    """Return module and name there of each public name, from the imports of the stub and the names that it changes."""
    found = {}
    for line in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body:
        match line:
            case ast.ImportFrom(module=str(module), names=names):
                found |= {each.name: (module, each.name) for each in names}
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Name(id=own)):
                found[name] = found.pop(own)
    return found


_PLACES = _public_names()
__all__ = sorted(_PLACES)


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module 'tfarm' has no attribute {name!r}")
    module, own = _PLACES[name]
    is_room = module == "tfarm"
    value = globals()[name] = (
        import_module(f"tfarm.{own}") if is_room else getattr(import_module(module), own)
    )
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
