"""GLB files: valid, and moving as the shapes do."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.files.scenes.gltf import MovingMesh, glb, normals
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modes import modal_basis
from reconstruction.camera import rotation_from_quaternion
from tests.app.glb_file import GlbFile, issues

FRAMES, MODES = 7, 5


@pytest.fixture
def moving() -> MovingMesh:
    rng = np.random.default_rng(3)
    points = rng.uniform(-100, 100, (60, 2)) * (1.0, 0.6)
    mesh = triangulate(points)
    rest = np.column_stack([points, 10 * np.sin(points[:, 0] / 40)]).T
    quaternion = np.array([1.0, 0.1, -0.2, 0.05]) + 0.05 * rng.normal(size=(FRAMES, 4))
    return MovingMesh(
        basis=modal_basis(rest, mesh, MODES),
        faces=mesh.faces,
        uv=(points + 100) / 200,
        texture_bgr=np.full((40, 60, 3), (20, 90, 200), np.uint8),
        times_s=np.array([3.0, 3.04, 3.1, 3.1333, 3.2, 3.25, 3.4]),
        quaternion=quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        origin=np.array([4.0, -7.0, 650.0]) + 5 * rng.normal(size=(FRAMES, 3)),
        scale=np.ones(FRAMES),
        Lambda=40 * rng.normal(size=(FRAMES, 3, MODES)),
        field_of_view=(0.7, 4 / 3),
    )


def written(tmp_path: Path, moving: MovingMesh) -> GlbFile:
    path = tmp_path / "moving.glb"
    path.write_bytes(glb(moving))
    return GlbFile(path)


def shapes(moving: MovingMesh) -> np.ndarray:
    R = rotation_from_quaternion(moving.quaternion)
    turned = R @ moving.basis.deform(moving.Lambda)
    return (moving.scale[:, None, None] * turned + moving.origin[:, :, None]).transpose(0, 2, 1)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b - b.mean(axis=0)))


def orthographic(moving: MovingMesh) -> MovingMesh:
    return replace(moving, scale=np.linspace(0.8, 1.3, FRAMES), field_of_view=None)


def coloured(moving: MovingMesh) -> MovingMesh:
    return replace(moving, colors=np.abs(moving.uv[:, [0, 1, 1]]).clip(0, 1))


def bending(moving: MovingMesh) -> MovingMesh:
    return replace(moving, Lambda=moving.Lambda * np.array([0.0, 0.0, 1.0])[:, None])


def rigid(moving: MovingMesh) -> MovingMesh:
    return replace(moving, Lambda=np.zeros_like(moving.Lambda))


def still(moving: MovingMesh) -> MovingMesh:
    picked = {name: getattr(moving, name)[:1] for name in ("times_s", "quaternion", "origin", "scale", "Lambda")}
    return replace(moving, **picked)


@pytest.mark.parametrize("variant", [lambda moving: moving, orthographic, bending, rigid])
def test_vertices_are_the_shapes(tmp_path, moving, variant):
    moving = variant(moving)
    file = written(tmp_path, moving)
    for time_s, shape in zip(moving.times_s, shapes(moving), strict=True):
        assert relative(file.vertices(time_s - moving.times_s[0]), shape) < 1e-5


def test_between_two_frames_pose_and_weights_are_interpolated(tmp_path, moving):
    file = written(tmp_path, moving)
    before, after = shapes(moving)[2:4]
    halfway = (moving.times_s[2] + moving.times_s[3]) / 2 - moving.times_s[0]
    assert relative(file.vertices(halfway), (before + after) / 2) < 0.02
    assert relative(before, after) > 0.05


@pytest.mark.parametrize("variant", [lambda moving: moving, orthographic, bending, rigid, still, coloured])
def test_validator_finds_nothing(tmp_path, moving, variant):
    path = tmp_path / "moving.glb"
    path.write_bytes(glb(variant(moving)))
    assert issues(path) == []


def test_validator_would_find_something(tmp_path, moving):
    path = tmp_path / "moving.glb"
    content = glb(moving)
    path.write_bytes(content.replace(b'"VEC3"', b'"VEC4"', 1))
    assert issues(path) != []


def test_many_vertices_take_long_indices(tmp_path, moving):
    copies = 1100
    basis = moving.basis
    big = replace(
        moving,
        basis=replace(basis, rest=np.tile(basis.rest, copies), Upsilon=np.tile(basis.Upsilon, copies)),
        faces=moving.faces + 60 * (copies - 1),
        uv=np.tile(moving.uv, (copies, 1)),
        Lambda=moving.Lambda * np.array([1.0, 0, 0, 0, 0]),
    )
    file = written(tmp_path, big)
    assert file.faces.max() == 60 * copies - 1


def test_normals_follow_the_bends(tmp_path, moving):
    file = written(tmp_path, moving)
    assert not file.gltf.extensionsUsed
    assert not file.gltf.materials[0].extensions
    rest = file.accessor(file.primitive.attributes.NORMAL)
    assert np.linalg.norm(rest, axis=1) == pytest.approx(1.0, abs=1e-5)
    for weight in (0.3, -0.3):
        target = file.primitive.targets[0]
        bent = normals(moving.basis.rest.T + weight * file.accessor(target["POSITION"]), moving.faces)
        told = rest + weight * file.accessor(target["NORMAL"])
        told /= np.linalg.norm(told, axis=1, keepdims=True)
        assert np.median((bent * told).sum(axis=1)) > 0.98


def test_only_free_entries_have_targets(tmp_path, moving):
    file = written(tmp_path, bending(moving))
    assert file.mesh.extras["targetNames"] == [f"tau {k}" for k in range(1, MODES + 1)]
    assert file.mesh.extras["unitsPx"] == pytest.approx(np.abs(moving.Lambda[:, 2]).max(axis=0))
    assert len(file.primitive.targets) == MODES
    assert written(tmp_path, rigid(moving)).primitive.targets in (None, [])


def test_weights_stay_where_editors_accept_them(tmp_path, moving):
    file = written(tmp_path, moving)
    weights = file.accessor(file.channels["weights"].output).reshape(FRAMES, -1)
    assert np.abs(weights).max(axis=0) == pytest.approx(1.0)


def test_world_is_upright_one_metre_long_and_central(tmp_path, moving):
    file = written(tmp_path, moving)
    camera = shapes(moving)[0]
    world = file.world(file.vertices(0.0))
    assert world.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-5)
    upwards, seen_down = world[:, 1], camera[:, 1]
    assert np.corrcoef(upwards, -seen_down)[0, 1] == pytest.approx(1.0)
    assert np.corrcoef(world[:, 0], camera[:, 0])[0, 1] == pytest.approx(1.0)
    assert np.corrcoef(world[:, 2], -camera[:, 2])[0, 1] == pytest.approx(1.0)
    along = moving.basis.Phi[:, 0] @ moving.basis.rest
    scale = np.ptp(world[:, 0]) / np.ptp(camera[:, 0])
    assert np.ptp(along) * scale == pytest.approx(1.0, rel=1e-4)


def test_texture_and_coordinates(tmp_path, moving):
    file = written(tmp_path, moving)
    assert file.uv == pytest.approx(moving.uv, abs=1e-6)
    image = cv2.imdecode(np.frombuffer(file.image(), np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == moving.texture_bgr.shape
    assert np.abs(image.astype(int) - moving.texture_bgr).max() <= 3


def test_times_start_at_zero_and_ascend_even_if_the_source_stutters(tmp_path, moving):
    times = moving.times_s.copy()
    times[3] = times[2]
    times[5] = times[1]
    file = written(tmp_path, replace(moving, times_s=times))
    assert file.times_s == pytest.approx(times[[0, 1, 2, 4, 6]] - times[0], abs=1e-6)


def test_neighbouring_quaternions_have_one_sign(tmp_path, moving):
    signs = np.array([1, -1, 1, 1, -1, -1, 1])[:, None]
    file = written(tmp_path, replace(moving, quaternion=moving.quaternion * signs))
    rotations = file.accessor(file.channels["rotation"].output)
    assert (np.sum(rotations[1:] * rotations[:-1], axis=1) > 0.5).all()


def test_a_known_unit_is_in_true_metres(tmp_path, moving):
    told, free = (written(tmp_path, replace(moving, unit_m=unit)).gltf.nodes[0] for unit in (1e-3, None))
    assert told.scale == [1e-3] * 3
    along = moving.basis.Phi[:, 0] @ moving.basis.rest
    assert free.scale == pytest.approx([1 / np.ptp(along)] * 3)
    assert np.array(told.translation) / 1e-3 == pytest.approx(np.array(free.translation) / free.scale[0])
