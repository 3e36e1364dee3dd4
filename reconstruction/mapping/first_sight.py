"""A first model by a few keyframes, where the first frames hold no rigid shape: a sheet that bends, or a solid."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.mapping.first.bootstrap import first_map
from reconstruction.mapping.isometric.adjustment import KEPT, mirrored, smooth_sheet
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.map import Map
from reconstruction.mapping.maps import sheet_map
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.settings import Settings

LESS_THAN_A_PLANE = 2.0  # times: shapes of solids that leave more over are 9 to 46 % off, of others 2 to 12
BEYOND_A_SHEET = 0.13  # of what a plane leaves over, that it may leave beyond a sheet: solids up to 0.1, pages from 0.16 on


def first_sight(W: Array, visible: Mask, camera: Camera, settings: Settings) -> Map | None:
    """What keyframes W (K, 2, p) px with visibility (K, p) show, in a fraction of a map's time; None if neither is plain.

    A sheet has no creases, and foresees no frames, which takes long. Its rest shape is that of the first keyframe, so that
    frames from there on begin on the right side of its bends.

    Args:
        W: NaN where not visible.
        visible: (K, p).
        camera: its focal length is taken as it is.
        settings: what it may be.
    """
    sheet = None if settings.kind == "solid" else plain_sheet(W, visible, camera)
    if found := plain_solid(W, visible, camera, sheet):
        return replace(first_map(found, camera, settings), seen=visible)
    if sheet is None:
        return None
    with suppress(ReconstructionError):
        made = sheet_map(W, visible, camera, sheet, None, estimate_focal=False, at=0, last=False)
        return replace(first_map(made.rest, camera, settings), modes=made.modes, seen=visible)
    return None


def plain_sheet(W: Array, visible: Mask, camera: Camera) -> IsometricSheet | None:
    """The sheet that keeps its lengths, if there is one; not from so far away that any might."""
    with suppress(ReconstructionError, np.linalg.LinAlgError):
        smooth = smooth_sheet(W, visible, camera)
        found = smooth if smooth.strain_beyond_noise < KEPT else mirrored(smooth)
        return None if smooth.far else found
    return None


def plain_solid(W: Array, visible: Mask, camera: Camera, sheet: IsometricSheet | None) -> RestShape | None:
    """The solid that leaves far less over than a plane, and hardly more than a sheet."""
    with suppress(ReconstructionError, np.linalg.LinAlgError):
        solid = bundle_adjust(W, visible, camera, refine_focal=False)
        left_px = float(np.nanmedian(solid.residual_px))
        plane = bundle_adjust(W, visible, camera, refine_focal=False, flat=True)
        by_plane_px = float(np.nanmedian(plane.residual_px))
        by_sheet_px = float(np.nanmedian(np.linalg.norm(W - sheet.warps.images(), axis=1))) if sheet else np.inf
        if left_px < by_plane_px / LESS_THAN_A_PLANE and left_px < np.hypot(by_sheet_px, BEYOND_A_SHEET * by_plane_px):
            return RestShape("rigid", solid.motion, solid.note)
    return None
