"""Speed and precision of heelstrike beside other engines; ``python benchmarks/speed --help``.

``scenarios``
    Robots, postures and laws of control for every engine alike.
``stopwatch``, ``race``
    Times that mean something; one scenario in every engine, in turn, and whose runs count.
``steps``, ``precision``, ``threads``, ``scaling``, ``footprint``, ``endurance``, ``laws``
    The parts: what each measures is in its first line.
``suite``, ``tables``, ``figures``, ``page``
    The parts one after the other; what was found, for the terminal, as figures, and in the docs.
"""
