"""The rows of section 3: (15)-(20), damping, and gains that vary."""

from __future__ import annotations

from . import energy as e
from .loop import growth_text, pumped_text
from .rows import Claim

ENERGY_CLAIMS = (  # the energy, its rate, the law and what is said to follow from it
    Claim(
        equation="(15)",
        printed=e.V_PRINTED,
        corrected=e.V,
        check=e.is_total_energy,
        evidence="With a1 = a2 = a3 = 1 the energy of hub, arm and payload changes by u theta_t only (SymPy, "
        "integration by parts for every motion). The print leaves the power that flows into the payload: it holds "
        "for m = I_c = 0, as in Table 1. The payload's weight must be a1 for (18).",
    ),
    Claim(
        equation="(16)",
        printed=e.RATE,
        check=e.is_derivative,
        evidence="The time derivative of (15) as printed (SymPy). With (15) mended, (16) and (17) gain "
        "a1 (m w_t w_tt + I_c psi_t psi_tt) at the tip; (V depends on t only: dV/dt).",
    ),
    Claim(
        equation="(17)",
        printed=e.SUBSTITUTED_PRINTED,
        corrected=e.SUBSTITUTED,
        check=e.is_substituted,
        evidence="(16) with the accelerations of (1), (2) and (3) (SymPy); theta does not depend on x. The text "
        'before it, "substituting (1) into (2)", should read (1)-(3) into (16).',
    ),
    Claim(
        equation="(18)",
        printed=e.POWER_FLOW_PRINTED,
        corrected=e.POWER_FLOW,
        check=e.is_power,
        evidence="Integrated by parts with payload and a1, a2, a3 free (SymPy): dV/dt is theta_t (a2 u + (a2 - a1) "
        "M(0)) plus (a3 - a1) times the rate of the strain energy, which has no sign. So a3 = a1 is needed, and "
        "the factor is a2 - a1. The print holds for no other weights than a1 = a2 = a3.",
    ),
    Claim(
        equation="(19)",
        printed=e.CONTROL_LAW_PRINTED,
        corrected=e.CONTROL_LAW,
        check=e.are_proven_gains,
        evidence="dV/dt <= 0 needs a1/a2 = 1 - K2 > 0 (SymPy): K1 > 0 and K2 < 1, negative K2 included; "
        "K2 >= 1 is not covered, and K2 > 1 is unstable at C = 0. The sign is that of the moment E I phi'(0).",
        measured=growth_text,
    ),
    Claim(
        equation="(20)",
        printed=e.DECAY_PRINTED,
        corrected=e.DECAY,
        check=e.is_decay,
        evidence="(19) in the true dV/dt (SymPy). K is not defined before (20). Semidefinite: theta itself is "
        "neither in V nor in (19), so the angle is not regulated, and this alone proves stability of the motion, "
        "not that it dies out.",
    ),
    Claim(
        equation="(18)-(20): damping C > 0",
        printed=e.DAMPED_LAW_PRINTED,
        corrected=e.DAMPED_LAW,
        check=e.is_damped_decay,
        evidence="With E (1 + C d/dt) in (2), (3), (5), dV/dt = -a2 K1 theta_t^2 - a1 C integral(E I phi_xt^2) "
        "needs the moment with its damping part; what a strain gauge gives, E I phi', leaves a term of no sign "
        "(SymPy). The paper's section 3 is for C = 0.",
    ),
    Claim(
        equation="(18)-(20): constant gains, varied by the tuner",
        printed=e.VARIED_DECAY,
        corrected=e.VARIED_DECAY + "; K2_t = 0",
        check=e.is_varied_decay,
        evidence="The weights of the proof follow the gain, a1 = a2 (1 - K2): when K2 varies, dV/dt gains -a2 K2_t "
        "times the energy of arm and payload (SymPy), positive whenever K2 falls. So the proof holds for constant "
        "gains (and for K2 that never falls), while the tuner moves K at every sample.",
        measured=pumped_text,
    ),
)
