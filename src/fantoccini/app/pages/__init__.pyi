"""The names of the package, and where each is defined."""

from .export import write_html as write_html
from .labels import handle_label_heights as handle_label_heights
from .loop import REFRESH as REFRESH, PageLoop as PageLoop
from .nodes import VIEWS as VIEWS, SceneNodes as SceneNodes, View as View, Viewpoint as Viewpoint
from .panel import (
    Plot as Plot,
    Views as Views,
    note_html as note_html,
    tension_table_html as tension_table_html,
)
from .plan_tree import PlanTree as PlanTree
from .replay import Replay as Replay, ResampledRun as ResampledRun
from .scene_state import SceneState as SceneState, scene_of_state as scene_of_state
from .server import Server as Server
from .viser_private import Handler as Handler, move_node as move_node
