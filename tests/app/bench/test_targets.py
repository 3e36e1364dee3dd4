"""Figures beside their targets."""

from app.bench.targets import TARGETS, markdown, rows


def test_tables_say_what_was_missed() -> None:
    ratios = {"scipy_over_ours": 250.0, "ceres_over_ours": None, "iteration_spread": 1.5}
    assert [(value, met) for _, value, _, met in rows(ratios)] == [("250×", True), ("1.5×", False)]
    table = markdown(ratios, "on a machine")
    assert "| 1.5× (missed) | ≤ 1.2× |" in table
    assert "on a machine" in table
    assert len({target.name for target in TARGETS}) == len(TARGETS)
