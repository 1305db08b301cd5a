"""Sampling designs and batched integration."""
