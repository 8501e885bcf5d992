"""Controller design for the exact arm: best coefficients of a law, for its sampled or its continuous-time loop."""
