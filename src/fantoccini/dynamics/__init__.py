"""Simulation and analysis: Marionette, equilibria, runs, derivatives, clearances.

q_D are the dynamic coordinates of a puppet, which move by the equations of motion, and q_K the
driven ones, given as functions of time: ends of strings, lengths of strings, driven joints. v_D,
v_K and acc_D, acc_K are their velocities and accelerations; n_qD, n_vD, n_qK and n_vK are the
numbers of coordinates and velocities. A row is a condition h <= 0: strings come first, with the gap
h = path length - string length, then joint limits. A row is taut (held, active) if h = 0, and slack
otherwise. A_D and A_K are the derivatives of h by q_D and q_K, and M_DD is the inertia matrix of
the dynamic velocities. At a release a taut string goes slack; at a catch a slack string becomes
taut, with an impulse. A winch changes the length of a string, and its slip is the length that it
lets out when the tension reaches the largest one.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
