"""Reduced models: where the exact arm is left, by functions whose names say so, with the error of each printed."""
