"""The closed loop: exact poles, loci, margins, and what the Lyapunov argument proves."""
