"""Bases, regression, EDMD, predictors and their scores: pure numerics."""
