"""The names of the package, and where each is defined."""

from .page import (
    Page as Page,
    Subject as Subject,
    open_live_play as open_live_play,
    open_page as open_page,
    subject_of as subject_of,
    write_page as write_page,
)
from .showing import show as show
