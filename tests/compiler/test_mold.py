"""Bundles cast in a mold: like the one that was laid out, and each its own."""

from __future__ import annotations

import numpy as np
from numba import njit

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.mold import Mold


class Wheel(Bundle):
    spokes: int = number(int)
    turns: int = cell(int)
    speed: float = cell(float)
    rim: np.ndarray = array("rim")


class Cart(Bundle):
    mass: float = number(float)
    load: np.ndarray = array(2, "goods")
    first: np.ndarray = array("goods")
    axle: np.ndarray = array(2)
    front: Wheel = part(Wheel)
    loan: Wheel = part(Wheel, address=True)


@njit
def roll(cart):  # type: ignore[no-untyped-def]
    cart.front.turns += 1
    cart.front.speed = cart.mass * cart.axle[1]
    cart.front.rim[0] += cart.first[2]
    cart.load[0, 1] = cart.loan.rim[0]
    return cart.front.spokes + cart.load.shape[1]


def a_cart() -> Cart:
    load = np.arange(6.0).reshape(2, 3)
    axle = np.array([0.25, 0.5])
    axle.flags.writeable = False
    front = Wheel.allocate(rim=np.array([1.0, 2.0]), spokes=7)
    loan = Wheel.allocate(rim=np.array([4.0]), spokes=9)
    front.turns = 3
    return Cart(mass=2.0, load=load, first=load[0], axle=axle, front=front, loan=loan)


def test_a_cast_begins_like_the_one_laid_out_and_is_its_own() -> None:
    laid = a_cart()
    mold = Mold(laid)
    before = {name: values.copy() for name, values in laid.storage()}
    one, other = mold.cast(), mold.cast()
    assert roll(one) == 7 + 3
    assert (one.front.turns, one.front.speed) == (4, 1.0)
    assert one.front.rim.tolist() == [3.0, 2.0]
    assert one.load[0].tolist() == [0.0, 4.0, 2.0]
    for name, values in other.storage():
        assert np.array_equal(values, before[name]), name
    for name, values in laid.storage():
        assert np.array_equal(values, before[name]), name
    assert roll(other) == roll(laid)
    for (name, values), (_, its) in zip(one.storage(), other.storage(), strict=True):
        assert np.array_equal(values, its), name


def test_a_cast_shares_what_it_cannot_write_to_and_what_is_another_s() -> None:
    laid = a_cart()
    cast = Mold(laid).cast()
    assert cast.axle is laid.axle
    assert cast.loan is laid.loan
    assert cast.mass == 2.0
    assert cast.extents == laid.extents


def test_arrays_that_shared_memory_share_it_in_a_cast() -> None:
    cast = Mold(a_cart()).cast()
    cast.load[0, 2] = 50.0
    assert cast.first[2] == 50.0
    roll(cast)
    assert cast.front.rim[0] == 51.0


def test_a_mold_remembers_the_moment() -> None:
    laid = a_cart()
    mold = Mold(laid)
    laid.front.turns, laid.load[1, 1] = 100, -1.0
    cast = mold.cast()
    assert (cast.front.turns, cast.load[1, 1]) == (3, 4.0)


def test_a_cast_can_be_cast_copied_and_replaced() -> None:
    cast = Mold(Mold(a_cart()).cast()).cast()
    assert roll(cast) == 10
    other = cast.replaced(mass=3.0)
    roll(other)
    assert cast.front.speed == 1.5  # parts are shared
    copy = cast.stored(lambda _, values: values.copy())
    copy.front.turns = 70
    assert cast.front.turns != 70
    assert copy.front.turns == 70


def test_python_makes_the_members_that_it_is_asked_for() -> None:
    cast = Mold(a_cart()).cast()
    assert roll(cast) == 10  # compiled code finds all of them
    assert not {"load", "first", "front"} & set(vars(cast))
    front = cast.front
    assert cast.front is front
    assert (front.turns, front.rim.tolist()) == (4, [3.0, 2.0])
    assert not hasattr(cast, "wings")


class Watched(Bundle):
    seen: Wheel = part(Wheel)
    rim: np.ndarray = array("rim", address=True)
    again: Wheel = part(Wheel, address=True)


def test_addresses_of_its_own_memory_are_those_of_the_cast() -> None:
    """Rows of contact have the gaps of the contact points; compliant ground copies words."""
    seen = Wheel.allocate(rim=np.array([1.0, 2.0]))
    again = Wheel.allocate(rim=seen.rim[:1])
    cast = Mold(Watched(seen=seen, rim=seen.rim, again=again)).cast()
    cast.seen.rim[0] = 5.0
    assert cast.rim[0] == cast.again.rim[0] == 5.0
    assert seen.rim[0] == 1.0
    mine = Watched(seen=seen, rim=seen.rim, again=Wheel.allocate(rim=np.array([7.0])))
    assert Mold(mine).cast().again is mine.again
