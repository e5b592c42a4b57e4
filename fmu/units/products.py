"""Products of the fast values of a Taylor series as C code, for baryscope.fmu.units.series."""

import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

MOST_SUMS = 12  # at a time, so that they stay in registers
_OF_SOLUTION = re.compile(r"terms\[k\]\.of\[(\d+)\]")


@dataclass(frozen=True)
class _Rows:
    """Pairs of values whose coefficients so far are at hand, in the solution's terms or else in pairs of their own.

    Attributes:
        place: C expression of what holds the latter, by the coefficient's number.
        member: of it, the union with them.
        values: C expressions of the k-th coefficients.
    """

    place: str
    member: str
    values: list[str]

    def at(self, pair: int, k: str) -> str:
        """The C expression of a pair's coefficient, before the k-th; of the solution's also the k-th."""
        if pair in self._kept:
            return f"{self.place}[{k}].{self.member}.pairs[{self._kept.index(pair)}]"
        return f"terms[{k}].pairs[{self._numbers(pair)[0] // 2}]"

    def newest(self, pair: int) -> str:
        """The C expression of a pair's k-th coefficient."""
        return f"PAIR({', '.join(self._values(pair))})" if pair in self._kept else self.at(pair, "k")

    def type(self) -> str:
        """The union's C type; empty if all pairs are the solution's."""
        return (
            f"union {{ double of[{2 * len(self._kept)}]; Pair pairs[{len(self._kept)}]; }} {self.member}; "
            if self._kept
            else ""
        )

    def stores(self) -> list[str]:
        """C statements that keep the k-th coefficients."""
        return [
            f"    {self.place}[k].{self.member}.of[{2 * place + lane}] = {value};"
            for place, pair in enumerate(self._kept)
            for lane, value in enumerate(self._values(pair))
        ]

    @cached_property
    def _kept(self) -> list[int]:
        return [pair for pair in range((len(self.values) + 1) // 2) if not self._is_of_solution(pair)]

    def _values(self, pair: int) -> list[str]:
        return [*self.values, "0.0"][2 * pair : 2 * pair + 2]

    def _numbers(self, pair: int) -> list[int]:
        found = (_OF_SOLUTION.fullmatch(value) for value in self._values(pair))
        return [int(match[1]) for match in found if match]

    def _is_of_solution(self, pair: int) -> bool:
        numbers = self._numbers(pair)
        return len(numbers) == 2 and numbers[0] % 2 == 0 and numbers[1] == numbers[0] + 1


@dataclass(frozen=True)
class Gathered:
    """The products of one level: squares, and rows of lanes of which each pair is multiplied by some factors.

    Attributes:
        number: the level.
        squares: C expressions of the k-th coefficients of what is squared, a name for each.
        halves: product → the names of (a + b)², a² and b².
        lanes: C expressions.
        factors: likewise.
        pairs: (factor, pair of lanes), by their places.
        results: product → (place in `pairs`, lane in the pair).
    """

    number: int
    squares: dict[str, str]
    halves: dict[str, tuple[str, str, str]]
    lanes: list[str]
    factors: list[str]
    pairs: list[tuple[int, int]]
    results: dict[str, tuple[int, int]]

    @classmethod
    def of(cls, number: int, products: dict[tuple[str, str], str]) -> "Gathered":
        """Operands in most products become factors first."""
        left = dict(products)
        squares = {name: a for (a, b), name in left.items() if a == b}
        names = {a: name for name, a in squares.items()}
        halves: dict[str, tuple[str, str, str]] = {}
        for (a, b), name in list(left.items()):
            if a in names and b in names:
                del left[a, b]
                if a != b:
                    squares[f"{name}_sum"] = f"({a} + {b})"
                    halves[name] = f"{name}_sum", names[a], names[b]
        chosen: list[tuple[str, int, str]] = []  # product, factor, lane
        factors: list[str] = []
        while left:
            count = Counter(operand for pair in left for operand in set(pair))
            factor = max(count, key=lambda operand: (count[operand], operand))
            for pair in [pair for pair in left if factor in pair]:
                chosen.append((left.pop(pair), len(factors), pair[1] if pair[0] == factor else pair[0]))
            factors.append(factor)
        lanes = sorted({lane for *_, lane in chosen}, key=lambda lane: (not lane.startswith("terms"), lane))
        places = [(factor, lanes.index(lane)) for _, factor, lane in chosen]
        pairs = sorted({(factor, lane // 2) for factor, lane in places})
        results = {
            name: (pairs.index((factor, lane // 2)), lane % 2)
            for (name, *_), (factor, lane) in zip(chosen, places, strict=True)
        }
        return cls(number, squares, halves, lanes, factors, pairs, results)

    @property
    def _rows(self) -> str:
        return f"work->rows{self.number}"

    @property
    def _roots(self) -> _Rows:
        return _Rows(self._rows, "roots", list(self.squares.values()))

    @property
    def _lanes(self) -> _Rows:
        return _Rows(self._rows, "lanes", self.lanes)

    def types(self) -> list[str]:
        """The C type of what it keeps of squares, lanes and factors."""
        factors = f"double factors[{max(1, len(self._kept_factors))}];"
        return [f"typedef struct {{ {self._roots.type()}{self._lanes.type()}{factors} }} Rows{self.number};"]

    def sums(self) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
        """Sums over the coefficients of both operands that are neither the first nor the k-th: of squares, and others.

        Each is a variable and its m-th term; of squares, those of which 2 m is less than k.
        """
        roots, lanes = self._roots, self._lanes
        squares = [
            (f"q{self.number}_{pair}", f"PRODUCT({roots.at(pair, 'm')}, {roots.at(pair, 'k - m')})")
            for pair in range((len(self.squares) + 1) // 2)
        ]
        others = [
            (f"s{self.number}_{place}", f"SCALED({lanes.at(pair, 'm')}, {self._factor(factor, 'k - m')})")
            for place, (factor, pair) in enumerate(self.pairs)
        ]
        return squares, others

    def products(self) -> list[str]:
        """The k-th coefficients of the products."""
        factors = [f"    {self._factor(place, 'k')} = {self.factors[place]};" for place in self._kept_factors]
        return self._roots.stores() + self._lanes.stores() + factors + self._squared() + self._multiplied()

    @property
    def _kept_factors(self) -> list[int]:
        return [place for place, factor in enumerate(self.factors) if not _OF_SOLUTION.fullmatch(factor)]

    def _factor(self, place: int, k: str) -> str:
        """The C expression of a factor's coefficient, before the k-th."""
        if place in self._kept_factors:
            return f"{self._rows}[{k}].factors[{self._kept_factors.index(place)}]"
        return self.factors[place].replace("[k]", f"[{k}]")

    def _squared(self) -> list[str]:
        roots, lines, sums = self._roots, [], {whole for whole, *_ in self.halves.values()}
        for pair in range((len(self.squares) + 1) // 2):
            total, newest, middle = f"q{self.number}_{pair}", roots.newest(pair), roots.at(pair, "k / 2")
            doubled = f"SCALED(SUM({total}, PRODUCT({roots.at(pair, '0')}, {newest})), 2.0)"
            lines.append(f"    {total} = k ? {doubled} : PRODUCT({newest}, {newest});")
            lines.append(f"    if (k && k % 2 == 0) {total} = SUM({total}, PRODUCT({middle}, {middle}));")
        for place, name in enumerate(self.squares):
            lines.append(f"    const double {name} = LANE(q{self.number}_{place // 2}, {place % 2});")
            lines += _doubled(name) if name not in sums else []
        for name, (whole, one, other) in self.halves.items():
            lines.append(f"    const double twice_{name} = {whole} - {one} - {other};")
            lines.append(f"    const double {name} = 0.5 * twice_{name}; (void){name}; (void)twice_{name};")
        return lines

    def _multiplied(self) -> list[str]:
        lanes, lines = self._lanes, []
        for place, (factor, pair) in enumerate(self.pairs):
            total, newest = f"s{self.number}_{place}", lanes.newest(pair)
            first = f"SCALED({lanes.at(pair, '0')}, {self.factors[factor]})"
            last = f"SCALED({newest}, {self._factor(factor, '0')})"
            alone = f"SCALED({newest}, {self.factors[factor]})"
            lines.append(f"    {total} = k ? SUM({total}, SUM({first}, {last})) : {alone};")
        for name, (place, lane) in self.results.items():
            lines += [f"    const double {name} = LANE(s{self.number}_{place}, {lane});", *_doubled(name)]
        return lines


def _doubled(name: str) -> list[str]:
    return [f"    const double twice_{name} = 2.0 * {name}; (void)twice_{name};"]


def sums_of(levels: list[Gathered]) -> list[str]:
    """C loops over m that take the sums of all levels, so many at a time as there are registers."""
    squares, others = ([sum for level in levels for sum in level.sums()[which]] for which in (0, 1))
    return _loops(squares, "2 * m < k") + _loops(others, "m < k")


def _loops(sums: list[tuple[str, str]], condition: str) -> list[str]:
    lines: list[str] = []
    for start in range(0, len(sums), MOST_SUMS):
        some = sums[start : start + MOST_SUMS]
        lines.append(f"    Pair {', '.join(f'{name} = PAIR(0.0, 0.0)' for name, _ in some)};")
        lines.append(f"    for (int m = 1; {condition}; m++) {{")
        lines += [f"        {name} = SUM({name}, {term});" for name, term in some]
        lines.append("    }")
    return lines
