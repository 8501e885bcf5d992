"""What an arm's file chooses by name, declared once for every room: what drives the hub, and the theory of its beam."""

from __future__ import annotations

from typing import Literal, get_args

Input = Literal["hub_torque", "motor_voltage", "motor_current", "hub_angle"]
INPUTS: tuple[Input, ...] = get_args(Input)
INPUT_UNITS = {"hub_torque": "N m", "motor_voltage": "V", "motor_current": "A", "hub_angle": "rad"}
Theory = Literal["timoshenko", "shear", "rayleigh", "euler-bernoulli"]  # of the beam
THEORIES: tuple[Theory, ...] = get_args(Theory)
WITH_ROTARY_INERTIA: tuple[Theory, ...] = ("timoshenko", "rayleigh")
WITH_SHEAR: tuple[Theory, ...] = ("timoshenko", "shear")
