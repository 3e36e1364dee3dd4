"""Figures drawn with matplotlib, which takes its time to load: only where one is asked for."""
