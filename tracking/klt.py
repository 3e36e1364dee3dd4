"""The point tracker: pyramidal Lucas-Kanade checked by appearance and neighbours, and re-acquisition."""

from dataclasses import replace

import numpy as np

from tracking import Array, Flags, Floats, Image, Indices
from tracking.appearance import Fusion
from tracking.consistency import MIN_SUPPORT, LocalMotion, Surroundings
from tracking.flow import Flow, Grays
from tracking.looks import Looks, pictures_of
from tracking.observation import Observation

BORDER_PX = 4.0  # nearer to the border a point counts as having left
# Correlations with the reference. Measured on kinect_paper at true places (median, worst 2 %), in the fine
# and the half picture: 0.93, 0.84 and 0.96, 0.90; under 8 px of motion blur 0.67, 0.33 and 0.84, 0.67; of other
# places, as behind an occluder, 98 % are below 0.40 and 0.34.
KEEP_SCORE = 0.4  # below in both pictures, a tracked point is given up
CLEAR_SCORE = 0.7  # above in the fine picture, its drift is removed there
BLURRED_SCORE = 0.55  # above in the half picture, it is removed there
RETRIEVE_SCORE = 0.7  # above in one of them, a lost point is taken up again
SURE_PX = 0.5  # a point that the fine picture places so well needs no other word
USUAL_PX = 0.25  # how well it places such points
TAILS = 4.0  # degrees of freedom of how far neighbours miss a point
CORRECT_PX = 2.0  # of the picture it is seen in: larger "drift" is another place that looks alike
RETRIEVE_PX = 8.0  # how far from where it is expected a lost point may be found
REFINE_STEPS = 2
RETRIEVE_STEPS = 3
RESUME_ROUNDS = 3  # of looking for points of which only rough places are known
PREDICTION_WEIGHT = 0.2  # of a predicted neighbour against a seen one


class PointTracker:
    """Follows points of a reference frame from frame to frame.

    Args:
        image_bgr: (H, W, 3) uint8 reference frame; what the points look like is taken from here.
        points_px: (P, 2) the points in it.
    """

    def __init__(self, image_bgr: Image, points_px: Array) -> None:
        self._grays = Grays.of(image_bgr)
        self._reference = points_px.astype(np.float64)
        self._flow = Flow(self._reference)
        self._surroundings = Surroundings(self._reference)
        self._looks = Looks(pictures_of(self._grays), self._reference)
        self._sure = np.zeros(len(points_px), np.bool_)  # surely placed in the last picture
        self._points = self._reference.copy()
        self._affine = np.broadcast_to(np.eye(2), (len(points_px), 2, 2)).copy()
        self._given_up = np.zeros(len(points_px), np.bool_)
        self._counts = np.zeros(2, np.int64)  # of points followed so far, and of those that were alike

    def give_up(self, points: Flags) -> None:
        """Look for these points (P,) no more."""
        self._given_up |= points
        self._points[points] = np.nan

    def track(self, image_bgr: Image, predicted_px: Array | None = None) -> Observation:
        """Find the points in the next frame.

        Args:
            image_bgr: (H, W, 3) uint8, of the reference frame's size.
            predicted_px: (P, 2) where the model expects the points, NaN where it does not know; lost points
                are taken up again near there. None while there is no model: they are where their neighbours went.
        """
        grays = Grays.of(image_bgr)
        pictures = pictures_of(grays)
        points = self._flow.follow(self._grays, grays, self._points)
        motion = self._motion(points, predicted_px)
        points[~motion.consistent] = np.nan
        points, alike = self._refine(pictures, points, motion)
        self._counts += np.isfinite(points[:, 0]).sum(), alike
        points = self._retrieve(pictures, points, self._expected(points, motion, predicted_px), motion)
        self._grays = grays
        seen = self._observation(points, motion)
        return replace(seen, renewed=self._looks.renew(pictures, self._points, self._affine, seen.visible))

    def resume(self, image_bgr: Image, expected_px: Array) -> Observation:
        """Find the points in a frame from their rough places alone, and go on from there.

        Args:
            image_bgr: (H, W, 3) uint8, of the reference frame's size.
            expected_px: (P, 2) where the points are, to some pixels; NaN where that is not known.
        """
        self._grays = Grays.of(image_bgr)
        self._points = np.full_like(self._reference, np.nan)
        self._sure[:] = False
        return self.regain(expected_px)

    def regain(self, expected_px: Array) -> Observation:
        """Find those points that the last frame does not show yet from rough places alone.

        Args:
            expected_px: (P, 2) where the points are, to some pixels; NaN where that is not known.
        """
        pictures = pictures_of(self._grays)
        points = self._points
        for _ in range(RESUME_ROUNDS):  # what is found tells better where the others are
            sought = np.where(np.isfinite(points), points, expected_px + self._miss(points, expected_px))
            motion = self._motion(sought, None)
            expected = np.where(np.isfinite(points), np.nan, sought)
            points = self._retrieve(pictures, points, expected, motion)
        return self._observation(points, motion)

    def _observation(self, points: Array, motion: LocalMotion) -> Observation:
        """What is seen in the picture there is now, and is where the next begins."""
        points[self._given_up | ~_inside(points, self._grays.full.shape)] = np.nan
        self._points, self._affine = points, motion.affine
        followed, alike = self._counts
        return Observation(points.copy(), np.isfinite(points[:, 0]), float(alike / followed) if followed else 1.0)

    def _motion(self, points: Array, predicted_px: Array | None) -> LocalMotion:
        weight = np.isfinite(points[:, 0]).astype(np.float64)
        if predicted_px is not None:
            helped = (weight == 0) & np.isfinite(predicted_px[:, 0])
            points = np.where(helped[:, None], predicted_px, points)
            weight[helped] = PREDICTION_WEIGHT
        return self._surroundings.motion(points, weight, self._affine)

    def _refine(self, pictures: list[Floats], points: Array, motion: LocalMotion) -> tuple[Array, int]:
        """Remove the drift of tracked points; drop those that look different. And how many look as in the reference."""
        points = points.copy()
        seen = np.flatnonzero(np.isfinite(points[:, 0]))
        fine = self._looks.levels[0].align(pictures[0], points[seen], motion.affine[seen], seen, REFINE_STEPS)
        clear = fine.score > CLEAR_SCORE
        sure = clear & (fine.sigma_px < SURE_PX)
        self._correct(points, seen[sure], fine.points_px[sure])
        self._learn(seen[sure])
        alike = int(clear.sum())
        left = np.flatnonzero(~sure)
        if len(left) == 0:
            return points, alike
        clear, before, which = clear[left], fine.score_before[left], seen[left]
        start, affine = points[which], motion.affine[which]
        where = Fusion(start)
        where.add(fine.points_px[left], fine.covariance[left], clear & _near(fine.points_px[left], start))
        # Blur makes fine patches unlike, those of the half picture much less; wrong places are unlike both.
        # Without texture a patch says little, or only across an edge; larger ones and the neighbours say more.
        for level, least in ((1, BLURRED_SCORE), (2, CLEAR_SCORE)):
            scale = 2.0**level
            found = self._looks.levels[level].align(pictures[level], start / scale, affine, which, REFINE_STEPS)
            if level == 1:
                # A point that its neighbours do not check must look more alike.
                keep = np.where(motion.support[which] >= MIN_SUPPORT, KEEP_SCORE, RETRIEVE_SCORE)
                same = clear | (before > keep) | ((found.score_before > keep) & (before > 0.0))
            good = (found.score > least) & _near(found.points_px, start / scale)
            where.add(scale * found.points_px, scale**2 * found.covariance, good)
        # Light and view change slowly: what the reference is no longer like is more like it was when that was last sure of
        # it. It is not learnt from where it was found so: errors do not add up. What is clear is left alone: the errors of
        # compression are those of the pictures just before, too.
        unlike = np.flatnonzero(~clear)
        found = self._looks.recent.align(pictures[0], start[unlike], affine[unlike], which[unlike], REFINE_STEPS)
        like = found.score > CLEAR_SCORE
        same[unlike] |= like
        good = like & _near(found.points_px, start[unlike])
        where.add(found.points_px, found.covariance + USUAL_PX**2 * np.eye(2), good, unlike)
        # What the surface does between its points has heavy tails, as Student's t has them.
        away = ((motion.fitted_px[which] - start) ** 2).sum(axis=1)
        usual = ((TAILS * motion.scale_px**2 + away) / (TAILS + 2.0))[:, None, None] * np.eye(2)
        where.add(motion.fitted_px[which], usual, motion.support[which] >= MIN_SUPPORT)
        points[which] = np.where(same[:, None], where.points_px, np.nan)
        return points, alike

    def _learn(self, sure: Indices) -> None:
        """Take what points looked like in the last picture that were sure there, and are so no more; `sure` (n,) are."""
        before = self._sure & np.isfinite(self._points[:, 0])
        self._sure = np.zeros(len(before), np.bool_)
        self._sure[sure] = True
        new = np.flatnonzero(before & ~self._sure)
        if len(new):
            self._looks.recent.learn(self._grays.full.astype(np.float32), self._points[new], self._affine[new], new)

    def _correct(self, points: Array, which: Indices, aligned: Array) -> None:
        """Move points in place to their aligned positions where these are near; NaN stays."""
        near = _near(aligned, points[which])
        points[which[near]] = aligned[near]

    def _expected(self, points: Array, motion: LocalMotion, predicted_px: Array | None) -> Array:
        """Where to look for points that are not tracked now: (P, 2), NaN for nowhere.

        Points lost before are looked for where the model predicts, moved by what the prediction misses around them;
        points seen in the last frame, and all while there is no model, where their neighbours went.
        """
        predicted = np.full_like(points, np.nan) if predicted_px is None else predicted_px
        before = np.isfinite(predicted).all(axis=1) & ~(np.isfinite(self._points[:, 0]) & (motion.support >= MIN_SUPPORT))
        beside = ~before & (motion.support >= MIN_SUPPORT)
        expected = np.full_like(points, np.nan)
        expected[beside] = motion.fitted_px[beside]
        expected[before] = (predicted + self._miss(points, predicted))[before]
        expected[np.isfinite(points[:, 0])] = np.nan
        return expected

    def _miss(self, points: Array, predicted_px: Array) -> Array:
        """How far the prediction misses around each point: (P, 2), from the neighbours that are seen."""
        miss = points - predicted_px
        known = np.isfinite(miss[:, 0])
        if not known.any():
            return np.zeros_like(points)
        neighbours = self._surroundings.neighbours
        seen = known[neighbours]
        local = np.where(seen[:, :, None], miss[neighbours], 0.0).sum(axis=1)
        count = seen.sum(axis=1)[:, None]
        return np.where(count > 0, local / np.maximum(count, 1), np.median(miss[known], axis=0))

    def _retrieve(self, pictures: list[Floats], points: Array, expected: Array, motion: LocalMotion) -> Array:
        """Re-acquire points near where they are expected, if they look alike and move like their neighbours."""
        sought = np.flatnonzero(_inside(expected, pictures[0].shape))
        if len(sought) == 0:
            return points
        affine = motion.affine[sought]
        rough = self._looks.levels[1].align(pictures[1], expected[sought] / 2.0, affine, sought, RETRIEVE_STEPS)
        found = self._looks.levels[0].align(pictures[0], 2.0 * rough.points_px, affine, sought, RETRIEVE_STEPS)
        near = np.linalg.norm(found.points_px - expected[sought], axis=1) < RETRIEVE_PX
        good = near & (np.maximum(found.score, rough.score) > RETRIEVE_SCORE)
        points = points.copy()
        sought = sought[good]
        points[sought] = found.points_px[good]
        points[sought[~self._surroundings.agree(points, sought, motion)]] = np.nan
        return points


def _near(points: Array, others: Array) -> Flags:
    """Which points (n, 2) are near others (n, 2), in pixels of the picture that they were sought in."""
    return np.asarray(np.linalg.norm(points - others, axis=1) < CORRECT_PX)


def _inside(points: Array, shape: tuple[int, ...]) -> Flags:
    """Which points (n, 2) are in the picture, away from its border; NaN is not."""
    limit = np.array([shape[1], shape[0]]) - 1.0 - BORDER_PX
    inside = (points >= BORDER_PX) & (points <= limit)
    return inside[:, 0] & inside[:, 1]
