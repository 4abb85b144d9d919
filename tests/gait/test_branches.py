"""The cheaper branch of a family spreads, and stops where the other one is cheaper."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from heelstrike.gait.branches import Place, on_the_cheaper_branch


@dataclass(frozen=True)
class Fake:
    """A gait whose one joint rests: where, tells the branch."""

    place: int
    branch: int
    optimal: bool = True
    step_duration: float = 1.0

    @property
    def spent(self) -> float:
        """Branches cross between places 5 and 6; below, the first one is cheaper."""
        return 10.0 + (5.5 - self.place) * (-1.0 if self.branch == 0 else 1.0)

    def position(self, times: np.ndarray) -> np.ndarray:
        return np.full((len(times), 1), 0.01 * self.place + self.branch)


def family(*branches: int) -> dict[Place, Fake]:
    return {(k,): Fake(k, branch) for k, branch in enumerate(branches)}


def spread(gaits: dict[Place, Fake]) -> tuple[list[int], int, int]:
    """Branches in the end, how many gaits were sought, and how many replaced."""
    sought = []

    def seek(place: Place, near: Fake) -> Fake | None:
        sought.append(place)
        return None if place == (9,) else Fake(place[0], near.branch)

    before, settled, shares = dict(gaits), set(), []
    on_the_cheaper_branch(gaits, seek, settled, shares.append)  # type: ignore[arg-type]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert settled == {((k,), (k + 1,)) for k in range(len(gaits) - 1)}
    replaced = [place for place in gaits if gaits[place] is not before[place]]
    on_the_cheaper_branch(gaits, pytest.fail, settled, pytest.fail)  # type: ignore[arg-type]
    return [gaits[k,].branch for k in range(len(gaits))], len(sought), len(replaced)


def test_the_cheaper_branch_spreads_to_where_they_cross() -> None:
    end = [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]
    assert spread(family(0, 0, 1, 1, 1, 1, 1, 1, 1, 1))[0] == end
    assert spread(family(0, 0, 0, 0, 0, 0, 0, 0, 0, 1))[0] == end  # backwards


def test_one_branch_is_left_alone() -> None:
    assert spread(family(*[1] * 10)) == ([1] * 10, 0, 0)


def test_what_is_no_optimum_gives_way_and_never_replaces() -> None:
    gaits = family(0, 0, 0, 0, 0, 0, 1, 1, 1, 1)
    gaits[2,] = Fake(2, 1, optimal=False)
    assert spread(gaits)[0] == [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]
    assert all(gait.optimal for gait in gaits.values())


def test_a_gait_of_unknown_cost_gives_way() -> None:
    """As in files from before what was spent is known."""
    gaits = family(1, 0, 0, 0, 0)
    unknown = SimpleNamespace(**vars(gaits[0,]), spent=None, position=gaits[0,].position)
    gaits[0,] = unknown  # type: ignore[assignment]
    on_the_cheaper_branch(
        gaits,  # type: ignore[arg-type]
        lambda place, near: Fake(place[0], near.branch),  # type: ignore
        set(),
        lambda _: None,
    )
    assert gaits[0,].branch == 0


def test_what_was_interrupted_seeks_what_is_left_alone() -> None:
    """What has been settled until then is not sought again, and the end is the same."""
    branches = (0, 0, 1, 1, 1, 1, 1, 1, 1, 1)
    gaits, settled, sought = family(*branches), set(), []

    def seek(place: Place, near: Fake) -> Fake:
        sought.append((place, near.place))
        return Fake(place[0], near.branch)

    def interrupt(share: float) -> None:
        if len(sought) >= 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        on_the_cheaper_branch(gaits, seek, settled, interrupt)  # type: ignore[arg-type]
    on_the_cheaper_branch(gaits, seek, settled, lambda _: None)  # type: ignore[arg-type]
    assert len(sought) == len(set(sought))
    assert [gaits[k,].branch for k in range(10)] == [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]
