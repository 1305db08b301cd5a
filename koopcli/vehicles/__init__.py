"""Vehicles and the plants (equations of motion) they are put into."""
