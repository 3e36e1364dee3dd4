"""Points from a tracker of your own become shapes: own_tracks.py tracks.npy.

The tracks are an array (F, P, 2) px with NaN where a point is not seen, in pictures of 640 × 480. A real program would
feed each frame as it comes; the first shapes arrive when the rest shape is known.
"""

import sys

import numpy as np

import modeshape

tracks = np.load(sys.argv[1])
reconstruction = modeshape.Reconstruction(size=(640, 480))
estimates = []
for points_px in tracks:
    estimates += reconstruction.update(points_px)
estimates += reconstruction.finish()
np.save("shapes.npy", [estimate.shape for estimate in estimates])
off_px = [np.nanmedian(np.linalg.norm(e.points_px - e.projection_px, axis=1)) for e in estimates]
print(f"{len(estimates)} shapes, focal length {reconstruction.focal_px:.0f} px, median error {np.mean(off_px):.2f} px")
