"""The names of the package, and where each is defined."""

from . import animation as animation, exchange as exchange, reports as reports, view as view
from .animation import export as export
from .exchange import (
    ImportedPuppet as ImportedPuppet,
    ImportNote as ImportNote,
    import_model as import_model,
)
from .reports import (
    identified_report as identified_report,
    play_report as play_report,
    stand_report as stand_report,
)
from .view import (
    AUDIENCE as AUDIENCE,
    DARK as DARK,
    LIGHT as LIGHT,
    RENDERERS as RENDERERS,
    FilmError as FilmError,
    Theme as Theme,
    body_map_picture as body_map_picture,
    draw as draw,
    film as film,
    optimum_picture as optimum_picture,
    plan_picture as plan_picture,
    plot as plot,
    pose_times as pose_times,
    puppet_html as puppet_html,
    run_html as run_html,
    save_captions as save_captions,
    strip as strip,
)
