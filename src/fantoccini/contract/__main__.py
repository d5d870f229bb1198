"""``python -m fantoccini.contract`` writes what is made from the contract."""

from fantoccini.contract.cpp import HEADER, header
from fantoccini.contract.table import PAGE, page

HEADER.write_text(header(), encoding="utf-8")
PAGE.write_text(page(), encoding="utf-8")
