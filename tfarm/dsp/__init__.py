"""The sampled loop: hold, delay, converters, simulation."""
