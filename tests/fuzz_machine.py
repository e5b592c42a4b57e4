"""Random calls on one FMI 2 instance, for hypothesis, with a model of which of them are legal."""

import ctypes
import math

from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

OK, ERROR = 0, 3
START, INIT, STEP, EVENT, CONTINUOUS, END = (
    "instantiated",
    "initialization",
    "stepping",
    "event",
    "continuous",
    "terminated",
)
RUN = {STEP, EVENT, CONTINUOUS}
STATES = 14

# Mostly what is sensible, sometimes what is not.
numbers = st.one_of(
    st.floats(-2.0, 2.0), st.sampled_from([0.0, -0.0, 5e-324, 1e-30, 1e30, 1.7e308, math.nan, math.inf, -math.inf])
)
places = st.integers(0, 10_000)


def vectors(elements):
    """Vectors of states, some too short."""
    return st.lists(elements, min_size=STATES - 1, max_size=STATES)


def reals(values):
    return (ctypes.c_double * len(values))(*values)


def references_array(values):
    return (ctypes.c_uint32 * len(values))(*values)


class Machine(RuleBasedStateMachine):
    """Calls on one instance, and a model of which of them are legal."""

    library = folder = description = interface = None  # set by the test

    def __init__(self):
        super().__init__()
        self.messages = []
        callbacks = self.callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: self.messages.append(a[4].decode()))
        self.dll = self.library.dll
        self.dll.fmi2Instantiate.restype = ctypes.c_void_p
        token = self.description.guid.encode()
        self.component = ctypes.c_void_p(
            self.dll.fmi2Instantiate(b"fuzz", self.interface, token, b"", ctypes.byref(callbacks), 0, 0)
        )
        assert self.component
        self.variables = self.description.modelVariables
        self.mode, self.time, self.stop, self.saved = START, 0.0, math.inf, []

    def teardown(self):
        for state, *_ in self.saved:
            assert self.raw("FreeFMUstate", ctypes.byref(state)) == OK
        # Whatever happened, the instance is usable.
        assert [self.raw("Reset"), self.raw("EnterInitializationMode"), self.raw("ExitInitializationMode")] == [OK] * 3
        assert self.raw("Terminate") == OK
        self.dll.fmi2FreeInstance(self.component)

    def raw(self, name, *arguments):
        return getattr(self.dll, f"fmi2{name}")(self.component, *arguments)

    def memory(self):
        """All of the instance, as bytes."""
        state, size = ctypes.c_void_p(), ctypes.c_size_t()
        assert self.raw("GetFMUstate", ctypes.byref(state)) == OK
        assert self.raw("SerializedFMUstateSize", state, ctypes.byref(size)) == OK
        content = ctypes.create_string_buffer(size.value)
        assert self.raw("SerializeFMUstate", state, content, size) == OK
        assert self.raw("FreeFMUstate", ctypes.byref(state)) == OK
        return content.raw

    def attempt(self, legal, name, *arguments):
        """Make a call: the legal succeeds, the illegal is refused with a message and changes nothing; None: either."""
        before, said = self.memory(), len(self.messages)
        status = self.raw(name, *arguments)
        assert status in (OK, ERROR)
        assert legal is None or (status == OK) == legal, (name, self.mode, self.messages[said:])
        if status == ERROR:
            assert self.memory() == before
            assert len(self.messages) == said + 1
            assert self.messages[-1].startswith(f"fmi2{name}: ")
        return status == OK

    # ---- life cycle ----

    @initialize(ready=st.sampled_from([True, True, True, False]))
    def begin(self, ready):
        """Most begin in a run, where most can go wrong."""
        if ready:
            self.enter_initialization()
            self.exit_initialization()

    @rule(tolerance=st.none() | numbers, start=numbers, stop=st.none() | numbers)
    def setup(self, tolerance, start, stop):
        legal = self.mode == START and math.isfinite(start)
        legal = legal and (tolerance is None or (math.isfinite(tolerance) and tolerance > 0))
        legal = legal and (stop is None or stop >= start)
        double = ctypes.c_double
        if self.attempt(
            legal, "SetupExperiment", tolerance is not None, double(tolerance or 0.0), double(start),
            stop is not None, double(0.0 if stop is None else stop)
        ):  # fmt: skip
            self.time, self.stop = start, math.inf if stop is None else stop

    @rule()
    def enter_initialization(self):
        if self.attempt(self.mode == START, "EnterInitializationMode"):
            self.mode = INIT

    @precondition(lambda self: self.mode != START)
    @rule()
    def exit_initialization(self):
        if self.attempt(None if self.mode == INIT else False, "ExitInitializationMode"):
            self.mode = STEP if self.interface == 1 else EVENT

    @rule(sure=st.integers(0, 7))
    def terminate(self, sure):
        if sure == 0 and self.attempt(self.mode in RUN, "Terminate"):
            self.mode = END

    @rule(sure=st.integers(0, 7))
    def reset(self, sure):
        if sure == 0:
            self.attempt(True, "Reset")
            self.mode, self.time, self.stop = START, 0.0, math.inf

    # ---- values ----

    def settable(self, variable):
        if variable.causality == "input":
            return self.mode in {START, INIT} | RUN
        if variable.causality == "parameter":
            late = {STEP, EVENT} if variable.variability == "tunable" else set()
            return self.mode in {START, INIT} | late
        return variable.name.startswith("state.") and self.mode in {START, EVENT, CONTINUOUS}

    def chosen(self, picks, type_name):
        """References, some of them to nowhere or of another type, and whether all are of the type."""
        chosen = [place if place > 9_900 else place % len(self.variables) for place in picks]
        return chosen, all(r < len(self.variables) and self.variables[r].type == type_name for r in chosen)

    @rule(picks=st.lists(places, max_size=4), null=st.integers(0, 9), kind=st.sampled_from(["Real", "Boolean"]))
    def get(self, picks, null, kind):
        chosen, fits = self.chosen(picks, kind)
        values = (ctypes.c_double if kind == "Real" else ctypes.c_int) * len(chosen)
        legal = fits and not (null == 0 and chosen) and self.mode in {INIT, END} | RUN
        if legal and self.mode == INIT:
            legal = None  # the parameters may be impossible
        target = None if null == 0 else values()
        self.attempt(legal, f"Get{kind}", references_array(chosen), ctypes.c_size_t(len(chosen)), target)

    @rule(picks=st.lists(st.tuples(places, numbers), max_size=4), null=st.integers(0, 9))
    def set_reals(self, picks, null):
        chosen, fits = self.chosen([place for place, _ in picks], "Real")
        values = [value for _, value in picks]
        legal = fits and self.mode != END and not (null == 0 and chosen) and all(map(math.isfinite, values))
        if legal and not all(self.settable(self.variables[r]) for r in chosen):
            # Parameters may be set to what they are.
            others = [self.variables[r] for r in chosen if not self.settable(self.variables[r])]
            legal = None if all(v.causality == "parameter" for v in others) else False
        if legal and self.mode in RUN and any(self.variables[r].variability == "tunable" for r in chosen):
            legal = None  # the new parameters may be impossible
        target = None if null == 0 else reals(values)
        self.attempt(legal, "SetReal", references_array(chosen), ctypes.c_size_t(len(chosen)), target)

    @rule(near=st.floats(0.999, 1.001), value=st.booleans())
    def set_something_possible(self, near, value):
        """So that the others have something to chew on."""
        by_name = {v.name: v for v in self.variables}
        first, flag = by_name["chaser.acceleration[1]"], by_name["gravityGradient"]
        one = ctypes.c_size_t(1)
        self.attempt(
            self.settable(first), "SetReal", references_array([first.valueReference]), one, reals([near / 1e3])
        )
        legal = None if self.mode in RUN else self.settable(flag)
        self.attempt(legal, "SetBoolean", references_array([flag.valueReference]), one, (ctypes.c_int * 1)(value))

    @rule(count=st.integers(0, 2), name=st.sampled_from(["GetInteger", "SetInteger", "GetString", "SetString"]))
    def types_that_are_not_there(self, count, name):
        modes = RUN | {INIT, START} if name.startswith("Set") else RUN | {INIT, END}
        self.attempt(
            count == 0 and self.mode in modes, name, references_array([0] * count), ctypes.c_size_t(count), None
        )

    # ---- stepping, Model Exchange ----

    @rule(size=st.floats(1e-3, 50.0) | st.floats(1e-3, 1.0) | numbers, off=st.integers(0, 5), point=numbers)
    def step(self, size, off, point):
        if size > 1e6 and math.isfinite(size):
            size = -size  # a legal one would take a minute
        point = point if off == 0 else self.time
        slack, end = 1e-9 * max(1.0, abs(self.time)), point + size
        legal = self.mode == STEP and math.isfinite(size) and size > 0 and abs(point - self.time) <= slack
        legal = legal and end > self.time and end <= self.stop + 1e-9 * max(1.0, abs(self.stop))
        legal = None if legal else False  # the integration may fail
        if self.attempt(legal, "DoStep", ctypes.c_double(point), ctypes.c_double(size), 1):
            self.time = end

    @rule(name=st.sampled_from(["EnterEventMode", "EnterContinuousTimeMode"]))
    def change_mode(self, name):
        source, target = (CONTINUOUS, EVENT) if name == "EnterEventMode" else (EVENT, CONTINUOUS)
        if self.attempt(self.mode == source, name):
            self.mode = target

    @rule(time=numbers)
    def set_time(self, time):
        legal = self.mode in {EVENT, CONTINUOUS} and math.isfinite(time)
        if self.attempt(legal, "SetTime", ctypes.c_double(time)):
            self.time = time

    @rule(values=vectors(st.floats(-2.0, 2.0)) | vectors(numbers), name=st.sampled_from(
        ["SetContinuousStates", "GetContinuousStates", "GetDerivatives", "GetNominalsOfContinuousStates"]
    ))  # fmt: skip
    def continuous_states(self, values, name):
        fits = len(values) == STATES
        if name == "SetContinuousStates":
            legal = self.mode == CONTINUOUS and fits and all(map(math.isfinite, values))
        else:
            legal = self.mode in {INIT, EVENT, CONTINUOUS, END} and fits
            legal = None if legal and self.mode == INIT else legal
        self.attempt(legal, name, reals(values), ctypes.c_size_t(len(values)))

    # ---- saved states, derivatives ----

    @rule()
    def save(self):
        state = ctypes.c_void_p()
        assert self.attempt(True, "GetFMUstate", ctypes.byref(state))
        self.saved.append((state, self.mode, self.time, self.stop, self.memory()))

    @precondition(lambda self: self.saved)
    @rule(which=places)
    def restore(self, which):
        state, self.mode, self.time, self.stop, memory = self.saved[which % len(self.saved)]
        assert self.attempt(True, "SetFMUstate", state)
        assert self.memory() == memory

    @precondition(lambda self: self.saved)
    @rule(which=places, place=st.none() | places, cut=st.integers(0, 5))
    def restore_from_bytes(self, which, place, cut):
        _, mode, time, stop, memory = self.saved[which % len(self.saved)]
        content, state = bytearray(memory), ctypes.c_void_p()
        if place is not None:
            content[80 + place % (len(content) - 80)] ^= 1  # past magic and token
        size = len(content) - (cut == 0)
        legal = place is None and cut != 0
        buffer = ctypes.create_string_buffer(bytes(content), len(content))
        if self.attempt(legal, "DeSerializeFMUstate", buffer, ctypes.c_size_t(size), ctypes.byref(state)):
            assert self.attempt(True, "SetFMUstate", state)
            assert self.attempt(True, "FreeFMUstate", ctypes.byref(state))
            self.mode, self.time, self.stop = mode, time, stop
            assert self.memory() == memory

    @precondition(lambda self: self.saved)
    @rule(which=places)
    def forget(self, which):
        state, *_ = self.saved.pop(which % len(self.saved))
        assert self.attempt(True, "FreeFMUstate", ctypes.byref(state))
        assert not state.value
        self.attempt(False, "SetFMUstate", state)

    @rule(knowns=st.lists(places, max_size=3), unknowns=st.lists(places, max_size=3), seed=numbers)
    def derivative(self, knowns, unknowns, seed):
        (knowns, fit), (unknowns, fits) = self.chosen(knowns, "Real"), self.chosen(unknowns, "Real")

        def known(v):
            if self.mode == INIT:
                return v.causality in ("input", "parameter")
            return v.causality == "input" or v.variability == "tunable" or v.name.startswith("state.")

        def unknown(v):
            return (
                v.causality == "output" or v.name.startswith("der(") or (self.mode == INIT and v.causality == "local")
            )

        legal = fit and fits and self.mode in {INIT, END} | RUN
        legal = legal and all(known(self.variables[r]) for r in knowns)
        legal = legal and all(unknown(self.variables[r]) for r in unknowns)
        legal = None if legal and self.mode == INIT else legal
        sizes = ctypes.c_size_t(len(unknowns)), ctypes.c_size_t(len(knowns))
        self.attempt(
            legal, "GetDirectionalDerivative", references_array(unknowns), sizes[0], references_array(knowns), sizes[1],
            reals([seed] * len(knowns)), reals([0.0] * len(unknowns)),
        )  # fmt: skip
