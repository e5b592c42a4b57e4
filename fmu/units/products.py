"""Products of the fast values of a Taylor series as C code, for baryscope.fmu.units.series."""

from collections import Counter
from dataclasses import dataclass

MOST_SUMS = 12  # at a time, so that they stay in registers


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

    def types(self) -> list[str]:
        """The C type of its squares, lanes and factors."""
        lanes, squares = (2 * ((len(items) + 1) // 2) or 2 for items in (self.lanes, list(self.squares)))
        return [
            f"typedef struct {{ union {{ double of[{squares}]; Pair pairs[{squares // 2}]; }} roots; "
            f"union {{ double of[{lanes}]; Pair pairs[{lanes // 2}]; }} lanes; "
            f"double factors[{max(1, len(self.factors))}]; }} Rows{self.number};"
        ]

    def sums(self) -> list[str]:
        """Sums over the coefficients of both operands that are neither the first nor the k-th."""
        rows = f"work->rows{self.number}"
        squares = [
            (f"q{self.number}_{place}", f"PRODUCT({rows}[m].roots.pairs[{place}], {rows}[k - m].roots.pairs[{place}])")
            for place in range((len(self.squares) + 1) // 2)
        ]
        others = [
            (f"s{self.number}_{place}", f"SCALED({rows}[m].lanes.pairs[{pair}], {rows}[k - m].factors[{factor}])")
            for place, (factor, pair) in enumerate(self.pairs)
        ]
        return _loops(squares, "2 * m < k") + _loops(others, "m < k")

    def products(self) -> list[str]:
        """The k-th coefficients of the products."""
        rows, roots = f"work->rows{self.number}[k]", list(self.squares.values())
        stored = {
            "roots.of": roots + ["0.0"] * (len(roots) % 2),
            "lanes.of": self.lanes + ["0.0"] * (len(self.lanes) % 2),
        }
        stored["factors"] = self.factors
        lines = [
            f"    {rows}.{where}[{place}] = {text};"
            for where, texts in stored.items()
            for place, text in enumerate(texts)
        ]
        return lines + self._squared() + self._multiplied()

    def _squared(self) -> list[str]:
        rows, roots = f"work->rows{self.number}", [*self.squares.values(), "0.0"]
        lines = []
        for place in range(len(self.squares) // 2 + len(self.squares) % 2):
            total, newest = f"q{self.number}_{place}", _pair(roots, place)
            first, middle = (f"{rows}[{k}].roots.pairs[{place}]" for k in ("0", "k / 2"))
            doubled = f"SCALED(SUM({total}, PRODUCT({first}, {newest})), 2.0)"
            lines.append(f"    {total} = k ? {doubled} : PRODUCT({newest}, {newest});")
            lines.append(f"    if (k && k % 2 == 0) {total} = SUM({total}, PRODUCT({middle}, {middle}));")
        for place, name in enumerate(self.squares):
            lines.append(f"    const double {name} = LANE(q{self.number}_{place // 2}, {place % 2});")
        for name in self.squares:
            lines += _doubled(name) if name not in {whole for whole, *_ in self.halves.values()} else []
        for name, (whole, one, other) in self.halves.items():
            lines.append(f"    const double twice_{name} = {whole} - {one} - {other};")
            lines.append(f"    const double {name} = 0.5 * twice_{name}; (void){name}; (void)twice_{name};")
        return lines

    def _multiplied(self) -> list[str]:
        rows, lanes, lines = f"work->rows{self.number}", [*self.lanes, "0.0"], []
        for place, (factor, pair) in enumerate(self.pairs):
            total, newest = f"s{self.number}_{place}", _pair(lanes, pair)
            first = f"SCALED({rows}[0].lanes.pairs[{pair}], {self.factors[factor]})"
            last = f"SCALED({newest}, {rows}[0].factors[{factor}])"
            alone = f"SCALED({newest}, {self.factors[factor]})"
            lines.append(f"    {total} = k ? SUM({total}, SUM({first}, {last})) : {alone};")
        for name, (place, lane) in self.results.items():
            lines += [f"    const double {name} = LANE(s{self.number}_{place}, {lane});", *_doubled(name)]
        return lines


def _doubled(name: str) -> list[str]:
    return [f"    const double twice_{name} = 2.0 * {name}; (void)twice_{name};"]


def _pair(texts: list[str], place: int) -> str:
    return f"PAIR({texts[2 * place]}, {texts[2 * place + 1]})"


def _loops(sums: list[tuple[str, str]], condition: str) -> list[str]:
    """Loops over m that add terms to sums, so many at a time as there are registers."""
    lines: list[str] = []
    for start in range(0, len(sums), MOST_SUMS):
        some = sums[start : start + MOST_SUMS]
        lines.append(f"    Pair {', '.join(f'{name} = PAIR(0.0, 0.0)' for name, _ in some)};")
        lines.append(f"    for (int m = 1; {condition}; m++) {{")
        lines += [f"        {name} = SUM({name}, {term});" for name, term in some]
        lines.append("    }")
    return lines
