"""Processes of our own, and what they share."""
