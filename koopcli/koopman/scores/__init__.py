"""How good a predictor is: errors, baselines, evaluations."""
