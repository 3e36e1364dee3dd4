"""New textures on the moving surface: compositing, occlusion, shading."""
