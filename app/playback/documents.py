"""Documents, events and names in a recording."""

import json
from typing import cast

from app.playback.reading.rows import STATIC, Rows
from app.recording import entities

DOCUMENT = "modeshape.Document:"
NAME = ("__properties", "RecordingInfo:name")
SCALARS = "Scalars:scalars"


def document(rows: Rows, entity: str) -> tuple[dict[str, object] | None, str]:
    """A document, None if it is not there, and the version of modeshape that wrote it."""
    texts = rows.last(entity, f"{DOCUMENT}json")
    if STATIC not in texts:
        return None, "unknown"
    version = cast(list[str], rows.static(entity, f"{DOCUMENT}version"))[0]
    words = json.loads(cast(list[str], texts[STATIC].value)[0])
    if not isinstance(words, dict):
        raise ValueError(f"{entity} is no list of names and values")
    return words, version


def events(rows: Rows) -> list[tuple[int, float, str, str]]:
    """Frame, time in seconds, level and text of what happened."""
    levels = {row.id: cast(list[str], row.value)[0] for row in rows.all(entities.EVENTS, "TextLog:level")}
    return [
        (row.frame, row.time_s, levels.get(row.id, "INFO"), " ".join(cast(list[str], row.value)[0].split("\n")))
        for row in rows.all(entities.EVENTS, "TextLog:text")
    ]


def recording_name(rows: Rows) -> str | None:
    """What viewers call the recording."""
    names = rows.last(*NAME)
    return cast(list[str], names[STATIC].value)[0] if STATIC in names else None


def stages(rows: Rows) -> list[str]:
    """Names of the stages with recorded times: first those that every run has."""
    order = entities.STAGES
    found = [e.split("/", 1)[1] for e, c in rows.found if e.startswith(f"{entities.TIMING}/") and c == SCALARS]
    return sorted(found, key=lambda stage: order.index(stage) if stage in order else len(order))
