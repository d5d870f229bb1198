"""Equations of motion, from symbolic derivation to a compiled library and its calls.

The contract declares every function and structure that Python and C++ share; equations are derived
symbolically with CasADi; codegen writes them as source text; build compiles this to a library, and
runtime calls it. q_D are the dynamic coordinates of a puppet, which move by the equations of
motion, and q_K the driven ones, given as functions of time: ends and lengths of strings, driven
joints. v_D, v_K and acc_D, acc_K are their velocities and accelerations. A row is a string or a
joint limit with its gap h <= 0; A_D and A_K are the derivatives of h by q_D and q_K. Lanes are runs
that the vector unit of the processor advances together (SIMD).
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
