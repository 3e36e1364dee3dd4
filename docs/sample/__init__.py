"""Draws the pictures of the sample: the printed page and the desk, kept in app/demo."""
