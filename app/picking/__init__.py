"""Choosing a region by hand: a page on loopback, shown by any browser."""
