import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction import ReconstructionError
from reconstruction.camera import Camera
from reconstruction.mapping.selection import decide, select, spread_edges, spread_points
from reconstruction.mapping.solid.rivals import Misfit, Rigid, rigid_by
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, SEEDS, flat, relief, rolled, seen, turns

K, P = 16, 100


def keyframes(rng, shapes, camera=PERSPECTIVE, degrees=25.0, noise=0.2):
    """Points (K, 2, p) px of shapes (K, 3, p), all visible, and the true shapes in camera axes."""
    W, placed = seen(shapes, turns(K, degrees), camera)
    return W + noise * rng.normal(size=W.shape), np.ones((K, P), bool), placed


def surface_of(placed, rng, off=0.3):
    """What a good maker of sheets would find, of one that does not stretch; seen `off` px beside it."""
    through = placed + off * rng.normal(size=placed.shape)
    return lambda halves: ([(placed[half], through[half], through[half]) for half in halves], 0.0, 0)


@given(SEEDS)
@settings(max_examples=3, deadline=None)
def test_a_solid_is_told(rng):
    W, visible, placed = keyframes(rng, np.repeat(relief(rng, P)[None], K, axis=0))
    evidence = select(W, visible, PERSPECTIVE, surface_of(placed, rng, off=1.0))
    assert evidence.kind == "solid"
    assert evidence.sureness > 1.2
    assert evidence.solid.edges_px == pytest.approx(0.2, rel=0.3)
    assert "solid" in evidence.note


@given(SEEDS)
@settings(max_examples=3, deadline=None)
def test_a_keyframe_without_the_points_compared_tells_nothing(rng):
    W, visible, _ = keyframes(rng, np.repeat(relief(rng, P)[None], K, axis=0))
    made, tested, edges = (W[::2], visible[::2]), (W[1::2], visible[1::2]), spread_edges(W, visible, np.arange(P))
    blank = tested[1].copy()
    blank[3] = False
    told, less = (rigid_by(made, (tested[0], seen), PERSPECTIVE, edges) for seen in (tested[1], blank))
    assert less.solid.whole_px == pytest.approx(told.solid.whole_px, rel=0.2)
    assert less.flat.whole_px == pytest.approx(told.flat.whole_px, rel=0.2)
    assert less.size_px == pytest.approx(told.size_px, rel=0.1)


@given(SEEDS)
@settings(max_examples=3, deadline=None)
def test_a_card_that_turns_is_flat(rng):
    W, visible, placed = keyframes(rng, np.repeat(flat(rng, P)[None], K, axis=0))
    assert select(W, visible, PERSPECTIVE, surface_of(placed, rng)).kind == "flat"


@given(SEEDS)
@settings(max_examples=3, deadline=None)
def test_a_sheet_that_rolls_is_a_sheet(rng):
    sheet = flat(rng, P)
    shapes = np.stack([rolled(sheet, 0.008 * np.sin(k)) for k in range(K)])
    W, visible, placed = keyframes(rng, shapes)
    evidence = select(W, visible, PERSPECTIVE, surface_of(placed, rng))
    assert evidence.kind == "sheet"
    assert evidence.length_change < 0.03  # of edges some 20 px long, with 0.3 px of noise
    assert select(W, visible, PERSPECTIVE).kind != "sheet"  # nothing makes one


def test_evidence_does_not_depend_on_units():
    rng = np.random.default_rng(0)
    W, visible, _ = keyframes(rng, np.repeat(relief(rng, P)[None], K, axis=0))
    one = select(W, visible, PERSPECTIVE)
    other = select(W * 1e-3, visible, Camera(PERSPECTIVE.focal_px * 1e-3, PERSPECTIVE.center_px * 1e-3))
    assert other.kind == one.kind
    assert other.sureness == pytest.approx(one.sureness, rel=1e-4)
    assert other.solid.whole_px == pytest.approx(1e-3 * one.solid.whole_px, rel=1e-4)


def test_orthographic_keyframes_are_told_without_a_sheet():
    rng = np.random.default_rng(0)
    W, visible, _ = keyframes(rng, np.repeat(relief(rng, P)[None], K, axis=0), ORTHOGRAPHIC)
    evidence = select(W, visible, ORTHOGRAPHIC)
    assert evidence.kind == "solid"
    assert np.isnan(evidence.sheet.edges_px)


@given(st.floats(0.01, 100))
def test_what_leaves_least_wins_and_freedom_costs(unit):
    def decided(flat, solid, sheet, relief=0.4, stretch=0.0, turn=30.0):
        made = [Misfit(unit * edges, unit * whole) for edges, whole in (flat, solid)]
        return decide(Rigid(*made, turn, relief), Misfit(unit * sheet, np.nan), stretch)[0]

    assert decided((1, 1), (1, 0.95), 0.95) == "flat"
    assert decided((1, 2), (0.5, 1), 0.48) == "solid"
    assert decided((1, 2), (0.5, 1), 0.48, relief=0.01) != "solid"
    assert decided((1, 2), (0.5, 1), 0.2) == "sheet"
    assert decided((1, 2), (0.5, 1), np.nan) == "solid"
    assert decided((2, 4), (0.7, 2), 0.4, stretch=0.015) == "solid"  # a face that talks
    assert decided((1, 2), (0.95, 1.9), 0.4, stretch=0.015) == "sheet"  # cloth
    assert decided((15, 60), (4, 8), 1.0, stretch=0.025) == "sheet"  # a flag in the wind
    assert decided((15, 60), (4, 8), 1.0, stretch=0.025, turn=60.0) == "sheet"
    assert decided((5, 10), (1.5, 3), 0.65, stretch=0.025) == "sheet"  # one whose folds are cut off
    assert decided((5, 10), (1.5, 3), 0.65, stretch=0.025, turn=60.0) == "solid"  # a jaw
    assert decided((1, 2), (0.9, 1.3), 0.65, stretch=0.025, turn=8.0) == "solid"  # a face that talks and hardly turns
    assert decided((0.5, 0.8), (0.4, 0.6), 0.4, turn=5.0) == "sheet"  # a curtain that moves a little
    assert decided((0.5, 0.8), (0.4, 0.6), 0.4, turn=30.0) == "solid"
    assert decided((0.4, 0.7), (0.3, 0.28), 0.34, turn=5.0) == "solid"  # a can that hardly turns


def test_what_leaves_a_tenth_of_its_size_is_no_plane():
    def decided(share, relief):
        rigid = Rigid(Misfit(10, 12.7), Misfit(8, 11.6), 160.0, relief, size_px=12.7 / share)
        return decide(rigid, Misfit(np.nan, np.nan), 0.0)[0]

    assert decided(0.12, 0.2) == "solid"  # people, whom no solid of one shape explains either
    assert decided(0.075, 0.2) == "flat"  # a card with much noise
    assert decided(0.12, 0.03) == "flat"


def test_frames_that_can_be_told_lengths_show_a_sheet():
    def decided(solid, told_px, stretch):
        return decide(Rigid(Misfit(0.72, 1.47), solid, 28.0, 0.3), Misfit(0.43, np.nan), stretch, told_px)[0]

    assert decided(Misfit(0.49, 0.98), 0.09, 0.003) == "sheet"  # paper, whose halves by themselves find other lengths
    assert decided(Misfit(0.49, 0.98), np.nan, 0.003) == "solid"
    assert decided(Misfit(0.49, 0.98), 0.2, 0.018) == "solid"  # a face: where nothing lasts, depths always do
    assert decided(Misfit(0.20, 0.20), 0.2, 0.003) == "solid"  # a box, explained up to its noise


def test_a_box_is_no_sheet_with_a_crease_but_a_book_is():
    def decided(solid_px, sheet_px, told_px, creases):
        rigid = Rigid(Misfit(2.86, 4), Misfit(solid_px, solid_px), 40.0, 0.3)
        return decide(rigid, Misfit(sheet_px, np.nan), 0.0, told_px, creases)[0]

    assert decided(0.21, 0.16, 0.14, 1) == "solid"
    assert decided(0.21, 0.16, 0.14, 0) == "sheet"
    assert decided(0.5, 0.2, 0.16, 1) == "sheet"


def test_a_kind_that_only_the_freedom_of_another_decides_is_in_doubt():
    rigid = Rigid(Misfit(2, 4), Misfit(0.6, 2), 30.0, 0.4)
    kind, sureness = decide(rigid, Misfit(0.45, np.nan), stretch=0.01)
    assert kind == "solid"
    assert sureness < 1


def test_edges_join_neighbours_seen_often():
    rng = np.random.default_rng(0)
    W, visible, _ = keyframes(rng, np.repeat(relief(rng, P)[None], K, axis=0))
    visible[2:, :10] = False
    edges = spread_edges(W, visible, spread_points(W, visible))
    assert (edges[:, 0] < edges[:, 1]).all()
    assert edges.min() >= 10


def test_too_few_keyframes_say_so():
    rng = np.random.default_rng(0)
    W, visible, _ = keyframes(rng, np.repeat(relief(rng, P)[None], K, axis=0))
    with pytest.raises(ReconstructionError, match="6 keyframes"):
        select(W[:5], visible[:5], PERSPECTIVE)
