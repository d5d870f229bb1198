"""Optimal control: the motion of least cost of a puppet within bounds."""

from fantoccini.optimal.api import follow as follow, optimise as optimise
from fantoccini.optimal.bounds import Bounds as Bounds
from fantoccini.optimal.costs import Smooth as Smooth, Track as Track
from fantoccini.optimal.result import OptimalStatus as OptimalStatus, Optimum as Optimum
from fantoccini.optimal.task import Task as Task
