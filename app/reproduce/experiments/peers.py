"""Ours beside batch methods on the same files."""

from app.reproduce.experiment import Experiment
from app.reproduce.lines import FACE, FLAG, FLAG_RIGID, Line
from app.reproduce.published import PEERS, PEERS_SOURCE
from app.reproduce.result import Headline, Result, Table, percent
from app.reproduce.work import Effort, Work

MISSING = (0.0, 0.4)
COLUMNS = (
    *("method", "flag250", "flag250, 40 % missing", "flag250, sign free", "flag250, 40 % missing, sign free"),
    *("face37", "face37, 40 % missing"),
)


def peers(work: Work) -> Result:
    """Ours frame by frame, with the first true flag as rest shape and without, beside theirs of the whole sequence."""
    face = errors(work, FACE, "e3d")
    flag, flag_given = (errors(work, line, "e3d") for line in (FLAG_RIGID, FLAG))
    ours = [
        ("ours, on-line", *flag, *errors(work, FLAG_RIGID, "e3d_sign_free"), *face),
        ("ours, on-line, first flag given", *flag_given, *errors(work, FLAG, "e3d_sign_free"), *face),
    ]
    theirs = [
        (peer.name, peer.flag, None, peer.flag_sign_free, peer.flag_missing_sign_free, peer.face, peer.face_missing)
        for peer in PEERS
    ]
    table = Table(f"e3d in %; the others are {PEERS_SOURCE}", COLUMNS, [*ours, *theirs])
    headlines = [
        Headline("flag250", "on-line, rest shape from 15 frames", flag[0], None, best_peer("flag")),
        Headline(
            "flag250",
            "the same; their depth signs chosen with the truth, ours not",
            flag[0],
            None,
            best_peer("flag_sign_free"),
        ),
        Headline("face37", "on-line, rest shape from its first frames", face[0], None, best_peer("face")),
        Headline(
            "face37, 40% missing", "on-line, rest shape from its first frames", face[1], None, best_peer("face_missing")
        ),
    ]
    return Result([table], headlines=headlines)


def errors(work: Work, line: Line, measure: str) -> list[float | None]:
    """In %, with nothing missing and with a part."""
    return [percent(work.evaluated(line.config(work.data, missing=share))[measure]) for share in MISSING]


def best_peer(measure: str) -> str:
    """Name and error of the best."""
    value, name = min((value, peer.name) for peer in PEERS if (value := getattr(peer, measure)) is not None)
    return f"best batch method: {name} {value}"


def steps(_effort: Effort) -> int:
    """One for the face, two for each flag, with nothing missing and with a part."""
    return 5 * len(MISSING)


EXPERIMENT = Experiment(
    "peers", "Beside published batch methods", peers, steps, 0.4, files=(FLAG.file, FACE.file), paper="§6"
)
