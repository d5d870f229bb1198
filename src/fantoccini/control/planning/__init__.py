"""Planning: inputs that take a puppet to a goal among obstacles.

A segment is a piece of a plan with constant accelerations acc_K of the driven coordinates: ends and
lengths of strings, and driven joints. A node is a state at the end of a segment, in the search
tree. q_D are the dynamic coordinates and q_K the driven ones, v_D and v_K their velocities, and
n_vK is the number of driven velocities. A rollout is a simulation of inputs. A check is an instant
of a rollout at which clearances and bounds are evaluated.
"""

from fantoccini.control.planning.api import plan, solve
from fantoccini.control.planning.check import Check
from fantoccini.control.planning.feedback import ClosedLoopRollout, Feedback
from fantoccini.control.planning.options import PLANNERS, SearchOptions
from fantoccini.control.planning.planners import EST2007, Explore
from fantoccini.control.planning.polish import PolishResult, PolishStatus
from fantoccini.control.planning.result import PlanResult
from fantoccini.control.planning.search import Search

__all__ = [
    "EST2007",
    "PLANNERS",
    "Check",
    "ClosedLoopRollout",
    "Explore",
    "Feedback",
    "PlanResult",
    "PolishResult",
    "PolishStatus",
    "Search",
    "SearchOptions",
    "plan",
    "solve",
]
