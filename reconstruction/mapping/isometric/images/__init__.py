"""Smooth images of a sheet: tracks without noise, gross errors and gaps; and its creases, where they are not smooth."""
