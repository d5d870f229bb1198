"""The shortest of several forms of a polynomial in cosines, sines and symbols.

A generator is a symbol of which polynomials consist, here a cosine, a sine or another symbol.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.polys.rings import PolyElement

Monomial = tuple[int, ...]

_MAX_TERMS = 150
"""Most terms of a polynomial for which other forms than the expanded one are tried."""
_MAX_DEGREE = 10
"""Largest degree in cosines and sines for which the form with sums of angles is tried."""


@dataclass
class Form:
    """The meaning of the generators of a ring.

    Attributes:
        meaning: expression of each generator.
        velocities: generators that are velocities.
        inverse: generators that are reciprocals.
        pairs: generator of a cosine -> generator of the sine of the same angle.
    """

    meaning: list[sp.Expr]
    velocities: set[int]
    inverse: set[int]
    pairs: dict[int, int]

    def shortest(self, value: PolyElement) -> sp.Expr:
        """The polynomial as an expression with few operations."""
        reduced = self._over(value, self.inverse)
        by_velocity = self._over(value, self.inverse | self.velocities)
        return min((reduced, by_velocity), key=_cost)

    def _over(self, value: PolyElement, outside: set[int]) -> sp.Expr:
        """A sum of products: a monomial of the generators ``outside``, times a short expression."""
        groups: dict[Monomial, dict[Monomial, Any]] = {}
        for monomial, coefficient in value.items():
            key = tuple(e if k in outside else 0 for k, e in enumerate(monomial))
            remaining = tuple(0 if k in outside else e for k, e in enumerate(monomial))
            groups.setdefault(key, {})[remaining] = coefficient
        total = sp.S.Zero
        for key, terms in groups.items():
            total += sp.Mul(self._monomial(key), self._short(terms))
        return total

    def _short(self, terms: dict[Monomial, Any]) -> sp.Expr:
        expanded = sp.Add(*(_number(c) * self._monomial(m) for m, c in terms.items()))
        if len(terms) > _MAX_TERMS:
            return expanded
        forms = [expanded, expanded.replace(_is_even_cosine, _as_sine).expand()]
        if all(self._degree(m) <= _MAX_DEGREE for m in terms):
            forms.append(self._sums_of_angles(terms))
        forms += [change(form) for form in forms for change in _CHANGES]
        return min(forms, key=_cost)

    def _monomial(self, monomial: Sequence[int]) -> sp.Expr:
        powers = (self.meaning[k] ** e for k, e in enumerate(monomial) if e)
        return sp.Mul(*powers)

    def _degree(self, monomial: Monomial) -> int:
        return sum(monomial[c] + monomial[s] for c, s in self.pairs.items())

    def _sums_of_angles(self, terms: dict[Monomial, Any]) -> sp.Expr:
        """Cosines and sines of sums of angles, equal to products of cosines and sines.

        cos a = (e^ia + e^-ia) / 2 and sin a = (e^ia - e^-ia) / 2i are expanded; two opposite waves
        are then one cosine and one sine.
        """
        cosines = list(self.pairs)
        angles = [self.meaning[c].args[0] for c in cosines]
        waves: dict[tuple[Monomial, Monomial], sp.Expr] = {}
        for monomial, coefficient in terms.items():
            remaining = list(monomial)
            wave = {(0,) * len(cosines): _number(coefficient)}
            for n, (c, s) in enumerate(self.pairs.items()):
                for _ in range(monomial[c]):
                    wave = _times(wave, n, sp.S.Half, sp.S.Half)
                for _ in range(monomial[s]):
                    wave = _times(wave, n, -sp.I / 2, sp.I / 2)
                remaining[c] = remaining[s] = 0
            for turns, factor in wave.items():
                key = (tuple(remaining), turns)
                waves[key] = waves.get(key, sp.S.Zero) + factor
        total = []
        for (other_monomial, turns), factor in waves.items():
            if next((t for t in turns if t), 0) < 0:
                continue
            re, im = factor.as_real_imag()
            factor_of_two = 2 if any(turns) else 1
            angle = sp.Add(*(t * a for t, a in zip(turns, angles, strict=True)))
            total.append(
                self._monomial(other_monomial)
                * factor_of_two
                * (re * sp.cos(angle) - im * sp.sin(angle))
            )
        return sp.Add(*total).expand(trig=False)


def _times(
    wave: dict[Monomial, sp.Expr], n: int, numerator: sp.Expr, denominator: sp.Expr
) -> dict[Monomial, sp.Expr]:
    """The wave times up e^ia + down e^-ia, with a the n-th angle."""
    out: dict[Monomial, sp.Expr] = {}
    for turns, factor in wave.items():
        for step, weight in ((1, numerator), (-1, denominator)):
            key = (*turns[:n], turns[n] + step, *turns[n + 1 :])
            out[key] = out.get(key, sp.S.Zero) + factor * weight
    return out


def _number(coefficient: Any) -> sp.Rational:
    return sp.Rational(int(coefficient.numerator), int(coefficient.denominator))


def _is_even_cosine(e: sp.Expr) -> bool:
    return e.is_Pow and isinstance(e.base, sp.cos) and e.exp.is_Integer and e.exp % 2 == 0


def _as_sine(e: sp.Expr) -> sp.Expr:
    return (1 - sp.sin(e.base.args[0]) ** 2) ** (e.exp / 2)


def _factored(form: sp.Expr) -> sp.Expr:
    """The form with common factors of the summands outside; numbers stay in the summands."""
    factored = sp.factor_terms(form)
    number, remaining = factored.as_coeff_Mul()
    sums = [part for part in sp.Mul.make_args(remaining) if part.is_Add]
    if number in (1, -1) or len(sums) != 1:
        return factored
    if all(abs(term.as_coeff_Mul()[0]) == 1 for term in sums[0].args):
        return factored
    spread = sp.Add(*(number * term for term in sums[0].args))
    return sp.Mul(*(spread if part is sums[0] else part for part in sp.Mul.make_args(remaining)))


def _collected(form: sp.Expr) -> sp.Expr:
    """The form collected by plain symbols, such as masses and other parameters."""
    symbols = sorted(form.free_symbols, key=lambda s: s.name)
    return sp.collect(form, symbols) if form.is_Add and len(form.args) > 1 else form


def _cost(form: sp.Expr) -> tuple[int, int]:
    return int(sp.count_ops(form)), len(sp.Add.make_args(form))


_CHANGES: tuple[Callable[[sp.Expr], sp.Expr], ...] = (_factored, _collected)
