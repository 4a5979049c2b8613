"""How much of a run is drawn: into a recording, for ``aloft view``, and live."""

from __future__ import annotations

from dataclasses import dataclass

from ..file.changed_rows import ChangedRows
from ..file.thinned_rows import ThinnedRows


@dataclass(frozen=True)
class Detail:
    """How much is drawn.

    Attributes:
        main_only: only the curves and lanes that the viewer shows first; else those of every field
            with at most ``most`` elements, such as are no mass matrices.
        tolerance: how far a curve may be from a value that is left out, as a share of the signal's
            range; without it, only values are left out that do not change.
        row_rate: how often a value is taken [Hz]; by default in every tick.
        picture_rate: how often the scene in 3D is drawn [Hz].
        extras: whether it has the estimated robot beside the true one, and the friction cones.
    """

    main_only: bool = False
    tolerance: float | None = None
    row_rate: float | None = None
    picture_rate: float = 100.0
    extras: bool = True
    most: int = 64

    def picker(self) -> ChangedRows | ThinnedRows | None:
        """What chooses the values of one signal; ``None`` if all that are taken are written."""
        if self.row_rate is not None:
            return None  # or else a curve would end where its signal does not change
        return ChangedRows() if self.tolerance is None else ThinnedRows(self.tolerance)


RECORDED = Detail(main_only=True, tolerance=1.0 / 250.0, picture_rate=50.0, extras=False)
"""What a recording has beside its numbers: enough for a first look with any Rerun. The tolerance is
less than a pixel of a plot."""
WHOLE = Detail()
"""What ``aloft view`` shows, which is drawn from the numbers."""
LIVE = Detail(row_rate=100.0)
"""What is shown while a run goes on."""
