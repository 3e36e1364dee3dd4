"""Reads a .glb as a viewer does, with nothing of ours, and has it judged by Khronos' validator."""

import json
import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pygltflib
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]

VALIDATOR = "gltf-validator@2.0.0-dev.3.10"
VALIDATE = """
const validator = require('gltf-validator');
const bytes = new Uint8Array(require('fs').readFileSync(process.argv[1]));
validator.validateBytes(bytes).then(r => console.log(JSON.stringify(r)));
"""
COMPONENTS = {pygltflib.FLOAT: "<f4", pygltflib.UNSIGNED_SHORT: "<u2", pygltflib.UNSIGNED_INT: "<u4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class GlbFile:
    """A .glb with one animated mesh."""

    def __init__(self, path: Path) -> None:
        self.gltf = pygltflib.GLTF2().load(str(path))
        self.blob = self.gltf.binary_blob()
        self.mesh = self.gltf.meshes[0]
        self.primitive = self.mesh.primitives[0]
        self.node = next(i for i, node in enumerate(self.gltf.nodes) if node.mesh == 0)
        self.channels = {
            channel.target.path: self.gltf.animations[0].samplers[channel.sampler]
            for channel in self.gltf.animations[0].channels
        }
        self.times_s = self.accessor(next(iter(self.channels.values())).input).ravel()
        self.faces = self.accessor(self.primitive.indices).reshape(-1, 3)
        self.uv = self.accessor(self.primitive.attributes.TEXCOORD_0)

    def accessor(self, index: int) -> Array:
        """Values (n, width) of an accessor."""
        accessor = self.gltf.accessors[index]
        view = self.gltf.bufferViews[accessor.bufferView]
        content = self.blob[view.byteOffset : view.byteOffset + view.byteLength]
        flat = np.frombuffer(content, COMPONENTS[accessor.componentType]).astype(np.float64)
        assert flat.size == accessor.count * WIDTHS[accessor.type]
        return flat.reshape(accessor.count, -1)

    def image(self) -> bytes:
        """The texture's file."""
        view = self.gltf.bufferViews[self.gltf.images[0].bufferView]
        return self.blob[view.byteOffset : view.byteOffset + view.byteLength]

    def track(self, path: str, time_s: float, default: list[float]) -> Array:
        """One animated property at a time, interpolated linearly (rotations are normalised, not slerped)."""
        if path not in self.channels:
            return np.array(default)
        values = self.accessor(self.channels[path].output).reshape(len(self.times_s), -1)
        k = int(np.clip(np.searchsorted(self.times_s, time_s, "right") - 1, 0, len(self.times_s) - 2))
        u = np.clip((time_s - self.times_s[k]) / (self.times_s[k + 1] - self.times_s[k]), 0, 1)
        value = (1 - u) * values[k] + u * values[k + 1]
        return value / np.linalg.norm(value) if path == "rotation" else value

    def vertices(self, time_s: float) -> Array:
        """Vertices (p, 3) in the axes of the root node, that is the camera's."""
        vertices = self.accessor(self.primitive.attributes.POSITION)
        for weight, target in zip(self.track("weights", time_s, []), self.primitive.targets or [], strict=True):
            vertices = vertices + weight * self.accessor(target["POSITION"])
        node = self.gltf.nodes[self.node]
        rotation = matrix(self.track("rotation", time_s, node.rotation))
        scale = self.track("scale", time_s, node.scale)
        return (vertices * scale) @ rotation.T + self.track("translation", time_s, node.translation)

    def world(self, points: Array) -> Array:
        """Points (p, 3) of the root node's axes in glTF's world."""
        root = self.gltf.nodes[self.gltf.scenes[0].nodes[0]]
        return (points * root.scale) @ matrix(np.array(root.rotation)).T + root.translation


def matrix(quaternion: Array) -> Array:
    """Rotation of a glTF quaternion, w last, by the formula of its specification."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@cache
def validator() -> Path:
    """Folder with the validator's node_modules, in the system's temporary folder so that it is fetched once."""
    ci = os.environ.get("CI") == "true"
    if shutil.which("node") is None or shutil.which("npm") is None:
        reason = "no node and npm: the glTF validator cannot run"
        pytest.fail(reason) if ci else pytest.skip(reason)
    folder = Path(tempfile.gettempdir()) / "modeshape-gltf-validator"
    if not (folder / "node_modules" / "gltf-validator" / "index.js").is_file():
        folder.mkdir(exist_ok=True)
        install = ["npm", "install", "--no-audit", "--no-fund", "--prefix", str(folder), VALIDATOR]
        done = subprocess.run(install, capture_output=True, text=True, timeout=300)
        if done.returncode:
            reason = f"cannot install {VALIDATOR}: {done.stderr.strip()[-200:]}"
            pytest.fail(reason) if ci else pytest.skip(reason)
    return folder


def issues(path: Path) -> list[dict[str, object]]:
    """Errors and warnings of the validator; skips the test where it cannot run."""
    folder = validator()
    done = subprocess.run(
        ["node", "-e", VALIDATE, str(path.resolve())], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)["issues"]
    return [message for message in report["messages"] if message["severity"] < 2]
