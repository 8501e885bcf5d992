"""Studies of uncertain arms: many arms and loops, each by the exact solution, on one machine or a cluster."""
