"""Eigenfunctions built from trajectories: rates, values on a boundary, tables, lookups (docs/equations.md 7)."""
