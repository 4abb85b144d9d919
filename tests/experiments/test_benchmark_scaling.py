"""What the benchmark says about the growth of costs."""

from __future__ import annotations

import pytest

from heelstrike.experiments.benchmark.scaling import _crossover


@pytest.mark.parametrize(
    ("ours", "theirs", "size"),
    [
        ([1.0, 2.0, 9.0], [3.0, 3.0, 3.0], 3),
        ([1.0, 2.0, 2.5], [3.0, 3.0, 3.0], None),
        ([4.0, 4.0, 4.0], [3.0, 3.0, 3.0], 1),
        ([1.0, 4.0, 2.0, 9.0], [3.0, 3.0, 3.0, 3.0], 4),  # quicker again after a jump
        ([1.0, 4.0, 2.0], [3.0, 3.0, 3.0], None),
        ([1.0, 4.0, 9.0], [3.0, None, 3.0], 3),  # left out where it was not valid
    ],
)
def test_from_which_size_on_a_peer_is_faster(
    ours: list[float], theirs: list[float | None], size: int | None
) -> None:
    rows = [
        {"size": number, "heelstrike_us": mine} | ({} if its is None else {"peer_us": its})
        for number, (mine, its) in enumerate(zip(ours, theirs, strict=True), start=1)
    ]
    assert _crossover(rows, "peer") == size
