"""The four beam theories by name, declared once for every room."""

from __future__ import annotations

from typing import Literal, get_args

Theory = Literal["timoshenko", "shear", "rayleigh", "euler-bernoulli"]
THEORIES: tuple[Theory, ...] = get_args(Theory)
WITH_ROTARY_INERTIA: tuple[Theory, ...] = ("timoshenko", "rayleigh")
WITH_SHEAR: tuple[Theory, ...] = ("timoshenko", "shear")
