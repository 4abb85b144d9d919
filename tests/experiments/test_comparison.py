"""compare(): methods against each other, on numbers that are known."""

from __future__ import annotations

import io

import numpy as np
import pytest
import walking
from figure_text import check_text
from rich.console import Console

import heelstrike as hs
from heelstrike.experiments.comparison import Comparison, Difference
from heelstrike.sim import Scheme


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return hs.compare(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        methods={
            "events": hs.EventDriven(),
            "coarse": hs.TimeStepping(step=1e-3),
            "fine": hs.TimeStepping(step=1e-4),
        },
        state=walking.gait().initial_state,
        duration=1.5,
    )


def test_the_reference_does_not_differ_from_itself(comparison: Comparison) -> None:
    first = comparison.differences[0]
    assert first.method == "events"
    assert (first.touchdown_s, first.impulse_Ns, first.energy_J, first.position) == (0, 0, 0, 0)


def test_shorter_steps_are_nearer(comparison: Comparison) -> None:
    _, coarse, fine = comparison.differences
    assert coarse.touchdowns == fine.touchdowns == 2
    assert coarse.touchdown_s <= 1.1e-3
    assert fine.touchdown_s <= 1.1e-4
    assert fine.position < 0.2 * coarse.position
    assert fine.energy_J < 0.2 * coarse.energy_J


def test_landing_impulses_are_the_same_thing_in_both(comparison: Comparison) -> None:
    """Event-driven runs keep impacts in events, time stepping in forces: 20 N s either way."""
    fine = comparison.differences[2]
    assert fine.impulse_Ns <= 0.02 * walking.gait().touchdown_impulse[0]


def test_the_table_and_the_figure(comparison: Comparison) -> None:
    table = comparison.to_dict()
    assert table["reference"] == "events"
    assert [row["method"] for row in table["methods"]] == ["events", "coarse", "fine"]
    labels = [axes.get_ylabel() for axes in comparison.plot().axes]
    assert any("J" in label for label in labels)
    assert all("(" in label for label in labels)


def test_the_table_fits_a_terminal_of_eighty_columns() -> None:
    """Nothing is cut, whatever the numbers."""
    numbers = dict.fromkeys(("touchdown_s", "impulse_Ns", "zmp_m", "energy_J"), 1.2345e-13)
    others = dict.fromkeys(("position", "penetration_m", "slip_m", "complementarity"), 6.7e-11)
    each = Difference("linearly-implicit", "completed", 19, **numbers, **others, wall_s=0.0123)
    console = Console(width=80, file=io.StringIO())
    console.print(Comparison({}, "linearly-implicit", (each,)))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80
    assert (text.count("1.2e-13"), text.count("6.7e-11"), text.count(each.method)) == (4, 4, 3)
    for word in ("landings", "penetration", "residual", "computing"):
        assert word in text


def test_what_compare_refuses() -> None:
    def asked(**options: object) -> None:
        arguments = {
            "methods": [hs.TimeStepping()],
            "state": walking.gait().initial_state,
            "duration": 0.01,
            **options,
        }
        hs.compare(walking.bravo7(), None, **arguments)  # type: ignore[arg-type]

    with pytest.raises(hs.SimulationError, match="at least one method"):
        asked(methods=[])
    with pytest.raises(hs.SimulationError, match="the same"):
        asked(methods=[hs.TimeStepping(), hs.TimeStepping()])
    with pytest.raises(hs.SimulationError, match="none of the methods"):
        asked(reference="truth")


def test_positions_are_compared_at_common_instants(comparison: Comparison) -> None:
    ends = [run.time[-1] for run in comparison.runs.values()]
    np.testing.assert_allclose(ends, 1.5, atol=1e-9)


def test_methods_that_cannot_are_left_out_and_say_why() -> None:
    """A ground with restitution is nothing for plastic impacts or for laws that have their own."""
    options = {
        "methods": {
            "events": hs.EventDriven(),
            "bouncing": hs.TimeStepping(scheme=Scheme.MOREAU_JEAN),
            "plastic": hs.TimeStepping(scheme=Scheme.GAP_LINEARISED),
            "soft": hs.Compliant(),
        },
        "state": walking.gait().initial_state,
        "duration": 0.01,
        "ground": hs.Ground(restitution=0.3),
    }
    found = hs.compare(walking.bravo7(), None, **options)  # type: ignore[arg-type]
    assert list(found.runs) == ["events", "bouncing"]
    assert list(found.left_out) == ["plastic", "soft"]
    assert "HuntCrossley.from_sink" in found.left_out["soft"]
    assert found.to_dict()["left_out"] == found.left_out
    console = Console(width=200, file=io.StringIO())
    console.print(found)
    assert "soft left out: on compliant ground" in console.file.getvalue()
    with pytest.raises(hs.SimulationError, match="restitution"):
        hs.compare(walking.bravo7(), None, reference="soft", **options)  # type: ignore[arg-type]


def test_the_figure_can_be_read(comparison: Comparison) -> None:
    words = check_text(comparison.plot())
    assert any(word.startswith("10⁻") for word in words)
