"""The names of the package, and where each is defined."""

from .page import (
    Page as Page,
    Subject as Subject,
    open_page as open_page,
    open_show as open_show,
    subject_of as subject_of,
    write_page as write_page,
)
from .showing import show as show
