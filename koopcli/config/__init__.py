"""Settings of the stages, experiment files, and where the shipped data lie."""
