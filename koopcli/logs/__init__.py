"""Logs of a car: files and a map in, episodes and checks out."""
