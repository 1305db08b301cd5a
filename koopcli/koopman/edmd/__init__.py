"""Extended dynamic mode decomposition: passes over data, sums, regression (docs/equations.md 4)."""
