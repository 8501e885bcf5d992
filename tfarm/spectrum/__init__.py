"""Natural frequencies and mode shapes: counted, so that none is missing, then found to the last digit."""
