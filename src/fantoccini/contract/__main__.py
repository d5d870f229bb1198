"""``python -m fantoccini.contract`` writes what is made from the contract."""

from fantoccini.contract.cpp import HEADER, header

HEADER.write_text(header(), encoding="utf-8")
