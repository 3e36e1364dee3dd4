"""A recording becomes arrays: recording_to_numpy.py recordings/paper.rrd prints the bend of the sheet over time."""

import sys

import numpy as np

import modeshape

recording = modeshape.open_recording(sys.argv[1])
shapes = recording.shapes - recording.shapes.mean(axis=1, keepdims=True)  # (F, P, 3), NaN in frames without a shape
for time_s, shape in zip(recording.times_s, shapes, strict=True):
    if not np.isnan(shape).any():
        extent, thickness = np.linalg.svd(shape, compute_uv=False)[[0, 2]]
        print(f"{time_s:6.2f} s   out of its plane by {thickness / extent:.1%} of its extent")
