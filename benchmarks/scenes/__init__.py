"""Random scenes for every simulation method, and a judge of its own for what comes out.

``python benchmarks/scenes --help`` runs a campaign; ``baseline.md`` beside this file is its last
committed table, ``causes.md`` says what lies behind it. The modules, from the bottom up:

``mechanics``, ``terrain``
    Kinematics, mass matrix, bias force and Jacobians of a planar tree, and distances to a polyline,
    written a second time in plain numpy, over all rows of a record at once.
``scene``
    What a scene is, and the random one of a seed.
``findings``, ``record``
    Laws that were measured, and how badly each was broken where; the mechanics at a run's rows.
``step_judge``, ``event_judge``, ``compliant_judge``
    The laws of time stepping, of event-driven runs and of compliant ground, re-derived from the
    record alone. Nothing of :mod:`heelstrike.sim`, ``contact`` or ``dynamics`` takes part.
``twins``
    The same scene mirrored, with its links in another order, or begun again.
``methods``, ``running``
    The simulation methods by name; one scene under one of them.
``space``
    Scenes in space: the same judge of time stepping, with mechanics and distances of its own.
``checks``
    Questions that are put to many scenes one by one: energy, twins, orders, bridges.
``campaign``, ``table``
    Many scenes in worker processes, resumable, and the page that sums them up.
"""
