"""A video of a bending sheet becomes a mesh file for every tenth frame: video_to_mesh.py paper.mp4 X Y WIDTH HEIGHT."""

import sys
from pathlib import Path

import trimesh

import modeshape

video, *region = sys.argv[1:]
x, y, width, height = map(int, region)
folder = Path("meshes")
folder.mkdir(exist_ok=True)
for frame in modeshape.reconstruct(video, region=(x, y, width, height)):
    if frame.index % 10 == 0 and not frame.lost:
        trimesh.Trimesh(frame.shape, frame.faces, process=False).export(folder / f"{frame.index:04d}.ply")
        print(f"frame {frame.index}: {frame.visible.sum()} of {len(frame.shape)} points seen")
