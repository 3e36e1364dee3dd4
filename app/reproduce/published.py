"""What others published or were measured to reach: the only numbers in this package that are not computed."""

from dataclasses import dataclass

PAPER = (
    "Agudo, Montiel, Calvo, Moreno-Noguer, WACV 2016, on their 594-point flag "
    "(not public; flag250 is 250 points of the same capture)"
)
PAPER_MISSING, PAPER_MODES = 0.4, 20  # the setting of the three figures that follow
PAPER_E3D = 2.92
PAPER_SEQUENTIAL_E3D = 7.10
PAPER_BATCH_E3D = (8.65, 16.02)
PAPER_BREAKS_AT = 0.8  # share of missing entries up to which its error does not collapse

PEERS_SOURCE = "public implementations of the batch methods on the same files, scored by the same measure"


@dataclass(frozen=True)
class Peer:
    """A batch method, which sees the whole sequence before it says anything; e3d in %, None where not known.

    Attributes:
        name: what it is called.
        flag: on flag250.
        face: on face37.
        face_missing: on face37 with 40 % of the entries hidden.
        flag_sign_free: on flag250 with each frame's depth sign chosen with the truth.
        flag_missing_sign_free: the same with 40 % of the entries hidden.
    """

    name: str
    flag: float | None
    face: float | None
    face_missing: float | None = None
    flag_sign_free: float | None = None
    flag_missing_sign_free: float | None = None


PEERS = (
    Peer("PND2", 6.47, 1.89, 2.26, 3.8, 4.6),
    Peer("CSF2", 7.59, 4.49, None, 6.1),
    Peer("PTA", 8.10, 6.33, None, 7.0),
    Peer("EM-SFM", 10.74, 3.92, 3.76),
    Peer("gbnrsfm", 10.26, 4.23, 4.44),
    Peer("MP", 10.86, 5.65),
    Peer("BMM", None, 7.93),
    Peer("rigid factorisation", 10.72, 5.63, 6.35),
)
