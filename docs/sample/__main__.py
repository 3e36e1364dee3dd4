"""Draws app/demo/page.png and desk.png again: `python -m docs.sample`; with OpenCV 5, since 4 has other fonts."""

import cv2

from app.demo.camera import DESK, PAGE, SIZE
from docs.sample.desk import desk
from docs.sample.page import printed_page

SMALL = (cv2.IMWRITE_PNG_COMPRESSION, 9)

for path, picture in ((PAGE, printed_page()), (DESK, desk(SIZE))):
    cv2.imwrite(str(path), picture, SMALL)
