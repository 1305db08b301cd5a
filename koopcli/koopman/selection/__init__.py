"""Which of a few predictors of a measured log is worth having, and an honest verdict: pure numerics."""
