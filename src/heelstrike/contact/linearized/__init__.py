"""What small errors of a robot do: as it moves under contacts, at its events, and as it stands.

A walk is flows between events. Of an error e of the state x = (q, v), at one time, three things are
made, and nothing else:

- between two events the flow Φ with dΦ/dt = A(t) Φ, A = ∂ẋ/∂x under the contacts that hold
  (:func:`~heelstrike.contact.linearized.motion.linearize_contact`);
- at an event, where g(x) = 0 and x⁺ = Δ(x⁻), a saltation. A walk with the error e⁻ meets the event
  later by δt, at g(x⁻ + e⁻ + f⁻ δt) = 0, so that δt = −∇g e⁻ / (∇g f⁻): one with a larger gap,
  ∇g e⁻ > 0, comes down later, since the gap falls, ∇g f⁻ < 0. It is then at x⁺ + DΔ (e⁻ + f⁻ δt),
  where the undisturbed walk is at x⁺ + f⁺ δt. The difference is
  e⁺ = (DΔ + (f⁺ − DΔ f⁻) ∇g / (∇g f⁻)) e⁻
  (:func:`~heelstrike.contact.linearized.motion.saltation_matrix`);
- on a section, which is the event itself whenever that is, the undisturbed walk waits: f⁺ = 0.
  Every clock that starts again at an event, a controller's or a step's, makes it a section.

At lift-off and where slip begins forces are continuous, DΔ = 1 and f⁺ = f⁻: the identity. Where a
point comes to rest g is its sliding velocity, DΔ = 1 and f⁺ ≠ f⁻. Of points that come down in one
instant each has its own saltation, in the order in which they come down, between which the robot
moves as it would after those that are down already
(:func:`~heelstrike.contact.linearized.strikes.strikes`).

Left and right are then exchanged, and errors are looked at in coordinates of those that a standing
robot can have (:mod:`heelstrike.contact.linearized.standing`).
"""
