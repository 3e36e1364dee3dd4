"""What a recording contains: the one list that the writer, the blueprint and every reader share.

Timelines: `frame` (number of the frame in its source, from 0) and `time` (seconds of the video); what is
static has neither. A frame that is estimated again has several rows: the last one counts. A run with a final
pass and without a viewer writes on the way the `estimate` of every frame, and what is drawn of it with the final
pass, or at its end; one that was killed has the estimates, of which the rest follows. p vertices, r modes,
m triangles, n edges; matrices are flattened row by row; components of ours (`modeshape.…`) are float64 unless
said otherwise.

Static:

- `/`, `world`: ViewCoordinates RDF: x right, y down, z forward, as a camera sees.
- `world/mesh`: Mesh3D triangle_indices (m, 3), vertex_texcoords (p, 2), albedo_texture (crop of the
  first frame); Transform3D, which gives the first shape unit size at the origin of the 3-D view (readers
  of the vertices ignore it), as that of `world/truth`.
- `world/camera`: Pinhole with intrinsics and resolution, Transform3D; for perspective cameras only.
- `world/camera/image`: Transform3D by half a pixel: everywhere here pixel centres are at whole numbers.
- `model/<n>`: the n-th model, from 0: modeshape.Model with rest S̄ (3p), Upsilon Υ (rp), eigenvalues (r), Phi Φ (9),
  faces (3m) and edges (2n) int32, strips int32 (see `wireframe`; −1 ends a strip), texture_px (2p) the vertices in the
  first frame, texture_origin (2) px of the crop in it, size (2) of the picture, perspective bool,
  focal_px, center_px (2).
- `modes/<n>`: Mesh3D vertex_positions, triangle_indices, vertex_colors: the n-th mode, from 1, out of the plane, beside
  the others; `modes/names`: Points3D, their labels. There when the run is complete.
- `help`: TextDocument, what the views show.
- `configuration`, `summary`: TextDocument for people; modeshape.Document with json and version for
  programs.

Every frame:

- `world/camera/image`: EncodedImage (JPEG), or VideoFrameReference and, static, AssetVideo.
- `world/camera/points/seen`: Points2D, observed px float32, in the order of the true entries of
  `visible`.
- `world/camera/points/lost`: Points2D, neither seen nor predicted; drawn where they were last seen.
- `observation`: modeshape.Observation with visible (p) bool, phase (text).
- `quality/visible`: Scalars, share of the points seen, 0 to 1.
- `timing/<stage>`: Scalars, milliseconds.
- `events`: TextLog, when something happens.

Until there is a shape:

- `world/status`: Points3D without a size, whose label says what is waited for.

Frames whose truth is known, when the run is complete:

- `world/truth`: Points3D, true points in the size and at the place of the shape.

The first frame:

- `world/camera/region`: LineStrips2D, borders of the region that the points are from, px.

Every frame with a shape:

- `world/mesh`: Mesh3D vertex_positions (p, 3) float32, camera axes, pixels of the first frame; vertex_colors: from
  near (blue) to far (red), with `--uncertainty` the redder, the less sure. One view shows the texture, another the colours.
- `world/camera/wireframe`: LineStrips2D, the reprojected mesh in px: the vertices in the order of
  `strips`.
- `world/camera/points/predicted`: Points2D, not seen; drawn where the model says they are.
- `estimate`: modeshape.Estimate with quaternion (4) w first, t (2) px, s, Lambda (3r), visible (p) bool, and model
  int64, the n of the model that it is of; with `--uncertainty` sigma (p), standard deviations of the vertices, in units of
  the shape.
- `online`: the same as it was shown on the way, before a final pass; there if that was to be kept.
- `quality/error`: Scalars, RMS and median reprojection error, px.
- `coefficients/spectrum`: BarChart, Λ (3r): Γ_α, Γ_β, Γ_τ side by side.
- `coefficients/leading`: Scalars, the first entries of Γ_α, Γ_β, Γ_τ.
"""

APPLICATION = "modeshape"

FRAME = "frame"
TIME = "time"

WORLD = "world"
STATUS = "world/status"
TRUTH = "world/truth"
HELP = "help"
MESH = "world/mesh"
CAMERA = "world/camera"
IMAGE = "world/camera/image"
REGION = "world/camera/region"
WIREFRAME = "world/camera/wireframe"
SEEN = "world/camera/points/seen"
PREDICTED = "world/camera/points/predicted"
LOST = "world/camera/points/lost"
OBSERVATION = "observation"
ESTIMATE = "estimate"
ONLINE = "online"
MODEL = "model"
ERROR = "quality/error"
VISIBLE = "quality/visible"
TIMING = "timing"
STAGES = ("decode", "track", "reconstruct", "record")
SPECTRUM = "coefficients/spectrum"
LEADING = "coefficients/leading"
EVENTS = "events"
CONFIGURATION = "configuration"
SUMMARY = "summary"
MODES = "modes"
