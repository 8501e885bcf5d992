"""Measured data against the exact arm: what was measured, and the parameters that explain it."""
