"""``python -m fantoccini.kernel.contract`` writes the files that derive from the contract."""

from fantoccini.kernel.contract.cpp import HEADER, header
from fantoccini.kernel.contract.table import PAGE, page

HEADER.write_text(header(), encoding="utf-8")
PAGE.write_text(page(), encoding="utf-8")
