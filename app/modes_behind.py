"""The figure of the mode shapes, drawn by another process while a run goes on: Matplotlib takes about a second."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from reconstruction.mesh import Mesh
from reconstruction.modes import ModalBasis

MODEL, FIGURE = "model.npz", "modes.jpg"
NICENESS = 10


class ModesBehind:
    """Starts to draw; one public verb besides, to get what was drawn.

    Args:
        basis: the modes.
        mesh: connectivity of the points.
        metric: distance that the modes come from.
        name: for the headline.
    """

    def __init__(self, basis: ModalBasis, mesh: Mesh, metric: str, name: str) -> None:
        self._folder = TemporaryDirectory(prefix="modeshape-", ignore_cleanup_errors=True)
        np.savez(
            Path(self._folder.name, MODEL),
            rest=basis.rest,
            Upsilon=basis.Upsilon,
            eigenvalues=basis.eigenvalues,
            Phi=basis.Phi,
            faces=mesh.faces,
            edges=mesh.edges,
        )
        self._process = subprocess.Popen(
            [sys.executable, "-m", "app.modes_behind", self._folder.name, metric, name],
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C ends the run, which still wants the figure
        )

    def figure(self, timeout_s: float) -> bytes | None:
        """The JPEG; None if it is not there in time, or could not be drawn. To be called once."""
        try:
            self._process.wait(timeout_s)
            return Path(self._folder.name, FIGURE).read_bytes()
        except (OSError, subprocess.TimeoutExpired):
            return None
        finally:
            self._process.kill()
            self._process.wait()
            self._folder.cleanup()


def main(folder: str, metric: str, name: str) -> None:
    """What the other process does."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    from app.modes import draw, spectrum, title

    with np.load(Path(folder, MODEL)) as stored:
        basis = ModalBasis(stored["rest"], stored["Upsilon"], stored["eigenvalues"], stored["Phi"])
        mesh = Mesh(stored["faces"], stored["edges"])
    picture = draw(basis, mesh, spectrum(basis, mesh, metric), title(name, basis, metric), jpeg=True)
    part = Path(folder, FIGURE + ".part")
    part.write_bytes(picture)
    part.replace(Path(folder, FIGURE))


if __name__ == "__main__":
    main(*sys.argv[1:])
