"""A moving mesh as binary glTF: the modes are morph targets, their weights and the pose are animated.

What a file contains, and in which axes:

- glTF's world has y up, is right-handed and in metres. The root node turns the camera's axes (x right, y down,
  z forward; pixels of the first frame) by 180° about x, makes the rest shape 1 m long and moves the first shape's
  centre to the origin. Below it, everything is in the camera's axes and pixels.
- The mesh node has the pose: vertex i of a frame is, in the camera's axes, scale · R · (S̄_i + Σ_ι w_ι T_ι,i) +
  translation, with the morph targets T_ι and weights w_ι. Frames between two key frames are interpolated.
- T_ι is B_ι of the linear basis (paper §3.3) times the largest |φ_ι| of the recording, and w_ι = φ_ι divided by it,
  so that weights lie in −1 … 1 as editors expect; entries of Λ that stay zero have no target. `extras` names the
  entry (`targetNames`: alpha 1 … tau r) and its factor in pixels (`unitsPx`).
- Time 0 is the first frame; the camera node is the video's camera, if it has perspective.
- The texture is a crop of the first frame, as sharp as that. The material is lit, rough and seen from both sides, so that
  bends show; normals have morph targets, too: how they change with each weight, at rest.
"""

from dataclasses import dataclass, replace
from importlib.metadata import version

import cv2
import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

from app.arrays import Array, Indices
from app.files.scenes.gltf_buffer import Buffer
from reconstruction.basis.mesh import vertex_normals
from reconstruction.basis.modal_basis import ROW_NAMES, ModalBasis
from reconstruction.camera import rotation_from_quaternion

JPEG_QUALITY = 95
LENGTH_M = 1.0  # of the rest shape along its first axis
STEP = 0.25  # of a weight, over which normals are compared
HALF_TURN_ABOUT_X = [1.0, 0.0, 0.0, 0.0]  # quaternion, w last as in glTF


@dataclass(frozen=True)
class MovingMesh:
    """A modal basis in motion, every frame with a shape: scale · R · (S̄ + ΦΛΥ) + origin in camera axes.

    Attributes:
        basis: rest shape and modes, px.
        faces: (m, 3) triangles.
        uv: (p, 2) texture coordinates, 0 … 1 from the top left corner.
        texture_bgr: (h, w, 3) picture.
        times_s: (F,) seconds, ascending.
        quaternion: (F, 4) of R, w first.
        origin: (F, 3) px, camera axes.
        scale: (F,) 1 for perspective cameras.
        Lambda: (F, 3, r) px.
        field_of_view: vertical angle in radians and width / height of the picture; None for an orthographic camera.
        colors: (p, 3) of the vertices, 0 … 1 linear, instead of the picture; None for that.
        unit_m: metres in one of the unit that lengths above are in, if that is known.
    """

    basis: ModalBasis
    faces: Indices
    uv: Array
    texture_bgr: NDArray[np.uint8]
    times_s: Array
    quaternion: Array
    origin: Array
    scale: Array
    Lambda: Array
    field_of_view: tuple[float, float] | None = None
    colors: Array | None = None
    unit_m: float | None = None


def glb(moving: MovingMesh, name: str = "surface") -> bytes:
    """The content of a .glb file (see above)."""
    moving = ascending(moving)
    buffer = Buffer()
    weights, targets, names, units = morph_targets(moving)
    picture = gltf.TextureInfo(index=0) if moving.colors is None else None
    file = gltf.GLTF2(
        asset=gltf.Asset(version="2.0", generator=f"modeshape {version('modeshape')}"),
        scene=0,
        scenes=[gltf.Scene(nodes=[0])],
        nodes=[root(moving), first_pose(moving, name)],
        meshes=[textured_mesh(moving, buffer, targets, weights, {"targetNames": names, "unitsPx": units})],
        materials=[
            gltf.Material(
                pbrMetallicRoughness=gltf.PbrMetallicRoughness(
                    baseColorTexture=picture,
                    metallicFactor=0.0,
                    roughnessFactor=1.0,
                ),
                doubleSided=True,
                alphaCutoff=None,
            )
        ],
        textures=[gltf.Texture(sampler=0, source=0)],
        samplers=[
            gltf.Sampler(
                magFilter=gltf.LINEAR,
                minFilter=gltf.LINEAR_MIPMAP_LINEAR,
                wrapS=gltf.CLAMP_TO_EDGE,
                wrapT=gltf.CLAMP_TO_EDGE,
            )
        ],
        images=[gltf.Image(bufferView=buffer.view(jpeg(moving.texture_bgr)), mimeType="image/jpeg", name="first frame")],
        animations=[animation(moving, buffer, weights)],
    )
    if moving.field_of_view is not None:
        add_camera(file, moving, moving.field_of_view)
    file.bufferViews, file.accessors = buffer.views, buffer.accessors
    file.buffers = [gltf.Buffer(byteLength=len(buffer.bytes))]
    file.set_binary_blob(bytes(buffer.bytes))
    return b"".join(file.save_to_bytes())


def ascending(moving: MovingMesh) -> MovingMesh:
    """Without the frames whose time, from the first frame's and as float32, does not come after the one before."""
    times = (moving.times_s - moving.times_s[0]).astype(np.float32)
    kept = np.append(True, times[1:] > np.maximum.accumulate(times)[:-1])
    quaternion = moving.quaternion[kept]
    # q and −q are one rotation; neighbours with one sign are interpolated the short way in every viewer.
    flips = np.sign(np.sum(quaternion[1:] * quaternion[:-1], axis=1))
    quaternion = quaternion * np.cumprod(np.append(1.0, np.where(flips < 0, -1.0, 1.0)))[:, None]
    return replace(
        moving,
        times_s=times[kept].astype(np.float64),
        quaternion=quaternion,
        origin=moving.origin[kept],
        scale=moving.scale[kept],
        Lambda=moving.Lambda[kept],
    )


def morph_targets(moving: MovingMesh) -> tuple[Array, Array, list[str], list[float]]:
    """Weights (F, n), targets (n, p, 3), and of each target its entry of Λ and its unit in pixels."""
    phi = moving.Lambda.reshape(len(moving.Lambda), -1)
    units = np.abs(phi).max(axis=0)
    free = np.flatnonzero(units > 0)
    r = moving.Lambda.shape[2]
    targets = moving.basis.linear_basis()[free].transpose(0, 2, 1) * units[free, None, None]
    names = [f"{ROW_NAMES[i // r]} {i % r + 1}" for i in free.tolist()]
    return phi[:, free] / units[free], targets, names, units[free].tolist()


def unit_m(moving: MovingMesh) -> float:
    """Metres in a unit of length: as is known, else so that the rest shape is LENGTH_M long."""
    if moving.unit_m is not None:
        return moving.unit_m
    along = moving.basis.Phi[:, 0] @ moving.basis.rest
    return LENGTH_M / max(float(np.ptp(along)), 1e-9)


def root(moving: MovingMesh) -> gltf.Node:
    """From the camera's axes to glTF's."""
    first = moving.scale[0] * rotation_from_quaternion(moving.quaternion[0]) @ moving.basis.deform(moving.Lambda[0])
    center = first.mean(axis=1) + moving.origin[0]
    unit = unit_m(moving)
    return gltf.Node(
        name="camera axes",
        rotation=HALF_TURN_ABOUT_X,
        scale=[unit] * 3,
        translation=(-unit * center * [1.0, -1.0, -1.0]).tolist(),
        children=[1],
    )


def first_pose(moving: MovingMesh, name: str) -> gltf.Node:
    """The node that carries the mesh, as it is in the first frame."""
    w, x, y, z = moving.quaternion[0].tolist()
    scale = [float(moving.scale[0])] * 3
    return gltf.Node(name=name, mesh=0, rotation=[x, y, z, w], translation=moving.origin[0].tolist(), scale=scale)


def textured_mesh(
    moving: MovingMesh, buffer: Buffer, targets: Array, weights: Array, extras: dict[str, object]
) -> gltf.Mesh:
    """Rest shape, targets (n, p, 3), texture coordinates and triangles."""
    attributes = gltf.Attributes(
        POSITION=buffer.floats(moving.basis.rest.T, gltf.ARRAY_BUFFER, bounds=True),
        NORMAL=buffer.floats(normals(moving.basis.rest.T, moving.faces), gltf.ARRAY_BUFFER),
        COLOR_0=None if moving.colors is None else buffer.floats(moving.colors, gltf.ARRAY_BUFFER),
        TEXCOORD_0=buffer.floats(moving.uv, gltf.ARRAY_BUFFER),
    )
    rest = moving.basis.rest.T
    morphs = []
    for target in targets:
        ahead, behind = (normals(rest + side * target, moving.faces) for side in (STEP, -STEP))
        position = buffer.floats(target, gltf.ARRAY_BUFFER, bounds=True)
        morphs.append({"POSITION": position, "NORMAL": buffer.floats((ahead - behind) / (2 * STEP), gltf.ARRAY_BUFFER)})
    triangles = gltf.Primitive(
        attributes=attributes, indices=buffer.indices(moving.faces), material=0, targets=morphs or None
    )
    if not len(targets):
        return gltf.Mesh(primitives=[triangles])
    return gltf.Mesh(primitives=[triangles], weights=weights[0].tolist(), extras=extras)


def normals(vertices: Array, faces: Indices) -> Array:
    """Unit normals (p, 3) of vertices; where there is no triangle, any."""
    found = vertex_normals(vertices, faces)
    return np.where(found.any(axis=1, keepdims=True), found, [0.0, 0.0, -1.0])


def animation(moving: MovingMesh, buffer: Buffer, weights: Array) -> gltf.Animation:
    """Pose and weights (F, n) over the video's times."""
    times = buffer.floats(moving.times_s, bounds=True)
    tracks = {
        "rotation": np.roll(moving.quaternion, -1, axis=1),
        "translation": moving.origin,
        "scale": np.repeat(moving.scale[:, None], 3, axis=1),
        "weights": weights.ravel(),
    }
    if np.ptp(moving.scale) == 0:
        del tracks["scale"]
    if not weights.size:
        del tracks["weights"]
    made = gltf.Animation(name="recording")
    for path, values in tracks.items():
        sampler = gltf.AnimationSampler(input=times, output=buffer.floats(values), interpolation="LINEAR")
        target = gltf.AnimationChannelTarget(node=1, path=path)
        made.channels.append(gltf.AnimationChannel(sampler=len(made.samplers), target=target))
        made.samplers.append(sampler)
    return made


def add_camera(file: gltf.GLTF2, moving: MovingMesh, field_of_view: tuple[float, float]) -> None:
    """The camera that took the video, which looks along its z axis; glTF's look along −z."""
    depth_m = unit_m(moving) * float(np.median(moving.origin[:, 2]))
    perspective = gltf.Perspective(
        yfov=field_of_view[0], aspectRatio=field_of_view[1], znear=0.01 * depth_m, zfar=100 * depth_m
    )
    file.cameras = [gltf.Camera(type="perspective", perspective=perspective, name="video")]
    file.nodes[0].children.append(len(file.nodes))
    file.nodes.append(gltf.Node(name="video camera", camera=0, rotation=HALF_TURN_ABOUT_X))


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """An image (h, w, 3) BGR, compressed."""
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
