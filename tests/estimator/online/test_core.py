"""What Python has of online.h: lengths, numbers of statuses and refusals, and structs, as the header has them."""

import ctypes
import re
import subprocess
from importlib.resources import files

import numpy as np
import pytest

from baryscope.estimator.limits import FARTHEST, FARTHEST_UNDER_J2, LATEST
from baryscope.estimator.online import OnlineStatus
from baryscope.estimator.online.core import MOST_FEATURES, Options, Orbit, Result, State, Thrust, Tumble, sources
from baryscope.estimator.online.estimator import REFUSED
from baryscope.fmu.generate.compiler import find_compiler
from baryscope.models.keplerian import ELEMENT_COUNT
from baryscope.models.sensor.navigation import STATUSES
from compiling import ONLY_WHAT_IS_CALLED, compiled, online_core_of

HEADER = re.sub(
    r"/\*.*?\*/", "", (files("baryscope.fmu") / "csrc" / "online" / "online.h").read_text("utf-8"), flags=re.DOTALL
)


RANGES = {"FARTHEST": FARTHEST, "FARTHEST_UNDER_J2": FARTHEST_UNDER_J2, "LATEST": LATEST}


def constant(name):
    return int(re.search(rf"\b{name} = (\d+)", HEADER)[1])


def names_of(enumeration):
    return re.search(rf"typedef enum {{([^}}]*)}} {enumeration};", HEADER)[1].replace(",", " ").split()


def fields_of(struct):
    """The fields in order, each with how many numbers it has."""
    body = re.search(rf"typedef struct {{([^}}]*)}} {struct};", HEADER)[1]
    numbers = re.sub(r"(Online\w+) (\w+)", r"\2[\1]", body.replace("double ", ""))  # structs: arrays of numbers
    declared = re.findall(r"(\w+)((?:\[\w+\])*)(?=[,;])", numbers)
    within = {kind: sum(size for _, size in fields_of(kind)) for kind in re.findall(r"Online\w+", body)}
    lengths = {"N_ELEMENTS": ELEMENT_COUNT} | within
    found = []
    for name, extents in declared:
        size = 1
        for extent in re.findall(r"\w+", extents):
            size *= lengths[extent] if extent in lengths else int(extent)
        found.append((name, size))
    return found


def test_lengths():
    assert constant("MOST_FEATURES") == MOST_FEATURES
    assert constant("N_ELEMENTS") == ELEMENT_COUNT


def test_ranges():
    assert {name: float(re.search(rf"#define {name} (\S+)", HEADER)[1]) for name in RANGES} == RANGES


def test_statuses_have_the_headers_numbers():
    assert [status.upper() for status in STATUSES] == names_of("OnlineStatus")
    assert [status.value for status in OnlineStatus] == list(STATUSES)


def test_refusals_have_the_headers_numbers():
    """What Python has checked before, or answers by None, has no text here."""
    assert [one.name for one in Result] == names_of("OnlineResult")
    assert [one.value for one in Result] == list(range(len(Result)))
    assert set(REFUSED) == {Result.BAD_TIME, Result.BAD_COVARIANCE, Result.BAD_NAME, Result.TOO_LATE, Result.TOO_FAR}


@pytest.mark.parametrize(
    "kind, struct",
    [
        (Orbit, "OnlineOrbit"),
        (Options, "OnlineOptions"),
        (State, "OnlineState"),
        (Tumble, "OnlineTumble"),
        (Thrust, "OnlineThrust"),
    ],
)
def test_structs_are_those_of_the_header(kind, struct):
    number = ctypes.sizeof(ctypes.c_double)
    assert [(name, ctypes.sizeof(of) // number) for name, of in kind._fields_] == fields_of(struct)


SEEMS = """#include "library.c"
static void soil(void) { volatile double stack[2000]; for (int k = 0; k < 2000; k++) stack[k] = 1e300, (void)stack[k]; }
void seems(double R[3][3], double turn[3][3], double noise[3][3], double M[3][3])
{
    Measurement measurement;
    copy(turn, measurement.turn), copy(noise, measurement.noise);
    soil();
    find_seeming(R, &measurement);
    copy(measurement.seems, M);
}"""


def test_a_noise_that_rounding_left_indefinite_shows_nothing(tmp_path):
    """Nothing of what is on the stack may come into what is taken back."""
    library = online_core_of(tmp_path, SEEMS, *ONLY_WHAT_IS_CALLED, "-fno-inline")  # what is soiled is what is used
    indefinite, sound = np.diag([1.0, 1.0, -1e-18]), 1e-4 * np.diag([1.0, 2.0, 4.0])
    R, turn, found = np.eye(3), 1e-4 * np.eye(3), np.full((3, 3), np.nan)

    def seems(noise):
        library.seems(*(one.ctypes.data_as(ctypes.c_void_p) for one in (R, turn, noise, found)))
        return found

    np.testing.assert_array_equal(seems(indefinite), np.zeros((3, 3)))
    weight = np.diag(1 / np.diag(sound))
    np.testing.assert_allclose(seems(sound), 2e-4 * (np.trace(weight) * np.eye(3) - weight), rtol=1e-12)


EXCEPTIONS = """#include "library.c"
#include <fenv.h>
#pragma STDC FENV_ACCESS ON
int raised(Online *filter, double time, double size, double deviation, double acceleration, int *refused)
{
    const long long names[] = {0, 1, 2, 3, 4};
    const OnlineThrust push = {{acceleration, 0.0, -acceleration}, {{1.0, 0, 0}, {0, 1.0, 0}, {0, 0, 1.0}}};
    const double shape[5][3] = {{1}, {-1, 0.5}, {0.2, -1, 0.3}, {0, 0.1, 1}, {0.4, 0.3, -1}};
    double points[15], covariances[30];
    for (int i = 0; i < 15; i++) points[i] = size * shape[i / 3][i % 3];
    for (int i = 0; i < 30; i++) covariances[i] = i % 6 == 0 || i % 6 == 3 || i % 6 == 5 ? deviation * deviation : 0.0;
    feclearexcept(FE_ALL_EXCEPT);
    *refused = online_update(filter, time, 5, names, points, covariances, &push);
    return fetestexcept(FE_OVERFLOW);
}"""


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """The core with `raised`."""
    library = online_core_of(tmp_path_factory.mktemp("watched"), EXCEPTIONS, "-Wno-unknown-pragmas")
    library.raised.argtypes = [ctypes.c_void_p, *[ctypes.c_double] * 4, ctypes.c_void_p]
    library.online_size.restype = ctypes.c_ulonglong
    return library


@pytest.mark.parametrize(
    "absurd, refusal",
    [
        ({}, "ACCEPTED"),
        ({"size": 1e9, "deviation": 1e6}, "ACCEPTED"),
        ({"deviation": 1e9}, "ACCEPTED"),
        ({"acceleration": 1e9}, "ACCEPTED"),
        ({"size": 1e150}, "BAD_POINT"),
        ({"size": 1.1e9}, "BAD_POINT"),
        ({"deviation": 1e150}, "BAD_COVARIANCE"),
        ({"acceleration": 1e150}, "BAD_ACCELERATION"),
        ({"time": 1e150}, "BAD_TIME"),
    ],
)
def test_what_is_out_of_range_is_refused_and_what_is_in_it_does_not_overflow(watched, absurd, refusal):
    """Points of 1e150 m were taken, and their squares overflowed: a host that traps exceptions ended there."""
    memory, options, refused = ctypes.create_string_buffer(watched.online_size()), Options(), ctypes.c_int()
    options.sigma, options.offset, options.speed, options.longest_gap = 0.01, 5.0, 10.0, 86400.0
    watched.online_start(memory, ctypes.byref(options))
    usual = {"size": 2.0, "deviation": 0.01, "acceleration": 0.0}
    for number, change in enumerate(({}, absurd, absurd, {})):
        frame = {"time": float(number)} | usual | change
        before = memory.raw
        assert watched.raised(memory, *(frame[name] for name in ("time", *usual)), ctypes.byref(refused)) == 0
        result = names_of("OnlineResult")[refused.value]
        assert result == (refusal if change else "ACCEPTED")
        assert (memory.raw == before) == (result != "ACCEPTED")


FLIGHT = """#include "library.c"
static int fly(double j2)
{
    static Online filter;
    const OnlineOptions options = {
        .sigma = 0.01, .offset = 2.0, .speed = 1.0, .thrust = 0.02, .longest_gap = 1e5, .on_orbit = 1.0,
        .orbit = {{7e6, 0.001, 1.0, 0.5, 0.3, 0.2, 3.986004418e14}, .j2 = j2, .equatorial_radius = 6.4e6}};
    const long long names[] = {0, 1, 2, 3, 4};
    const double shape[5][3] = {{1}, {-1, 0.5}, {0.2, -1, 0.3}, {0, 0.1, 1}, {0.4, 0.3, -1}};
    online_start(&filter, &options);
    for (int k = 0; k < 90; k++) {
        const OnlineThrust thrust = {{k > 45 ? 1e-3 : 0.0}, {{1.0, 0, 0}, {0, 1.0, 0}, {0, 0, 1.0}}};
        const double turn[3] = {0.06 * k, 0.03 * k, 0.12 * k};
        double R[3][3], points[5][3];
        OnlineState state;
        rotation(turn, R);
        for (int i = 0; i < 5; i++) times(R, shape[i], points[i]), points[i][1] += 20.0;
        if (online_update(&filter, k, 5, names, points[0], 0, &thrust) != ACCEPTED) return 2;
        if (online_predict(&filter, k + 1.0, &thrust, &state) != ACCEPTED) return 3;
    }
    return filter.manoeuvred != 1.0;
}
int main(void) { return fly(0.0) + 10 * fly(1e-3); }"""


@pytest.mark.skipif("zig" in " ".join(find_compiler()), reason="zig has no library of the sanitizer")
def test_no_array_is_read_beyond_its_end(tmp_path):
    """On an orbit, where not all members of the bank are, before thrust and after."""
    for name, content in sources().items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "flight.c").write_text(FLIGHT)
    checks = ("-O0", "-fsanitize=bounds", "-fno-sanitize-recover=all")
    compiled(tmp_path, *checks, "-Wno-error", "flight.c", "-o", "flight", "-lm")
    result = subprocess.run([tmp_path / "flight"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
