"""A moving mesh as a USDZ package: points and normals of every frame, and the picture on it.

Axes and unit are those of the glTF file: y up, right-handed, metres; the rest shape is 1 m long unless a length is known,
and the first shape's centre is the origin. Time code 0 is the first frame.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt

from app.arrays import Array, Floats
from app.files.scenes.gltf import MovingMesh, ascending, normals, unit_m
from app.files.video_out import usual_fps
from reconstruction.camera import rotation_from_quaternion

UPRIGHT = np.array([1.0, -1.0, -1.0])  # half a turn about x, from the camera's axes


def write_usdz(moving: MovingMesh, path: Path, name: str = "surface") -> None:
    """Write the package.

    Raises:
        OSError: the disk is full.
    """
    moving = ascending(moving)
    with TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        cv2.imwrite(str(folder / "texture.png"), moving.texture_bgr)
        stage = Usd.Stage.CreateNew(str(folder / "surface.usdc"))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        root = UsdGeom.Xform.Define(stage, "/surface")
        root.GetPrim().SetDisplayName(name)
        stage.SetDefaultPrim(root.GetPrim())
        mesh = add_mesh(stage, moving)
        if moving.colors is None:
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(textured(stage))
        stage.Save()
        if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(folder / "surface.usdc")), str(path)):
            raise OSError(None, "the package could not be made", str(path))


def add_mesh(stage: Usd.Stage, moving: MovingMesh) -> UsdGeom.Mesh:
    """The mesh, with its points in every frame."""
    fps = usual_fps(moving.times_s)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(float(moving.times_s[-1]) * fps)
    mesh = UsdGeom.Mesh.Define(stage, "/surface/mesh")
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(moving.faces)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(moving.faces.astype(np.int32).ravel()))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    of_vertices = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar
    uv = np.column_stack([moving.uv[:, 0], 1 - moving.uv[:, 1]])  # from the bottom left corner
    st = of_vertices("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(uv.astype(np.float32)))
    if moving.colors is not None:
        mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(vectors(moving.colors))
    points, directions, extent = mesh.CreatePointsAttr(), mesh.CreateNormalsAttr(), mesh.CreateExtentAttr()
    for time_s, vertices in zip(moving.times_s.tolist(), in_world(moving), strict=True):
        code = time_s * fps
        points.Set(vectors(vertices), code)
        directions.Set(vectors(normals(vertices, moving.faces)), code)
        extent.Set(vectors(np.stack([vertices.min(axis=0), vertices.max(axis=0)])), code)
    return mesh


def in_world(moving: MovingMesh) -> Array:
    """Vertices (F, p, 3) in metres, y up."""
    R = np.stack([rotation_from_quaternion(q) for q in moving.quaternion])
    rest = np.stack([moving.basis.deform(Lambda) for Lambda in moving.Lambda])
    shapes = (moving.scale[:, None, None] * R @ rest).transpose(0, 2, 1) + moving.origin[:, None]
    return np.asarray(unit_m(moving) * (shapes - shapes[0].mean(axis=0)) * UPRIGHT)


def vectors(values: Array | Floats) -> Vt.Vec3fArray:
    """Rows (n, 3)."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def textured(stage: Usd.Stage) -> UsdShade.Material:
    """A rough material with the picture."""
    material = UsdShade.Material.Define(stage, "/surface/material")
    shader, picture, place = (
        UsdShade.Shader.Define(stage, f"/surface/material/{part}") for part in ("lit", "picture", "st")
    )
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    place.CreateIdAttr("UsdPrimvarReader_float2")
    place.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    picture.CreateIdAttr("UsdUVTexture")
    picture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("texture.png")
    picture.CreateInput("fallback", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(0.7, 0.7, 0.7, 1.0))
    for side in ("wrapS", "wrapT"):
        picture.CreateInput(side, Sdf.ValueTypeNames.Token).Set("clamp")
    place_out = place.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    picture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(place_out)
    picture_out = picture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(picture_out)
    material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    return material
