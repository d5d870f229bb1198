"""Measurements made once, for choices: text of docs/growth.md with its figures."""

from __future__ import annotations

from benchmarks.strings.report import Table

FACTORISATION = (
    "M_DD can be factorised with the tree's sparsity (no fill-in), with the cube of a chain's "
    "length in operations, or by the articulated-body recursion, in proportion to the links. The "
    "table counts the operations of a whole evaluation, and of one product with the inverse "
    "factor, before and after the recursion replaced the sparse factor (with other savings of "
    "the same days; the bodies are those above). In short chains the sparse factor's products "
    "are cheaper, and the recursion costs up to an eighth more in a whole evaluation; it is used "
    "at every size, to have a single method."
)

FACTORS = Table(
    ["puppet", "sparse factor", "recursion", "exact", "sparse product", "recursion's"],
    [
        ["arm2d", "148", "140", "140", "4", "8"],
        ["marionette", "7558", "5757", "4627", "337", "395"],
        ["chain, 5", "1665", "1865", "1793", "25", "103"],
        ["chain, 10", "4801", "4843", "4614", "100", "324"],
        ["chain, 25", "22766", "13148", "12454", "625", "939"],
        ["bushy, 5", "1110", "1189", "1114", "17", "44"],
    ],
)

EVALUATION = (
    "One event-driven evaluation of the marionette with all strings taut (drive, model, "
    "tensions), `benchmarks/speed/scalar.cpp`; the shortest of 1,800 runs of 1,000 evaluations, "
    "all variants in turn, on the machine below. A piece is a function of the given number of "
    "statements; a work array passes values between pieces, and within a piece they are local. "
    "Before these choices the evaluation took 3.32 us."
)

VARIANTS = Table(
    ["text and flags", "us"],
    [
        ["CasADi's own text, -O2", "2.31"],
        ["one piece, -O2", "2.04"],
        ["pieces of 500, -O2", "2.03"],
        ["**pieces of 1000, -O2**", "**2.05**"],
        ["pieces of 2000, -O2", "2.10"],
        ["pieces of 1000, -O2 -fno-tree-slp-vectorize", "2.10"],
        ["pieces of 1000, -O1", "2.97"],
    ],
)

COMPILERS = (
    "The chain of 100 DOF took the compilers 35.0 s in total at -O2 and 26.1 s at -O1 (29 files, "
    "none above 3.7 s). The runtime takes 2 s to 4 s of this time. At every size g++ now compiles "
    "with the parts of -O2 that make steps faster, and files are twice as long ([first motion]"
    "(measured.md#first-motion))."
)
