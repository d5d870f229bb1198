"""Derivation: Tree -> Equations (Eqs. 1-11), symbolically with CasADi.

q_D are the dynamic coordinates, with velocities v_D and accelerations acc_D, and q_K the driven
ones (ends and lengths of strings, driven joints), with v_K and acc_K. A link is a body on its
joint. A row is a string or a joint limit with its gap h <= 0; A_D and A_K are the derivatives of h
by q_D and q_K. A wrench is a force with a torque.
"""

from fantoccini.kernel.equations.derivatives import Derivatives
from fantoccini.kernel.equations.functions import Equations, derive
from fantoccini.kernel.equations.variational import Variational
from fantoccini.kernel.equations.variational_derivatives import VariationalDerivatives

__all__ = ["Derivatives", "Equations", "Variational", "VariationalDerivatives", "derive"]
