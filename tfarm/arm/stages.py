"""What happens in one sample of a loop, stage by stage in this order, declared once: `STAGES`.

    reference, sensors, converters, law, saturation, hold, plant

Kernel, exact solution, tuner, code in C, functional mock-up unit, page and verdicts are consumers of these stages.
Each states in its own file what it does with them (`Consumer`); an arm or a chain with a stage that a consumer does not
state is refused by the name of that stage, so that none is ever left out in silence.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from tfarm.errors import ParameterError


class Stage(NamedTuple):
    """A stage, the keys of an arm's file that it acts by, its equation, its meaning, and whether it is linear.

    `remainder` names the part of it that an answer is without, where that is not all that its key does.
    """

    name: str
    keys: tuple[str, ...]
    equation: str
    meaning: str
    is_linear: bool = True
    remainder: str = ""


ARM_KEYS = (
    "name",
    "assumptions",
    "theory",
    "input",
    "link.length",
    "link.density",
    "link.youngs_modulus",
    "link.shear_modulus",
    "link.poissons_ratio",
    "link.damping",
    "link.section.shape",
    "link.section.width",
    "link.section.depth",
    "link.section.diameter",
    "link.section.outer_diameter",
    "link.section.inner_diameter",
    "link.section.area",
    "link.section.second_moment",
    "link.section.shear_factor",
    "hub.inertia",
    "hub.friction",
    "hub.radius",
    "hub.stiffness",
    "clamp.stiffness",
    "clamp.damping",
    "joint.stiffness",
    "joint.damping",
    "motor.resistance",
    "motor.inductance",
    "motor.torque_constant",
    "motor.back_emf_constant",
    "motor.gear_ratio",
    "motor.rotor_inertia",
    "motor.rotor_friction",
    "motor.gear_efficiency",
    "attachment.x",
    "attachment.mass",
    "attachment.inertia",
    "attachment.stiffness",
    "attachment.rotational_stiffness",
    "gauge.x",
    "gauge.side",
    "payload.mass",
    "payload.inertia",
    "payload.offset",
)

STAGES = (
    Stage(
        "reference",
        ("slew.travel", "slew.rise_time", "slew.reading"),
        "r_k, theta_ref, theta_t_ref, M_ref",
        "feedforward and references of a slew",
    ),
    Stage(
        "anti-alias filter",
        ("sampling.antialias_corner",),
        "y_f' = w (y - y_f)",
        "analog low-pass of gauge and tachometer",
    ),
    Stage(
        "encoder",
        ("converters.encoder_counts",),
        "theta_k = q round(theta/q), q = 2 pi/counts",
        "steps of the hub angle",
        is_linear=False,
    ),
    Stage(
        "hub rate",
        ("converters.hub_rate", "converters.rate_filter"),
        "v_k = a v_{k-1} + (1 - a) (theta_k - theta_{k-1})/T, a = e^{-w T}",
        "filtered difference of the encoder, in place of a tachometer",
    ),
    Stage(
        "amplifier steps",
        ("converters.moment_bits",),
        "M_k = q round(M/q), q = 2 R/2^bits",
        "steps of the strain amplifier",
        is_linear=False,
    ),
    Stage(
        "amplifier range",
        ("converters.moment_range",),
        "M_k = min(max(M_k, -R), R - q)",
        "range of the strain amplifier",
        is_linear=False,
    ),
    Stage(
        "law", (), "u_k = r_k + C x_k + D e_k, x_{k+1} = A x_k + B e_k, e = reference - signal", "controller"
    ),
    Stage(
        "arithmetic",
        ("converters.arithmetic",),
        "A, B, C, D and every product and sum of the law rounded to float32",
        "precision of the controller; linear, as its steps are those of the last digits",
        remainder="rounding of float32 signals",
    ),
    Stage(
        "DAC steps",
        ("converters.torque_bits",),
        "u_k = q round(u_k/q), q = 2 R/2^bits",
        "steps of the output",
        is_linear=False,
    ),
    Stage(
        "DAC range",
        ("converters.torque_range",),
        "u_k = min(max(u_k, -R), R - q)",
        "range of the output",
        is_linear=False,
    ),
    Stage(
        "torque limit",
        ("actuator.torque_limit",),
        "u_k = min(max(u_k, -limit), limit)",
        "limit of the motor",
        is_linear=False,
    ),
    Stage("hold", ("sampling.period",), "u(t) = u_k from t_k + tau to t_{k+1} + tau", "zero-order hold"),
    Stage("delay", ("sampling.delay_samples",), "tau = delay_samples T", "computational delay"),
    Stage("hub damping", ("actuator.hub_damping",), "torque -b theta_t", "analog damping by the actuator"),
    Stage(
        "plant",
        ARM_KEYS,
        "a' = p a + u, y = Re(sum of r a) + ..., for each pole p of the arm",
        "the arm itself",
    ),
    Stage("volts", ("actuator.motor_constant",), "V = u_k/constant", "voltage of the motor, in the record"),
)
STAGE_OF = {key: stage for stage in STAGES for key in stage.keys}


class Consumer(NamedTuple):
    """What a consumer does with the stages, by their names; one that it does not state is refused.

    It has those that are `acts`.  It is without those that are `named`, and its line of certainty names them; of those
    that are `partly` it has a part.  Those that are `none` do not concern it.
    """

    name: str
    acts: tuple[str, ...]
    named: tuple[str, ...] = ()
    partly: tuple[str, ...] = ()
    none: tuple[str, ...] = ()

    def word(self, stage: str) -> str | None:
        """Return what it does with a stage, as the field that names it; None for one that it refuses."""
        words = self._fields[1:]
        return next((word for word in words if stage in getattr(self, word)), None)

    def refuse_others(self, *tables: Mapping[str, Any]) -> None:
        """Raise ParameterError for a key of tables of a file whose stage it does not state, or that no stage has."""
        for key, value in flat_keys(*tables):
            stage = STAGE_OF.get(key)
            if stage is None or self.word(stage.name) is None:
                what = f"the stage {stage.name}" if stage else "this key"
                raise ParameterError(
                    key=key, value=value, remedy=f"{self.name} does not have {what}: leave it out"
                )

    def not_covered(self, *tables: Mapping[str, Any]) -> str:
        """Return the end of its line of certainty: the keys of these tables that it is without."""
        names = []
        for key, _ in flat_keys(*tables):
            stage = STAGE_OF[key]
            if self.word(stage.name) in ("named", "partly"):
                names.append(stage.remainder or key.partition(".")[2])
        return f"; not covered: {', '.join(names)}" if names else ""


def are_linear(*tables: Mapping[str, Any]) -> bool:
    """Return whether every stage by which these tables of a file act is linear."""
    return all(STAGE_OF[key].is_linear for key, _ in flat_keys(*tables))


def flat_keys(*tables: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each key of tables in tables, with its place, and its value."""
    for table in tables:
        for key, value in table.items():
            for each in value if isinstance(value, list) else [value]:
                if isinstance(each, dict):
                    yield from flat_keys(each, place=f"{place}{key}.")
                else:
                    yield f"{place}{key}", each
