"""`lindy figures`: the papers' figures and numeric claims, from Lindy's own code."""

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lindy.api import LindyError
from services.runtime.config.disk import fresh_folder
from services.runtime.config.extras import how_to_install
from services.runtime.config.settings import nearest
from tools.choices import named

CLAIMS = "claims.json"


def figures(
    *,
    out: Annotated[
        Path,
        Parameter(
            converter=named,
            help="folder, made if it is not there; where it holds such files already, a new one "
            "beside it",
        ),
    ],
    only: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="ids of figures to draw, instead of all; claims.json is written in any case, with "
            "claims about flights (fernandes-6 to 8, 14 to 17) only where one of these is drawn",
        ),
    ] = (),
) -> int:
    """Draw the figures of two papers, and check their numbers.

    The papers are on references and control. It writes ID.png and ID.svg for each figure, and
    claims.json: each claim with the paper's value, ours, and a verdict. Every run gives the same
    files, byte for byte.

    Example: lindy figures --out figures --only andren-4.2 fernandes-10
    """
    if find_spec("matplotlib") is None:
        raise LindyError(
            f"figures need matplotlib, which is not installed; {how_to_install('figures')}"
        )
    from lindy_research.papers import catalogue, claims, style

    entries = [entry for entry in catalogue.FIGURES if not only or entry.id in only]
    known = [entry.id for entry in catalogue.FIGURES]
    for id_ in only:
        if id_ not in known:
            raise LindyError(f"unknown figure {id_!r}{nearest(id_, known)}")
    try:
        out = _folder(out, {f"{entry.id}.{kind}" for entry in entries for kind in ("png", "svg")})
        for number, entry in enumerate(entries, start=1):
            style.save(catalogue.drawn(entry), out / entry.id)
            print(f"[{number}/{len(entries)}] {out / entry.id}.png, .svg", flush=True)
        drawn = [entry.id for entry in entries]
        checked = [*catalogue.checked_claims(), *catalogue.flight_claims(drawn)]
        claims.write(checked, out / CLAIMS)
    except OSError as error:
        raise LindyError(f"cannot write to {out}: {error.strerror or error}") from None
    print(f"{out / CLAIMS}")
    print("\n".join(claims.table(checked)))
    return 0


def _folder(wanted: Path, pictures: set[str]) -> Path:
    """Where no file has one of these names. Another than wanted is said."""

    def taken(folder: Path) -> bool:
        return any(path.name in {CLAIMS, *pictures} for path in folder.iterdir())

    folder = fresh_folder(wanted, taken)
    if folder != wanted:
        print(f"{wanted} holds figures already; these go to {folder}", flush=True)
    return folder
