"""The files of a run's recording: one for each object, and of a long run one for so many minutes."""

from collections.abc import Callable, Mapping
from pathlib import Path

from app.files.names import beside
from app.options.run import Output
from app.recording.process import Recorder
from app.recording.viewer import answers, opened_viewer


class Parts:
    """Files that are written one after another.

    Args:
        recorder: writes them.
        path: of the first; None writes none.
        output: says when another is due, and where to watch.
        wide: px of the pictures as they are kept.
        log: where to report.

    Attributes:
        paths: of the files so far.
    """

    def __init__(
        self, recorder: Recorder, path: Path | None, output: Output, wide: int, log: Callable[[str], None]
    ) -> None:
        self._recorder, self._path, self._output, self._wide = recorder, path, output, wide
        self._viewer = opened_viewer(path, output, log)
        self.paths: list[Path] = []
        self._opened_s = 0.0

    def open(self, time_s: float, options: Mapping[str, object]) -> None:
        """Go on in another file, with options as `Recording` takes them."""
        self._opened_s = time_s
        path, part = self._path, len(self.paths) + 1
        options = {**options, "image_width": min(self._output.image_width or self._wide, self._wide)}
        if path is not None and part > 1:
            if options["image"] == "video":  # the video file is in the first part
                options = {**options, "image": "jpeg"}
            path = beside(path, f"part{part}", overwrite=self._output.overwrite)
        self.paths += [path] if path else []
        watched = self._viewer is not None and answers(self._viewer)  # it may have been closed
        self._recorder.tell("open", path, connect=self._viewer if watched else None, **options)

    def due(self, time_s: float) -> bool:
        """Whether it is time for another."""
        minutes = self._output.split_minutes
        return minutes is not None and time_s - self._opened_s >= 60.0 * minutes
