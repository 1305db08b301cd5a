"""Figures: plain records in, a matplotlib figure out."""
