"""The names of the package, and where each is defined."""

from .export import write_html as write_html
from .labels import heights as heights
from .loop import REFRESH as REFRESH, PageLoop as PageLoop
from .nodes import VIEWS as VIEWS, SceneNodes as SceneNodes, View as View, Viewpoint as Viewpoint
from .panel import Plot as Plot, Views as Views, bars as bars, note as note
from .plan_tree import PlanTree as PlanTree
from .replay import Replay as Replay, ResampledRun as ResampledRun
from .scene_state import SceneState as SceneState, scene_of_state as scene_of_state
from .server import Server as Server
from .viser_private import Handler as Handler, move as move
