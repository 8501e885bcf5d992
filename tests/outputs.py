"""The outputs of the oracles of the single arm: those of the closed form that had a name before rigs."""

from tfarm.exact.outputs import OUTPUTS

OF_ONE_LINK = {  # the rotation of the tip has tests of its own (tests/response/test_outputs.py)
    name: each for name, each in OUTPUTS.items() if each.is_in_appendix and name != "tip_rotation"
}
