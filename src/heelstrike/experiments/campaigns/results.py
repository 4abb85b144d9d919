"""The outcomes of a campaign beside the values that they belong to."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.experiments.campaigns.outcome import Outcome
from heelstrike.experiments.campaigns.parameters import Plan
from heelstrike.field_texts import dataclass

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class CampaignResults:
    """What the trials of a campaign came to."""

    plan: Plan
    """Names and values of the parameters."""
    numbers: tuple[int, ...]
    """Numbers of the trials that are finished; all of them, unless the campaign was stopped."""
    outcomes: tuple[Outcome, ...]
    """What each came to."""

    def __len__(self) -> int:
        return len(self.outcomes)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which robots walked on to the end, (n,)."""
        return np.array([each.success for each in self.outcomes], dtype=bool)

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the parameters, (n, parameters); NaN where a trial leaves one as it is."""
        return self.plan.values[list(self.numbers)]

    @property
    def causes(self) -> dict[str, int]:
        """How many trials failed for which first cause, the most frequent first."""
        failed = (each for each in self.outcomes if not each.success)
        return dict(Counter(each.cause or each.status for each in failed).most_common())

    def column(self, name: str) -> NDArray[Any]:
        """Return one entry of all outcomes.

        Parameters
        ----------
        name : str
            A field of :class:`~heelstrike.experiments.campaigns.Outcome`.

        Returns
        -------
        (n,) array
            The entry of each.
        """
        return np.array([getattr(each, name) for each in self.outcomes])

    def _of(self, name: str) -> NDArray[Any]:
        """Return what a parameter is in each trial; of texts nothing where it is left as it is."""
        if name in self.plan.texts:
            return np.array([str(self.plan.of(number).get(name, "")) for number in self.numbers])
        return self.values[:, self.plan.names.index(name)]

    def to_dataset(self) -> xarray.Dataset:
        """Return values and outcomes as a labelled dataset, a row a trial."""
        import xarray

        data: dict[str, Any] = {
            name if name != "trial" else "trial_name": ("trial", self._of(name))
            for name in self.plan.names
        }
        for each in fields(Outcome):
            data[f"outcome_{each.name}"] = ("trial", self.column(each.name))
        return xarray.Dataset(data, coords={"trial": list(self.numbers)})

    def __str__(self) -> str:
        good = int(self.success.sum())
        causes = ", ".join(f"{count} {cause}" for cause, count in self.causes.items())
        return f"{good} of {len(self)} trials walked on" + (f"; {causes}" if causes else "")
