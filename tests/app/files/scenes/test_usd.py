"""A USDZ package as a program that knows nothing of ours reads it."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade, UsdValidation

from tests.app.exported import exported
from tests.app.glb_file import GlbFile
from tests.synthetic_run import write_run


def test_points_move_as_the_gltf_s_and_carry_the_picture(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run.rrd")
    path, same = exported(run.path, "usdz", tmp_path), GlbFile(exported(run.path, "glb", tmp_path))
    stage = Usd.Stage.Open(str(path))
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Y", 1.0)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/surface/mesh"))
    codes = mesh.GetPointsAttr().GetTimeSamples()
    assert np.array(codes) / stage.GetTimeCodesPerSecond() == pytest.approx(same.times_s, abs=1e-6)
    for code, time_s in zip(codes, same.times_s, strict=True):
        points = np.array(mesh.GetPointsAttr().Get(code))
        np.testing.assert_allclose(points, same.world(same.vertices(time_s)), atol=1e-5)
        assert np.linalg.norm(mesh.GetNormalsAttr().Get(code), axis=1) == pytest.approx(1.0, abs=1e-5)
    uv = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
    np.testing.assert_allclose(np.column_stack([uv[:, 0], 1 - uv[:, 1]]), same.uv, atol=1e-6)
    material, _ = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()
    assert material.ComputeSurfaceSource()[0].GetIdAttr().Get() == "UsdPreviewSurface"
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert validators
    assert not UsdValidation.ValidationContext(validators).Validate(stage)


def test_colours_instead_of_the_picture(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run.rrd")
    stage = Usd.Stage.Open(str(exported(run.path, "usdz", tmp_path, color="curvature")))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/surface/mesh"))
    colors = np.array(mesh.GetDisplayColorPrimvar().Get())
    assert colors.shape == (len(run.pixels), 3)
    assert np.ptp(colors, axis=0).max() > 0.5
