"""Line charts."""

import cv2
import numpy as np

from app.reproduce.chart import Panel, Series, charts


def test_charts_have_gaps_bands_and_levels() -> None:
    series = [
        Series("seeds", [1, 2, 3], [[1.0, 2.0], [None, 2.0], [2.0, 3.0]]),
        Series("one", [1, 2, 3], [1.0, None, 2.0], 1),
    ]
    panels = [
        Panel("p", "x", "y", series, levels=(("level", 1.5),), points=(("point", 2, 1.0),)),
        Panel("q", "x", "y", series, logarithmic=True),
    ]
    image = cv2.imdecode(np.frombuffer(charts(panels), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape[1] > 2.5 * image.shape[0]
    assert (np.ptp(image.astype(int), axis=2) > 60).mean() > 0.002
