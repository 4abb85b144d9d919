"""How kernels become machine code: the only room that knows Numba and LLVM from inside.

Its doors, which other rooms import from:

- ``bundle``: arrays and numbers by name, which kernels receive by address, and
  ``bundle_type``, the same in compiled code;
- ``compilation``: ``kernel``, ``dissolved_kernel``, ``rare_kernel``, how they are compiled, or left
  alone;
- ``separate_kernel``: kernels compiled apart, called by their address;
- ``straight_line``: kernels without loops, from what ``recordings`` keep of them, in which
  ``c_text`` writes the same in C;
- ``plain_code``: the switch for instructions that every processor has.

Nothing is imported here: ``plain_code`` comes before NumPy and Numba do.
"""
