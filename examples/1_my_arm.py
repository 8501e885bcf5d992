"""My arm in ten lines: its frequencies, and what torque does to the root moment at one of them."""

import tfarm

section = tfarm.Section.rectangle(width=0.06, depth=0.004)  # m; depth in the plane of bending
link = tfarm.Link.isotropic(
    length=0.8, density=7850.0, youngs_modulus=2.1e11, poissons_ratio=0.3, section=section, damping=2e-5
)
payload = tfarm.Payload(mass=0.2, inertia=1e-4)  # kg, kg m^2
arm = tfarm.Arm(link=link, hub=tfarm.Hub(inertia=0.05), payload=payload, name="my-arm")

modes = tfarm.modes(arm, count=4)  # none missing: they are counted before they are looked for
print(modes.natural_frequency)  # rad/s; the first, 0, is the rigid body
print(modes.natural_frequency_hz)

G = tfarm.transfer(arm, "root_moment")  # exact, at any complex s
w = modes.natural_frequency[1]
print(f"|G| at {w:.6g} rad/s: {abs(G(1j * w)):.6g} N m of root moment a N m of torque")
