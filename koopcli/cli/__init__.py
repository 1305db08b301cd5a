"""The command line: options to settings, one call of a stage, one name printed."""
