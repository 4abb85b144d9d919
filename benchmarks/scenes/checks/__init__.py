"""Questions put to many random scenes that one look at one record does not answer.

Each is a command of ``python benchmarks/scenes`` that prints a line of JSON a scene and, at the
end, how many scenes pass, the worst of them, and every other by its seed:

``energy``
    Event-driven runs at rtol 1e-9: does work explain the change of energy to 1e-6?
``twins``
    Mirrored and renumbered twins, begun again 1 ms before events: do they agree 50 ms later?
``orders``
    Time stepping: how does the energy that no work explains fall with the step?
``bridges``
    Bridges that nothing called for: does their estimate cover their error?

``quadrature`` integrates over the rows of a record, ``summary`` sums the lines up.
"""
