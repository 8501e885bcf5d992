"""The vector of an arm that the compiled functions read (`Coefficients.kernel`): what stands where.

a, b, g as two doubles each (see `coefficients`), sigma and C; then of payload mass, payload inertia and hub what rests,
what has inertia and what takes the force (see `EndCondition`); and by what the torque of the free response is divided.
"""

A, A_LOW, B, B_LOW, G, G_LOW, SIGMA, DAMPING = range(8)
TIP_MASS, MASS_FORCE, TIP_INERTIA, TURN_FORCE = 8, 10, 11, 13  # rest + inertia s^2 begins at the first and the third
HUB_REST, HUB_INERTIA, HUB_FORCE, TORQUE_DIVISOR = range(14, 18)
