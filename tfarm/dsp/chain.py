"""The chain of sampling, converters and actuator is in `tfarm.arm.chain`; this is its module of version 1.0."""

from tfarm.moved import moved

NAMES = ("Actuator", "Chain", "Converters", "Sampling", "Slew", "chain_of_tables", "file_text", "load_chain")
__getattr__ = moved(__name__, dict.fromkeys(NAMES, "tfarm.arm.chain"))
